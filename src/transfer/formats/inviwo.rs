//! Reader of Inviwo's transfer functions (`.itf`). The XML holds points with a position and a colour `rgba`, and a
//! mask: a range outside of which the volume is invisible. Positions are fractions of the data's range (`type` 0,
//! relative) or scalar values (1, absolute).

use super::curve::{CurveNode, Interpolation, LimitSide, MOST_NODES, MOST_VALUE, NodeCurve};
use super::import::{Foreign, Imported, curve_in_range};
use crate::files::xml;
use roxmltree::Node as Element;

/// Largest number of XML elements of an `.itf` file; a point of its transfer function has about seven.
const MOST_ELEMENTS: u32 = 8 * MOST_NODES as u32;

/// Whether the text of a file is XML, which Inviwo's `.itf` files are.
pub fn is_one(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}

/// Reads a transfer function from the text of an Inviwo `.itf` file.
///
/// # Errors
/// The text is no XML, has a document type (entities are not expanded), or no points.
pub fn read(text: &str) -> Result<Imported, String> {
    let text = text.trim_start_matches('\u{feff}');
    let document =
        xml::parse(text, MOST_ELEMENTS).map_err(|e| format!("not the XML of a .itf: {}", e.why))?;
    let named = |element: &Element<'_, '_>, names: &[&str]| {
        names.iter().any(|name| element.tag_name().name().eq_ignore_ascii_case(name))
    };
    // Old files write `dataPoints` and `point`, a position with the opacity as its y; new ones `Points` and `Point`.
    let list = document.descendants().find(|e| named(e, &["Points", "dataPoints"]));
    let list = list.ok_or("it has no `Points`")?;
    let points: Vec<[f64; 5]> =
        list.children().filter(|e| named(e, &["Point"])).map(point).collect::<Result<_, _>>()?;
    let single = |name: &str| {
        let found = list.parent().and_then(|p| p.children().find(|e| named(e, &[name])));
        found.map(|e| number(&e, "content").ok_or_else(|| format!("`{name}` is no number"))).transpose()
    };
    let mut foreign = Foreign::through("inviwo", &points);
    foreign.has_fractions = single("type")?.is_none_or(|kind| kind == 0.0);
    if single("interpolationType_")?.is_some_and(|kind| kind != 0.0) {
        foreign.warnings.push("cubic interpolation became straight lines".into());
    }
    let opacity = std::mem::take(&mut foreign.opacity);
    let opacity = curve_in_range(opacity, "opacities", &Interpolation::LINEAR, &mut foreign.warnings)?;
    foreign.opacity = masked(&opacity, single("maskMin")?, single("maskMax")?);
    foreign.reference_length_mm = Some(1.0);
    foreign.warnings.push(
        "Inviwo's opacities are over a 150th of the volume's side, which the file does not tell in mm: 1 mm is assumed \
         (--opacity-scale changes it)"
            .into(),
    );
    foreign.convert()
}

/// Reads the position, red, green, blue and opacity of a transfer-function point in an Inviwo `.itf` file.
fn point(element: Element<'_, '_>) -> Result<[f64; 5], String> {
    let child = |name: &str| {
        element.children().find(|e| e.has_tag_name(name)).ok_or_else(|| format!("a point has no `{name}`"))
    };
    let (pos, rgba) = (child("pos")?, child("rgba")?);
    let at = number(&pos, "content").or_else(|| number(&pos, "x")).ok_or("a point's `pos` is no number")?;
    let channel = |name: &str| number(&rgba, name).ok_or_else(|| format!("a point's `rgba` has no `{name}`"));
    Ok([at, channel("x")?, channel("y")?, channel("z")?, channel("w")?])
}

fn number(element: &Element<'_, '_>, attribute: &str) -> Option<f64> {
    element.attribute(attribute)?.trim().parse().ok()
}

/// Returns the nodes of an opacity curve after it is set to 0 below `min` and from `max` on (the mask of an Inviwo
/// file).
fn masked(opacity: &NodeCurve<1>, min: Option<f64>, max: Option<f64>) -> Vec<CurveNode<1>> {
    let first = opacity.values().fold(0.0, f64::min);
    let last = opacity.values().fold(1.0, f64::max);
    // Without a mask, an absolute function has one that covers all numbers. A mask over all points affects only
    // values beyond them, and is ignored.
    let min = min.filter(|m| m.abs() < MOST_VALUE && *m > first);
    let max = max.filter(|m| m.abs() < MOST_VALUE && *m < last);
    if min.zip(max).is_some_and(|(min, max)| min >= max) {
        return vec![CurveNode::straight(0.0, [0.0])];
    }
    let at = |value: f64, side: LimitSide| CurveNode::straight(value, opacity.at(value, side));
    let mut nodes: Vec<CurveNode<1>> = Vec::new();
    nodes.extend(min.into_iter().flat_map(|min| [CurveNode::straight(min, [0.0]), at(min, LimitSide::From)]));
    let mut inside: Vec<f64> =
        opacity.values().filter(|v| min.is_none_or(|m| *v > m) && max.is_none_or(|m| *v < m)).collect();
    inside.dedup();
    nodes.extend(
        inside.into_iter().flat_map(|value| [at(value, LimitSide::Below), at(value, LimitSide::From)]),
    );
    nodes
        .extend(max.into_iter().flat_map(|max| [at(max, LimitSide::Below), CurveNode::straight(max, [0.0])]));
    nodes
}
