//! Properties of shadow methods for tables and figures: settings as cell values, figure style and default rows.

use super::cell::{Cell, FromText};
use crate::shadow::{Key, METHODS, Method, Style, entry};
use itertools::Itertools as _;

/// Returns the settings of a shadow method by name, defaults included, in the order of the comparison table's
/// columns. The shadow map size is excluded; it has its own column.
pub fn settings(method: &dyn Method) -> Vec<(&'static str, Cell)> {
    let values = method.values();
    let value =
        |key: &Key| method.entry().keys.iter().position(|own| own.name == key.name).map(|i| values[i]);
    let cell = |key: &'static Key| Some((key.name, Cell::from_text(&value(key)?.to_string())?));
    keys().into_iter().filter_map(cell).collect()
}

/// Returns the distinct settings of all shadow methods, except the map size.
fn keys() -> Vec<&'static Key> {
    let keys = METHODS.iter().flat_map(|entry| entry.keys).filter(|key| key.name != "map");
    keys.unique_by(|key| key.name).collect()
}

/// Returns the names and descriptions of all method settings, which are the last columns of the comparison table.
pub(super) fn setting_columns() -> Vec<(&'static str, String)> {
    let column = |key: &'static Key| {
        // Methods with the same description of the setting, in the order of the methods.
        let mut texts: Vec<(String, Vec<String>)> = Vec::new();
        for entry in METHODS.iter() {
            let Some(own) = entry.keys.iter().find(|k| k.name == key.name) else { continue };
            let text = format!("{} ({})", own.help, own.values().replace('|', ", "));
            match texts.iter_mut().find(|(known, _)| *known == text) {
                Some((_, methods)) => methods.push(format!("`{}`", entry.name)),
                None => texts.push((text, vec![format!("`{}`", entry.name)])),
            }
        }
        let of =
            |(text, methods): &(String, Vec<String>)| format!("Setting of {}: {text}.", methods.join(", "));
        (key.name, texts.iter().map(of).collect::<Vec<_>>().join(" "))
    };
    keys().into_iter().map(column).collect()
}

/// Returns the figure style (such as colour) of a shadow method by its name; `None` where no such method exists.
pub fn style(method: &str) -> Option<Style> {
    entry(method).map(|entry| entry.style)
}

/// Returns the settings of a shadow method for a comparison table row in a test, from the method's name and
/// `key=value` texts.
#[cfg(test)]
pub(crate) fn settings_of(name: &str, params: &str) -> Vec<(&'static str, Cell)> {
    let spec = format!("{name}:{}", params.replace(' ', ","));
    crate::shadow::parse(spec.trim_end_matches(':')).map_or_else(|_| Vec::new(), |m| settings(m.as_ref()))
}
