//! Plot of transmittance against depth along one light ray, with a second plot of each shadow method's error below
//! it.
//!
//! The exact transmittance is a broad grey line below the curves of the shadow methods. The methods have the colours
//! and markers of the other plots. Several settings of one method differ in their dash patterns.

use super::axis::{Axis, draw_axes};
use super::page::{GREY, SMALL, TEXT, TITLE, shorten};
use super::style::{DASHES, Family, families, marker};
use crate::error::Result;
use crate::measure::light_curve::{LightCurve, MethodCurve};
use crate::report::canvas::{Anchor, BLACK, Drawing, INK, Point, Rect, Rgb, text_width};

const WIDTH: f64 = 1000.0;
const VALUES: Rect = Rect { left: 96.0, top: 76.0, right: 976.0, bottom: 406.0 };
const ERRORS: Rect = Rect { left: 96.0, top: 426.0, right: 976.0, bottom: 586.0 };
/// Vertical position of the legend below the plot of transmittance along a light ray, points.
const LEGEND_TOP: f64 = 666.0;
const LEGEND_LINE: f64 = 26.0;
const EXACT: Rgb = [178, 178, 178];
const EXACT_WIDTH: f64 = 6.0;
const LINE_WIDTH: f64 = 1.7;
/// Number of markers on each curve in the plot of transmittance along a light ray.
const MARKERS: usize = 5;
/// Largest change of transmittance that is invisible in the plot of transmittance along a light ray.
const LEVEL: f64 = 5e-4;
/// Smallest extent of the error axis above and below 0, in the plot of transmittance error along a light ray.
const SMALLEST_ERROR: f64 = 1e-4;
/// Length of a sample line in the legend of the plot of transmittance along a light ray, points.
const SAMPLE: f64 = 44.0;

/// Returns the plot of transmittance along a light ray as an SVG document. `scene` describes in a few words the
/// volume that the ray crosses.
pub fn curve_svg(curve: &LightCurve, methods: &[MethodCurve], scene: &str) -> String {
    figure(curve, methods, scene).svg(None).into_string()
}

/// Returns the plot of transmittance along a light ray as a PNG file with two pixels per point.
///
/// # Errors
/// The plot cannot be drawn or encoded.
pub fn curve_png(curve: &LightCurve, methods: &[MethodCurve], scene: &str) -> Result<Vec<u8>> {
    figure(curve, methods, scene).png()
}

/// Returns the plot of transmittance along a light ray as a PDF file.
///
/// # Errors
/// The plot cannot be drawn or encoded.
pub fn curve_pdf(curve: &LightCurve, methods: &[MethodCurve], scene: &str) -> Result<Vec<u8>> {
    figure(curve, methods, scene).pdf()
}

/// Name, colour and dash pattern of one shadow method's curve, in the plot of transmittance along a light ray.
struct Line {
    name: String,
    color: Rgb,
    family: usize,
    dashes: Option<[f64; 2]>,
}

