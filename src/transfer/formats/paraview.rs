//! Reader of ParaView's colour maps (`.json`), which its colour map editor exports and imports. They are a list of
//! objects with `Name`, `ColorSpace`, `RGBPoints` (value, red, green, blue) and `Points` (value, opacity, midpoint,
//! sharpness).

use super::color_space;
use super::curve::{CurveNode, Interpolation, Mix, linear};
use super::import::{Foreign, Imported};
use super::json::{self, Object};
use serde_json::Value;

/// JSON keys that identify a ParaView colour map.
const KEYS: [&str; 3] = ["RGBPoints", "Points", "IndexedColors"];

/// Whether a JSON value is a ParaView colour map, or a list of them.
pub fn is_one(value: &Value) -> bool {
    object_of(value).is_some_and(|map| KEYS.iter().any(|key| map.contains_key(*key)))
}

/// Returns the first ParaView colour map in a JSON value, which is a colour map or a list of them.
fn object_of(value: &Value) -> Option<&Object> {
    value.as_array().map_or(Some(value), |all| all.first()).and_then(Value::as_object)
}

/// Reads the first ParaView colour map in a JSON value as a transfer function.
///
/// # Errors
/// There is no colour map, or a number in it is missing or out of range.
pub fn read(value: &Value) -> Result<Imported, String> {
    let map = object_of(value).ok_or("it holds no colour map")?;
    let name = map.get("Name").and_then(Value::as_str).unwrap_or_default().to_owned();
    let mut warnings = Vec::new();
    if let Some(more) = value.as_array().map(Vec::len).filter(|n| *n > 1) {
        warnings.push(format!("it holds {more} colour maps: the first one, `{name}`, was taken"));
    }
    if map.contains_key("IndexedColors") && !map.contains_key("RGBPoints") {
        return Err("its colours are of categories (`IndexedColors`), not of values".into());
    }
    let groups = |key: &str| json::groups::<4>(&json::list(map, key)?.unwrap_or_default(), key);
    let (rgb, points) = (groups("RGBPoints")?, groups("Points")?);
    if rgb.is_empty() && points.is_empty() {
        return Err("it has neither `RGBPoints` nor `Points`".into());
    }
    let values = || rgb.iter().chain(&points).map(|p| p[0]);
    let range = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
    // ParaView maps a colour map to the data's range when it is applied; its own maps are over 0 to 1, some over -1
    // to 1.
    let has_fractions = range == [0.0, 1.0] || range == [-1.0, 1.0];
    let onto = |v: f64| if has_fractions { (v - range[0]) / (range[1] - range[0]) } else { v };
    let mut color: Vec<CurveNode<3>> =
        rgb.iter().map(|[v, r, g, b]| CurveNode::straight(onto(*v), [*r, *g, *b])).collect();
    if color.is_empty() {
        warnings.push("it has no colours: white is used".into());
        color.push(CurveNode::straight(0.0, [1.0; 3]));
    }
    let node = |&[v, o, midpoint, sharpness]: &[f64; 4]| CurveNode {
        value: onto(v),
        amounts: [o],
        midpoint,
        sharpness,
    };
    let mut opacity: Vec<CurveNode<1>> = points.iter().map(node).collect();
    if opacity.is_empty() {
        let ramp = "a ramp from 0 at its lowest value to 1 at its highest, as ParaView begins with";
        warnings.push(format!("it has no opacities: {ramp}"));
        opacity = [0.0, 1.0].map(|o| CurveNode::straight(onto(range[o as usize]), [o])).into();
    }
    let mix = color_mix(map, &mut warnings);
    let mut is_logarithmic = json::is_set(map, "UseLogScale");
    if is_logarithmic && (has_fractions || range[0] <= 0.0) {
        warnings.push("`UseLogScale` was skipped: values are not all above 0".into());
        is_logarithmic = false;
    }
    let foreign = Foreign {
        name,
        has_fractions,
        color_interpolation: Interpolation { mix, is_logarithmic, has_steps: true },
        reference_length_mm: json::length_mm(map, "ScalarOpacityUnitDistance")?,
        warnings,
        ..Foreign::new("paraview", opacity, color)
    };
    foreign.convert()
}

/// Returns the function that interpolates the colours of a ParaView colour map. It adds a warning if the map's colour
/// space requires sampling, or is unknown.
fn color_mix(map: &Object, warnings: &mut Vec<String>) -> Mix<3> {
    let wrapped = !map.contains_key("HSVWrap") || json::is_set(map, "HSVWrap");
    let space = map.get("ColorSpace").and_then(Value::as_str).unwrap_or("RGB");
    let (mix, name): (Mix<3>, _) = match space.to_ascii_lowercase().as_str() {
        "rgb" => return linear,
        "step" => return color_space::step,
        "hsv" if wrapped => (color_space::hsv_wrapped, "HSV"),
        "hsv" => (color_space::hsv, "HSV"),
        "lab" => (color_space::lab, "CIE L*a*b*"),
        "diverging" => (color_space::diverging, "Moreland's diverging colours"),
        "lab/ciede2000" => (color_space::lab, "CIE L*a*b*, for CIEDE2000, which differs"),
        _ => {
            warnings
                .push(format!("the colour space `{space}` is not known: colours are mixed linearly in RGB"));
            return linear;
        }
    };
    warnings.push(format!("colours between its points were sampled in {name}"));
    mix
}
