//! ParaView's colour maps, `.json`: a list of objects with `Name`, `ColorSpace`, `RGBPoints` (value, red, green, blue) and
//! `Points` (value, opacity, midpoint, sharpness), as its colour map editor exports and imports them.

use super::carried::{Carried, FRACTION, Parts, colors, opacities};
use super::color_space;
use super::curve::{Mix, Node, Ways, linear};
use super::numbers::{self, Object};
use serde_json::Value;

/// Keys by which it is known.
const KEYS: [&str; 3] = ["RGBPoints", "Points", "IndexedColors"];

/// Whether a JSON value is a colour map, or a list of some.
pub fn is_one(value: &Value) -> bool {
    object_of(value).is_some_and(|map| KEYS.iter().any(|key| map.contains_key(*key)))
}

/// The first colour map.
fn object_of(value: &Value) -> Option<&Object> {
    value.as_array().map_or(Some(value), |all| all.first()).and_then(Value::as_object)
}

/// Reads the first colour map.
///
/// # Errors
/// It is none, or a number in it is missing or out of range.
pub fn read(value: &Value) -> Result<Carried, String> {
    let map = object_of(value).ok_or("it holds no colour map")?;
    let name = map.get("Name").and_then(Value::as_str).unwrap_or_default().to_owned();
    let mut warnings = Vec::new();
    if let Some(more) = value.as_array().map(Vec::len).filter(|n| *n > 1) {
        warnings.push(format!("it holds {more} colour maps: the first one, `{name}`, was taken"));
    }
    let rgb = numbers::list(map, "RGBPoints")?;
    if rgb.is_none() && map.contains_key("IndexedColors") {
        return Err("its colours are of categories (`IndexedColors`), not of values".into());
    }
    let rgb = rgb.map(|rgb| numbers::groups::<4>(&rgb, "RGBPoints")).transpose()?.unwrap_or_default();
    let points = numbers::list(map, "Points")?;
    let points = points.map(|p| numbers::groups::<4>(&p, "Points")).transpose()?.unwrap_or_default();
    let values = || rgb.iter().chain(&points).map(|p| p[0]);
    let range = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
    if rgb.is_empty() && points.is_empty() {
        return Err("it has neither `RGBPoints` nor `Points`".into());
    }
    // ParaView lays a map over the data when it is applied; its own are over 0 to 1, some over -1 to 1.
    let over_range = range == [0.0, 1.0] || range == [-1.0, 1.0];
    let onto = |v: f64| if over_range { (v - range[0]) / (range[1] - range[0]) } else { v };
    let mut color: Vec<Node<3>> =
        rgb.iter().map(|[v, r, g, b]| Node::straight(onto(*v), [*r, *g, *b])).collect();
    if color.is_empty() {
        warnings.push("it has no colours: white is used".into());
        color.push(Node::straight(0.0, [1.0; 3]));
    }
    let mut opacity: Vec<Node<1>> = points
        .iter()
        .map(|[v, o, midpoint, sharpness]| Node {
            value: onto(*v),
            amounts: [*o],
            midpoint: *midpoint,
            sharpness: *sharpness,
        })
        .collect();
    if opacity.is_empty() {
        warnings.push(
            "it has no opacities: a ramp from 0 at its lowest value to 1 at its highest, as ParaView begins with"
                .into(),
        );
        opacity = [0.0, 1.0].map(|o| Node::straight(onto(range[o as usize]), [o])).into();
    }
    let (mix, ways) = mixture(map, &mut warnings);
    let is_log = ways.are_logarithmic;
    let reference_length_mm = numbers::unit_distance(map, "ScalarOpacityUnitDistance", &mut warnings)?;
    let opacity = opacities(opacity, &mut warnings)?;
    if opacity.is_bent() {
        warnings.push("midpoints and sharpness of opacities became points on their curve".into());
    }
    if is_log && (over_range || range[0] <= 0.0) {
        warnings.push("`UseLogScale` was left out: values are not all above 0".into());
    }
    let ways = Ways { are_logarithmic: is_log && !over_range, ..ways };
    let color = colors(color, mix, ways, &mut warnings)?;
    let units = if over_range { FRACTION } else { "" };
    Parts { name, units, opacity, color, reference_length_mm, warnings }.carry("paraview")
}

/// How colours are mixed, and what of it is approximated.
fn mixture(map: &Object, warnings: &mut Vec<String>) -> (Mix<3>, Ways) {
    let ways = Ways { are_logarithmic: numbers::is_set(map, "UseLogScale"), may_be_steps: true };
    let wrapped = !map.contains_key("HSVWrap") || numbers::is_set(map, "HSVWrap");
    let space = map.get("ColorSpace").and_then(Value::as_str).unwrap_or("RGB");
    let (mix, said): (Mix<3>, _) = match space.to_ascii_lowercase().as_str() {
        "rgb" => (linear, None),
        "hsv" if wrapped => (color_space::hsv_wrapped, Some("HSV")),
        "hsv" => (color_space::hsv, Some("HSV")),
        "lab" => (color_space::lab, Some("CIE L*a*b*")),
        "diverging" => (color_space::diverging, Some("Moreland's diverging colours")),
        "step" => (color_space::step, None),
        "lab/ciede2000" => (color_space::lab, Some("CIE L*a*b*, for CIEDE2000, which differs")),
        _ => {
            warnings.push(format!("the colour space `{space}` is not known: colours go straight in RGB"));
            (linear, None)
        }
    };
    if let Some(said) = said {
        warnings.push(format!("colours between its points were sampled in {said}"));
    }
    (mix, ways)
}