fn figure(curve: &LightCurve, methods: &[MethodCurve], scene: &str) -> Drawing {
    let families = families(methods.iter().map(|m| m.method.as_str()));
    let lines: Vec<Line> = methods.iter().enumerate().map(|(i, m)| line(methods, i, m, &families)).collect();
    let (entries, legend_lines) = legend(&lines);
    let mut drawing = Drawing::new(WIDTH, LEGEND_TOP + LEGEND_LINE * legend_lines as f64);
    let [x, y, z] = curve.point_mm.to_array();
    let title = format!("Light ray through ({x}, {y}, {z}) mm");
    let fit = |text: String, size| shorten(text, size, WIDTH - 60.0);
    drawing.text(Point(0.5 * WIDTH, 24.0), Anchor::Middle, TITLE, BLACK, &fit(title, TITLE));
    drawing.text(Point(0.5 * WIDTH, 51.0), Anchor::Middle, TEXT, GREY, &fit(scene.into(), TEXT));

    let depth = Axis::linear(depth_range(curve, methods), VALUES.left, VALUES.right, 12);
    let value = Axis::linear([-0.03, 1.03], VALUES.bottom, VALUES.top, 6);
    let error = Axis::linear(error_range(curve, methods), ERRORS.bottom, ERRORS.top, 6);
    let x_title = "depth along the light ray, from where it enters the volume [mm]";
    draw_axes(&mut drawing, VALUES, [&depth, &value], ["", "transmittance"]);
    draw_axes(&mut drawing, ERRORS, [&depth, &error], [x_title, "error (method − exact)"]);
    if (depth.low..=depth.high).contains(&curve.point_depth_mm) {
        let x = depth.place(curve.point_depth_mm);
        for frame in [VALUES, ERRORS] {
            drawing.dashed(&[Point(x, frame.top), Point(x, frame.bottom)], 1.0, INK, [1.5, 3.0]);
        }
        let (side, anchor) = if x > 0.5 * WIDTH { (-6.0, Anchor::End) } else { (6.0, Anchor::Start) };
        drawing.text(Point(x + side, VALUES.top + 14.0), anchor, SMALL, INK, "the point");
    }

    let shown: Vec<usize> = (0..curve.depth_mm.len())
        .filter(|&k| (depth.low..=depth.high).contains(&curve.depth_mm[k]))
        .collect();
    let path = shown.iter().map(|&k| Point(depth.place(curve.depth_mm[k]), value.place(curve.exact[k])));
    drawing.line(&thinned(path), EXACT_WIDTH, EXACT);
    let zero = [depth.low, depth.high].map(|z| Point(depth.place(z), error.place(0.0)));
    drawing.line(&zero, EXACT_WIDTH, EXACT);
    for (i, (m, line)) in methods.iter().zip(&lines).enumerate() {
        let phase = (i as f64 + 0.5) / methods.len() as f64;
        let family = &families[line.family];
        let finite = || shown.iter().copied().filter(|&k| m.transmittance[k].is_finite());
        let value_at = |k: usize| f64::from(m.transmittance[k]);
        let values = finite().map(|k| {
            Point(depth.place(curve.depth_mm[k]), value.place(value_at(k).clamp(value.low, value.high)))
        });
        stroke(&mut drawing, &thinned(values), line, family, phase);
        let errors = finite().map(|k| {
            let e = (value_at(k) - curve.exact[k]).clamp(error.low, error.high);
            Point(depth.place(curve.depth_mm[k]), error.place(e))
        });
        stroke(&mut drawing, &thinned(errors), line, family, phase);
    }
    for frame in [VALUES, ERRORS] {
        drawing.outline(frame, 1.2, INK);
    }
    for (place, entry) in entries {
        let sample = [place, Point(place.0 + SAMPLE, place.1)];
        match entry.checked_sub(1).map(|i| &lines[i]) {
            None => drawing.line(&sample, EXACT_WIDTH, EXACT),
            Some(line) => stroke(&mut drawing, &sample, line, &families[line.family], 0.5),
        }
        let text = Point(place.0 + SAMPLE + 8.0, place.1);
        drawing.text(text, Anchor::Start, TEXT, BLACK, entry_name(&lines, entry));
    }
    drawing
}

fn line(methods: &[MethodCurve], index: usize, m: &MethodCurve, families: &[Family]) -> Line {
    let family = families.iter().position(|f| f.name == m.method).unwrap_or(0);
    let before = methods[..index].iter().filter(|o| o.method == m.method).count();
    let dashes = DASHES[before % DASHES.len()];
    Line { name: m.name(methods), color: families[family].color, family, dashes }
}

