//! Inviwo's transfer functions, `.itf`: XML with points of a position and a colour `rgba`, positions 0 to 1 over the data's
//! range (`type` 0, relative) or values themselves (1, absolute), and a mask outside of which nothing is seen.

use super::carried::{Carried, FRACTION, Parts, colors, opacities};
use super::curve::{Curve, MOST_NODES, Node, Side, Ways, linear};
use crate::files::xml;
use roxmltree::Node as Element;

/// Elements in a file: some seven a point.
const MOST_ELEMENTS: u32 = 8 * MOST_NODES as u32;

/// Whether a text is XML.
pub fn is_one(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}

/// Reads it.
///
/// # Errors
/// It is no XML, has a document type (entities are not expanded), or no points.
pub fn read(text: &str) -> Result<Carried, String> {
    let text = text.trim_start_matches('\u{feff}');
    let document =
        xml::parse(text, MOST_ELEMENTS).map_err(|e| format!("not the XML of a .itf: {}", e.why))?;
    let named = |element: &Element<'_, '_>, names: &[&str]| {
        names.iter().any(|name| element.tag_name().name().eq_ignore_ascii_case(name))
    };
    // Old files say `dataPoints` and `point`, a position with the opacity as its y; new ones `Points` and `Point`.
    let list = document.descendants().find(|e| named(e, &["Points", "dataPoints"]));
    let list = list.ok_or("it has no `Points`")?;
    let points: Vec<[f64; 5]> =
        list.children().filter(|e| named(e, &["Point"])).map(point).collect::<Result<_, _>>()?;
    let mut warnings = Vec::new();
    let single = |name: &str| {
        let beside = list.parent().into_iter().flat_map(|p| p.children());
        let found = beside.clone().find(|e| named(e, &[name]));
        found.map(|e| number(&e, "content").ok_or_else(|| format!("`{name}` is no number"))).transpose()
    };
    let is_relative = single("type")?.is_none_or(|kind| kind == 0.0);
    if single("interpolationType_")?.is_some_and(|kind| kind != 0.0) {
        warnings.push("cubic interpolation became straight lines".into());
    }
    let opacity = points.iter().map(|[at, _, _, _, a]| Node::straight(*at, [*a])).collect();
    let color = points.iter().map(|[at, r, g, b, _]| Node::straight(*at, [*r, *g, *b])).collect();
    let opacity = opacities(opacity, &mut warnings)?;
    let opacity = masked(opacity, single("maskMin")?, single("maskMax")?)?;
    let color = colors(color, linear, Ways::default(), &mut warnings)?;
    warnings.push(
        "Inviwo's opacities are over a 150th of the volume's side, which the file does not tell in mm: 1 mm is assumed \
         (--opacity-scale changes it)"
            .into(),
    );
    let units = if is_relative { FRACTION } else { "" };
    let parts = Parts { name: String::new(), units, opacity, color, reference_length_mm: 1.0, warnings };
    parts.carry("inviwo")
}

/// Position, red, green, blue and opacity.
fn point(element: Element<'_, '_>) -> Result<[f64; 5], String> {
    let child = |name: &str| {
        element.children().find(|e| e.has_tag_name(name)).ok_or_else(|| format!("a point has no `{name}`"))
    };
    let (pos, rgba) = (child("pos")?, child("rgba")?);
    let at = number(&pos, "content").or_else(|| number(&pos, "x")).ok_or("a point's `pos` is no number")?;
    let mut all = [at, 0.0, 0.0, 0.0, 0.0];
    for (slot, channel) in all[1..].iter_mut().zip(["x", "y", "z", "w"]) {
        *slot = number(&rgba, channel).ok_or_else(|| format!("a point's `rgba` has no `{channel}`"))?;
    }
    Ok(all)
}

fn number(element: &Element<'_, '_>, attribute: &str) -> Option<f64> {
    element.attribute(attribute)?.trim().parse().ok()
}

/// Opacities that are 0 below `min` and from `max` on.
fn masked(opacity: Curve<1>, min: Option<f64>, max: Option<f64>) -> Result<Curve<1>, String> {
    let (first, last) =
        (opacity.values().fold(f64::INFINITY, f64::min), opacity.values().fold(f64::NEG_INFINITY, f64::max));
    // An absolute function's mask is the whole line of numbers where it has none; one over all points changes nothing but
    // what lies beyond them.
    let min = min.filter(|m| m.abs() < super::curve::MOST_VALUE && *m > 0.0f64.min(first));
    let max = max.filter(|m| m.abs() < super::curve::MOST_VALUE && *m < 1.0f64.max(last));
    let mut nodes: Vec<Node<1>> = Vec::new();
    let inside = |v: f64| min.is_none_or(|m| v > m) && max.is_none_or(|m| v < m);
    if let Some(min) = min {
        nodes.push(Node::straight(min, [0.0]));
        nodes.push(Node::straight(min, opacity.at(min, Side::From)));
    }
    for value in opacity.values().filter(|v| inside(*v)) {
        for side in [Side::Below, Side::From] {
            nodes.push(Node::straight(value, opacity.at(value, side)));
        }
    }
    if let Some(max) = max {
        nodes.push(Node::straight(max, opacity.at(max, Side::Below)));
        nodes.push(Node::straight(max, [0.0]));
    }
    if min.zip(max).is_some_and(|(min, max)| min >= max) {
        return Ok(Curve::through([(0.0, [0.0])].into_iter()));
    }
    Curve::new(nodes, linear, Ways::default())
}
