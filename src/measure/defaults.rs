//! What tables and figures ask of a method besides its measurement: its settings as values, its look, and the rows that
//! it has where nobody says which.

use super::cell::{Cell, FromText};
use crate::shadow::{Key, METHODS, Method};

/// A method's settings by their keys, given or not; the size of its map, which has a column of its own, is not among
/// them.
pub fn settings(method: &dyn Method) -> Vec<(&'static str, Cell)> {
    settings_of(method.name(), &method.params())
}

/// The same from a method's name and its `key=value` texts.
pub(crate) fn settings_of(name: &str, params: &str) -> Vec<(&'static str, Cell)> {
    let entry = METHODS.iter().find(|entry| entry.name == name);
    let given = |key: &Key| {
        let values = params.split_whitespace().filter_map(|p| p.split_once('='));
        values.filter(|(k, _)| *k == key.name).map(|(_, value)| value).next()
    };
    // A method that is not in the registry has the keys that it names. The order is that of the columns.
    let value = |key: &'static Key| {
        let own = entry.and_then(|entry| entry.keys.iter().find(|own| own.name == key.name));
        let known = own.is_some() || entry.is_none();
        Some((key.name, given(key).or(own.map(|own| own.default)).filter(|_| known)?))
    };
    keys()
        .into_iter()
        .filter_map(value)
        .filter_map(|(key, text)| Some((key, Cell::from_text(text)?)))
        .collect()
}

/// Every key of every method, once each.
fn keys() -> Vec<&'static Key> {
    let mut keys: Vec<&Key> = Vec::new();
    for key in METHODS.iter().flat_map(|entry| entry.keys).filter(|key| key.name != "map") {
        if keys.iter().all(|k| k.name != key.name) {
            keys.push(key);
        }
    }
    keys
}

/// Every key of every method with what it is: the last columns of the table.
pub(super) fn setting_columns() -> Vec<(&'static str, String)> {
    let column = |key: &'static Key| {
        let own = |e: &&&crate::shadow::Entry| e.keys.iter().any(|k| k.name == key.name);
        let of: Vec<_> = METHODS.iter().filter(own).map(|e| format!("`{}`", e.name)).collect();
        (key.name, format!("Setting of {}: {} ({}).", of.join(", "), key.help, key.values.replace('|', ", ")))
    };
    keys().into_iter().map(column).collect()
}

/// What a method's points look like in figures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Marker {
    /// A disc.
    Circle,
    /// A square on its side.
    Square,
    /// A square on its corner.
    Diamond,
    /// A triangle that points upwards.
    Up,
    /// A triangle that points downwards.
    Down,
    /// Two diagonal strokes.
    Cross,
    /// An upright and a level stroke.
    Plus,
    /// Five rays.
    Star,
}

/// A method's colour (sRGB) and marker, the same in every figure.
pub type Style = ([u8; 3], Marker);

/// The style of a method of the registry. Colours are of the Okabe-Ito palette (Okabe and Ito 2008), whose yellow is too
/// pale on white.
pub fn style(method: &str) -> Option<Style> {
    Some(match method {
        "none" => ([0, 0, 0], Marker::Cross),
        "rays" => ([204, 121, 167], Marker::Star),
        "dsm" => ([0, 114, 178], Marker::Circle),
        "osm" => ([230, 159, 0], Marker::Square),
        "dom" => ([0, 158, 115], Marker::Up),
        "bom" => ([213, 94, 0], Marker::Diamond),
        _ => return None,
    })
}

/// `compare --methods` by default: every family, each with at least three settings.
pub fn compare_methods() -> String {
    "none;rays;dsm:epsilon=0.06,0.02,0.005;osm:layers=8,32,128;dom:layers=3,7,15;bom:layers=3,7,15".into()
}

/// `probe --curve --methods` by default: one of each kind of map, and two error bounds.
pub fn curve_methods() -> String {
    "dsm:epsilon=0.06,0.02;osm:layers=16;dom:layers=15;bom:layers=15".into()
}

/// `stability --methods` by default: one row of each family.
pub fn stability_methods() -> String {
    "none;rays;dsm:map=64;osm:layers=32,map=64;dom:map=64;bom:map=64".into()
}

/// Whether a method's rows set the budgets within which others are compared: those that follow an error bound.
pub fn sets_budgets(method: &str) -> bool {
    method == "dsm"
}