/// Draws one curve of a transmittance plot with its dash pattern and a few markers. `phase` in [0, 1) shifts the
/// markers, so that the markers of coinciding curves do not overlap.
fn stroke(drawing: &mut Drawing, path: &[Point], line: &Line, family: &Family, phase: f64) {
    match line.dashes {
        None => drawing.line(path, LINE_WIDTH, line.color),
        Some(dashes) => drawing.dashed(path, LINE_WIDTH, line.color, dashes),
    }
    let (Some(first), Some(last)) = (path.first(), path.last()) else { return };
    if path.len() == 1 {
        marker(drawing, *first, family.marker, family.color);
        return;
    }
    let markers = if last.0 - first.0 > 2.0 * SAMPLE { MARKERS } else { 1 };
    for k in 0..markers {
        let x = first.0 + (last.0 - first.0) * (k as f64 + phase) / markers as f64;
        let after = path.partition_point(|p| p.0 < x).clamp(1, path.len() - 1);
        let (Point(x0, y0), Point(x1, y1)) = (path[after - 1], path[after]);
        let share = if x1 > x0 { (x - x0) / (x1 - x0) } else { 0.0 };
        marker(drawing, Point(x, y0 + share * (y1 - y0)), family.marker, family.color);
    }
}

/// Depth range that the plot of transmittance along a light ray shows, mm: all depths where a curve changes, and the
/// point whose transmittance is queried, with a margin. It is the whole light ray if no curve changes.
fn depth_range(curve: &LightCurve, methods: &[MethodCurve]) -> [f64; 2] {
    let mut changes_mm: Vec<f64> = Vec::new();
    let mut add_changes = |value: &dyn Fn(usize) -> f64| {
        let last = curve.depth_mm.len() - 1;
        let away = |from: usize, k: &usize| (value(*k) - value(from)).abs() > LEVEL;
        let ends = [(0..=last).find(|k| away(0, k)), (0..=last).rfind(|k| away(last, k))];
        changes_mm.extend(ends.into_iter().flatten().map(|k| curve.depth_mm[k]));
    };
    add_changes(&|k| curve.exact[k]);
    methods.iter().for_each(|m| add_changes(&|k| f64::from(m.transmittance[k])));
    if changes_mm.is_empty() {
        return [0.0, curve.length_mm];
    }
    changes_mm.extend(Some(curve.point_depth_mm).filter(|z| (0.0..=curve.length_mm).contains(z)));
    let low = changes_mm.iter().copied().fold(f64::INFINITY, f64::min);
    let high = changes_mm.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let air = (0.08 * (high - low)).max(0.02 * curve.length_mm);
    [(low - air).max(0.0), (high + air).min(curve.length_mm)]
}

/// Range of the error axis in a transmittance plot: contains 0 and the errors of all shadow methods, with a margin.
fn error_range(curve: &LightCurve, methods: &[MethodCurve]) -> [f64; 2] {
    let errors =
        methods.iter().flat_map(|m| m.transmittance.iter().zip(&curve.exact).map(|(&t, e)| f64::from(t) - e));
    let finite = errors.filter(|e| e.is_finite());
    let [low, high] =
        finite.fold([-SMALLEST_ERROR, SMALLEST_ERROR], |[low, high], e| [low.min(e), high.max(e)]);
    let air = 0.07 * (high - low);
    [low - air, high + air]
}

/// Removes points that are very close to the previous point of a plotted path; the first and the last point stay.
fn thinned(path: impl Iterator<Item = Point>) -> Vec<Point> {
    const FINEST: f64 = 0.12;
    let mut path_points: Vec<Point> = Vec::new();
    let mut skipped = None;
    for p in path {
        match path_points.last() {
            Some(last) if (p.0 - last.0).hypot(p.1 - last.1) < FINEST => skipped = Some(p),
            _ => {
                path_points.push(p);
                skipped = None;
            }
        }
    }
    path_points.extend(skipped);
    path_points
}

fn entry_name(lines: &[Line], entry: usize) -> &str {
    entry.checked_sub(1).map_or("exact", |i| &lines[i].name)
}

