//! Properties of a method that tables and figures use besides its measurement: settings as values, figure style and
//! default rows.

use super::cell::{Cell, FromText};
use crate::shadow::{Entry, Key, METHODS, Method, Style, entry};
use itertools::Itertools as _;

/// A method's settings by their keys, given or not, in the order of the columns; the size of its map, which has a column
/// of its own, is not among them.
pub fn settings(method: &dyn Method) -> Vec<(&'static str, Cell)> {
    let values = method.values();
    let value =
        |key: &Key| method.entry().keys.iter().position(|own| own.name == key.name).map(|i| values[i]);
    let cell = |key: &'static Key| Some((key.name, Cell::from_text(&value(key)?.to_string())?));
    keys().into_iter().filter_map(cell).collect()
}

/// Every key of every method, once each.
fn keys() -> Vec<&'static Key> {
    let keys = METHODS.iter().flat_map(|entry| entry.keys).filter(|key| key.name != "map");
    keys.unique_by(|key| key.name).collect()
}

/// Every key of every method with what it is: the last columns of the table.
pub(super) fn setting_columns() -> Vec<(&'static str, String)> {
    let column = |key: &'static Key| {
        let own = |e: &&&Entry| e.keys.iter().any(|k| k.name == key.name);
        let of: Vec<_> = METHODS.iter().filter(own).map(|e| format!("`{}`", e.name)).collect();
        (
            key.name,
            format!("Setting of {}: {} ({}).", of.join(", "), key.help, key.values().replace('|', ", ")),
        )
    };
    keys().into_iter().map(column).collect()
}

/// Style of a registered method in all figures.
pub fn style(method: &str) -> Option<Style> {
    entry(method).map(|entry| entry.style)
}

/// The settings of a row that a test makes up, from its method's name and `key=value` texts.
#[cfg(test)]
pub(crate) fn settings_of(name: &str, params: &str) -> Vec<(&'static str, Cell)> {
    let spec = format!("{name}:{}", params.replace(' ', ","));
    crate::shadow::parse(spec.trim_end_matches(':')).map_or_else(|_| Vec::new(), |m| settings(m.as_ref()))
}
