//! Colour maps of MRIcroGL and NiiVue, `.json`: arrays `R`, `G`, `B`, `A` of 0 to 255 at the places `I`, 0 to 255, which lie
//! over `min` to `max` where the file gives them, else over the range that is shown
//! (<https://niivue.com/docs/colormaps2>).

use super::carried::{Carried, FRACTION, Parts, colors, opacities};
use super::curve::{Node, Ways, linear};
use super::numbers;
use serde_json::Value;

/// The last place, and the largest amount.
const TOP: f64 = 255.0;

/// Whether a JSON value is a colour map.
pub fn is_one(value: &Value) -> bool {
    value.as_object().is_some_and(|map| ["R", "G", "B"].iter().all(|key| map.contains_key(*key)))
}

/// Reads it.
///
/// # Errors
/// It is of labels, its arrays differ in length, or its range is empty.
pub fn read(value: &Value) -> Result<Carried, String> {
    let map = value.as_object().ok_or("it is no object")?;
    if map.contains_key("labels") {
        return Err("its colours are of labels, not of values".into());
    }
    let array = |key: &str| numbers::list(map, key)?.ok_or_else(|| format!("`{key}` is missing"));
    let [r, g, b] = [array("R")?, array("G")?, array("B")?];
    let count = r.len();
    let mut warnings = Vec::new();
    let a = numbers::list(map, "A")?.unwrap_or_else(|| {
        warnings.push("`A` is missing: opacities go from 0 to 1".into());
        evenly(count)
    });
    let places = numbers::list(map, "I")?.unwrap_or_else(|| evenly(count));
    if [g.len(), b.len(), a.len(), places.len()].iter().any(|n| *n != count) {
        return Err("`R`, `G`, `B`, `A` and `I` are not of one length".into());
    }
    if places.windows(2).any(|w| w[0] > w[1]) {
        return Err("`I` goes down".into());
    }
    let range = match (numbers::one(map, "min")?, numbers::one(map, "max")?) {
        (Some(min), Some(max)) if max > min => Some([min, max]),
        // NiiVue's way of saying that it has none.
        (None, None) | (Some(0.0), Some(0.0)) => None,
        (min, max) => return Err(format!("`min` and `max` are {min:?} and {max:?}, no range")),
    };
    let units = if range.is_none() { FRACTION } else { "" };
    let [low, high] = range.unwrap_or([0.0, 1.0]);
    let value = |i: usize| low + (high - low) * places[i] / TOP;
    let opacity = (0..count).map(|i| Node::straight(value(i), [a[i] / TOP])).collect();
    let color = (0..count).map(|i| Node::straight(value(i), [r[i] / TOP, g[i] / TOP, b[i] / TOP])).collect();
    let opacity = opacities(opacity, &mut warnings)?;
    let color = colors(color, linear, Ways::default(), &mut warnings)?;
    warnings.push(numbers::per_mm("the format"));
    let parts = Parts { name: String::new(), units, opacity, color, reference_length_mm: 1.0, warnings };
    parts.carry("niivue")
}

/// Places at even distances.
fn evenly(count: usize) -> Vec<f64> {
    (0..count).map(|i| TOP * i as f64 / (count.max(2) - 1) as f64).collect()
}