/// Returns the positions of the legend entries below the plot of transmittance curves, and the number of legend
/// lines. Entry 0 is the exact curve.
fn legend(lines: &[Line]) -> (Vec<(Point, usize)>, usize) {
    const SPACE: f64 = 26.0;
    let width = |entry: usize| SAMPLE + 8.0 + text_width(entry_name(lines, entry), TEXT) + SPACE;
    let (left, right) = (VALUES.left - 60.0, VALUES.right);
    let (mut at, mut line) = (left, 0);
    let mut entries = Vec::new();
    for entry in 0..=lines.len() {
        if at > left && at + width(entry) - SPACE > right {
            (at, line) = (left, line + 1);
        }
        entries.push((Point(at, LEGEND_TOP + LEGEND_LINE * line as f64), entry));
        at += width(entry);
    }
    (entries, line + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn curve() -> (LightCurve, Vec<MethodCurve>) {
        let depth_mm: Vec<f64> = (0..=100).map(f64::from).collect();
        let exact: Vec<f64> = depth_mm.iter().map(|z| (-0.03 * z).exp()).collect();
        let method = |name: &str, params: &str, off: f64| MethodCurve {
            method: name.into(),
            params: params.into(),
            map: None,
            transmittance: exact.iter().map(|t| (t + off) as f32).collect(),
        };
        let methods = vec![
            method("dsm", "epsilon=0.02", 0.01),
            method("dsm", "epsilon=0.06", -0.04),
            method("osm", "layers=8 <&>", f64::NAN),
        ];
        let curve = LightCurve {
            point_mm: DVec3::new(1.5, 2.0, 3.0),
            point_depth_mm: 40.0,
            origin_mm: DVec3::ZERO,
            direction: DVec3::X,
            length_mm: 100.0,
            depth_mm,
            exact,
        };
        (curve, methods)
    }

    #[test]
    fn svg_names_axes_units_point_and_every_line() {
        let (curve, methods) = curve();
        let svg = curve_svg(&curve, &methods, "slab, haze & more");
        for text in [
            "Light ray through (1.5, 2, 3) mm",
            "slab, haze &amp; more",
            "from where it enters the volume [mm]",
            "transmittance",
            "error (method − exact)",
            "the point",
            "exact",
            "dsm epsilon=0.02",
            "dsm epsilon=0.06",
            "osm layers=8 &lt;&amp;&gt;",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        // Another setting of a method is dashed, in both panels and the legend.
        assert_eq!(
            svg.matches("stroke=\"#0072b2\" stroke-width=\"1.7\" stroke-linejoin=\"round\" stroke-dasharray")
                .count(),
            3
        );
    }

    #[test]
    fn the_error_axis_holds_what_is_finite_and_zero() {
        let (curve, methods) = curve();
        let [low, high] = error_range(&curve, &methods);
        assert!(low < -0.04 && low > -0.05 && high > 0.01 && high < 0.02, "{low} {high}");
        let [low, high] = error_range(&curve, &methods[2..]);
        assert!(low < 0.0 && high > 0.0);
    }

    #[test]
    fn the_depth_axis_holds_what_falls_and_the_point() {
        let (mut curve, _) = curve();
        curve.exact = curve.depth_mm.iter().map(|z| if *z < 60.0 { 1.0 } else { 0.2 }).collect();
        let range = |curve: &LightCurve| depth_range(curve, &[]).map(f64::round);
        assert_eq!(range(&curve), [38.0, 62.0]);
        curve.point_depth_mm = -7.0;
        assert_eq!(range(&curve), [57.0, 62.0]);
        curve.exact.fill(1.0);
        assert_eq!(range(&curve), [0.0, 100.0]);
    }

    #[test]
    fn long_legends_break_into_lines() {
        let (curve, methods) = curve();
        let many: Vec<_> = (0..4).flat_map(|_| methods.clone()).collect();
        let lines: Vec<Line> = many
            .iter()
            .map(|m| Line { name: m.name(&many), color: BLACK, family: 0, dashes: None })
            .collect();
        let (entries, count) = legend(&lines);
        assert_eq!(entries.len(), 13);
        assert!(count >= 3 && entries.iter().all(|(p, _)| p.0 < VALUES.right));
        assert!(!curve_png(&curve, &[], "").unwrap().is_empty(), "the exact curve alone");
    }
}
