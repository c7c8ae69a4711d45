//! Reader of the colour maps of MRIcroGL and NiiVue (`.json`): arrays `R`, `G`, `B`, `A` of 0 to 255 at the positions
//! `I` from 0 to 255. The positions span the range from `min` to `max`, or the displayed range if the file has no
//! limits (<https://niivue.com/docs/colormaps2>).

use super::import::{Foreign, Imported};
use super::json;
use serde_json::Value;

/// Largest position, colour channel and opacity in a colour map of MRIcroGL or NiiVue.
const TOP: f64 = 255.0;

/// Whether a JSON value is a colour map of MRIcroGL or NiiVue.
pub fn is_one(value: &Value) -> bool {
    ["R", "G", "B"].iter().all(|key| value.get(*key).is_some())
}

/// Reads a colour map of MRIcroGL or NiiVue as a transfer function.
///
/// # Errors
/// The colour map is for segmentation labels, its arrays differ in length, or its value range is empty.
pub fn read(value: &Value) -> Result<Imported, String> {
    let map = value.as_object().ok_or("it is no object")?;
    if map.contains_key("labels") {
        return Err("its colours are of labels, not of values".into());
    }
    let array = |key: &str| json::list(map, key)?.ok_or_else(|| format!("`{key}` is missing"));
    let [r, g, b] = [array("R")?, array("G")?, array("B")?];
    let count = r.len();
    let evenly = || -> Vec<f64> { (0..count).map(|i| TOP * i as f64 / (count.max(2) - 1) as f64).collect() };
    let mut warnings = Vec::new();
    let a = json::list(map, "A")?.unwrap_or_else(|| {
        warnings.push("`A` is missing: opacities go from 0 to 1".into());
        evenly()
    });
    let places = json::list(map, "I")?.unwrap_or_else(evenly);
    if [g.len(), b.len(), a.len(), places.len()].iter().any(|n| *n != count) {
        return Err("`R`, `G`, `B`, `A` and `I` are not of one length".into());
    }
    if places.windows(2).any(|w| w[0] > w[1]) {
        return Err("`I` goes down".into());
    }
    let range = match (json::number(map, "min")?, json::number(map, "max")?) {
        (Some(min), Some(max)) if max > min => Some([min, max]),
        // NiiVue writes 0 and 0 where there is no range.
        (None, None) | (Some(0.0), Some(0.0)) => None,
        (min, max) => return Err(format!("`min` and `max` are {min:?} and {max:?}, no range")),
    };
    let [low, high] = range.unwrap_or([0.0, 1.0]);
    let value = |i: usize| low + (high - low) * places[i] / TOP;
    let point = |i: usize| [value(i), r[i] / TOP, g[i] / TOP, b[i] / TOP, a[i] / TOP];
    let points: Vec<_> = (0..count).map(point).collect();
    Foreign { has_fractions: range.is_none(), warnings, ..Foreign::through("niivue", &points) }.convert()
}
