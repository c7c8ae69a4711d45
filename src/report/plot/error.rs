//! Plots of transmittance error against time and against memory, one point per row of the comparison table.
//!
//! Both axes are logarithmic. Error bars span the fastest and the slowest timing repeat, and 95 % intervals of errors. A
//! dashed staircase is
//! the Pareto front of the plotted points. Errors below [`ERROR_FLOOR`], 0 included, are drawn in a marked strip
//! below the axis.

use super::axis::{Axis, Notation, axis_titles, draw_axes, tick_label};
use super::cost::Cost;
use super::front::{Datum, front, staircase};
use super::label;
use super::page::{GREY, SMALL, TEXT, TITLE, shorten};
use super::style::{Family, MARKER, families, marker};
use crate::measure::table::Row;
use crate::measure::timing::clock_name;
use crate::report::canvas::{Anchor, BLACK, Drawing, INK, Point, Rect, Rgb, WHITE, text_width};
use itertools::Itertools as _;

/// Smallest error on the axis of the error plots; smaller errors are drawn in a strip below the axis. It is about the
/// rounding error of a float32 transmittance near 1.
pub const ERROR_FLOOR: f64 = 1e-7;

const WIDTH: f64 = 1240.0;
const HEIGHT: f64 = 610.0;
const PANELS: [Rect; 2] = [
    Rect { left: 96.0, top: 104.0, right: 608.0, bottom: 492.0 },
    Rect { left: 708.0, top: 104.0, right: 1220.0, bottom: 492.0 },
];
/// Height of the strip below the axis for errors smaller than [`ERROR_FLOOR`], points.
const STRIP: f64 = 30.0;
const DASHES: [f64; 2] = [6.0, 4.0];
/// Factor by which labels of plot points are widened during their placement. Labels then do not overlap in SVG
/// viewers with a slightly wider font.
const FALLBACK_FONT: f64 = 1.07;
/// Factor that darkens the colour of a shadow method for its plot labels, so that thin letters are readable.
const LABEL_SHADE: f64 = 0.65;

/// Draws two plots of transmittance error against time or memory, side by side: rms error at visible points
/// (`point_err_rms`), and largest error along light rays (`ray_err_max`).
pub fn figure(rows: &[Row], cost: Cost) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, HEIGHT);
    let families = families(rows.iter().filter(|r| cost.of(r).is_some()).map(|r| r.method.as_str()));
    let fit = |text: String, size| shorten(text, size, WIDTH - 60.0);
    let scenes = distinct(rows, |r| &r.scene);
    let title = [format!("Error against {}", cost.name()), scenes];
    let title = title.iter().filter(|t| !t.is_empty()).cloned().collect::<Vec<_>>().join(": ");
    let mut about = distinct(rows, |r| &r.adapter);
    if let Some(first) = rows.first()
        && rows.iter().all(|r| (r.width, r.height, r.clock) == (first.width, first.height, first.clock))
    {
        about += &format!(", {} x {} pixels", first.width, first.height);
        if let Some(clock) = first.clock.filter(|_| cost == Cost::Time) {
            about += &format!(", {} clock", clock_name(clock));
        }
    }
    drawing.text(Point(WIDTH / 2.0, 26.0), Anchor::Middle, TITLE, BLACK, &fit(title, TITLE));
    drawing.text(Point(WIDTH / 2.0, 52.0), Anchor::Middle, TEXT, GREY, &fit(about, TEXT));

    let labels = label::of_rows(rows);
    let data = |error: fn(&Row) -> Option<[f64; 3]>| -> Vec<Datum> {
        let labelled = rows.iter().zip(&labels);
        labelled.filter_map(|(row, label)| datum(row, label, &families, cost, error)).collect()
    };
    let axes = |y_title| [cost.axis_title(), y_title];
    let [left, right] = PANELS;
    let has_intervals = rows.iter().any(|r| r.point_err_rms_lo.is_some());
    let points = axes(if has_intervals {
        "rms transmittance error (point_err_rms), 95 % interval"
    } else {
        "rms transmittance error (point_err_rms)"
    });
    let of_points = data(|r| {
        let rms = r.point_err_rms?;
        Some([rms, r.point_err_rms_lo.unwrap_or(rms), r.point_err_rms_hi.unwrap_or(rms)])
    });
    panel(&mut drawing, left, "At points the camera sees", points, &of_points, &families);
    let rays = axes("largest transmittance error (ray_err_max)");
    panel(&mut drawing, right, "Along light rays", rays, &data(|r| Some([r.ray_err_max?; 3])), &families);
    legend(&mut drawing, &families, cost);
    drawing
}

/// Returns the plotted point of a comparison-table row; `None` if its cost or error is missing, or the error is not
/// finite.
fn datum(
    row: &Row,
    label: &str,
    families: &[Family],
    cost: Cost,
    error: fn(&Row) -> Option<[f64; 3]>,
) -> Option<Datum> {
    let family = families.iter().position(|f| f.name == row.method)?;
    let [error, low, high] = error(row).filter(|[e, ..]| e.is_finite())?.map(f64::abs);
    Some(Datum { family, label: label.to_string(), cost: cost.of(row)?, error, ends: [low, high] })
}

/// Draws one plot of error against cost; `axes` are the titles of the horizontal and the vertical axis.
fn panel(
    drawing: &mut Drawing,
    frame: Rect,
    title: &str,
    axes: [&str; 2],
    data: &[Datum],
    families: &[Family],
) {
    let middle = frame.middle();
    drawing.text(Point(middle.0, frame.top - 18.0), Anchor::Middle, TEXT, BLACK, title);
    if data.is_empty() {
        axis_titles(drawing, frame, axes);
        drawing.outline(frame, 1.2, INK);
        drawing.text(middle, Anchor::Middle, TEXT, GREY, "not measured");
        return;
    }
    let strip = data.iter().any(|d| d.error < ERROR_FLOOR);
    let plot = Rect { bottom: frame.bottom - if strip { STRIP } else { 0.0 }, ..frame };
    let x = Axis::log(data.iter().flat_map(|d| d.cost), plot.left, plot.right, Notation::Plain);
    let shown = data.iter().filter(|d| d.error >= ERROR_FLOOR).flat_map(|d| [d.error, d.ends[0], d.ends[1]]);
    let shown = shown.filter(|e| *e >= ERROR_FLOOR && e.is_finite());
    let y = Axis::log(shown, plot.bottom, plot.top, Notation::Powers);
    draw_axes(drawing, frame, [&x, &y], axes);
    if strip {
        let below = 0.5 * (plot.bottom + frame.bottom);
        drawing.line(&[Point(frame.left, plot.bottom), Point(frame.right, plot.bottom)], 1.2, GREY);
        let exact = data.iter().all(|d| d.error == 0.0 || d.error >= ERROR_FLOOR);
        let (base, power) = if exact { ("0", None) } else { ("≤ 10", Some(ERROR_FLOOR.log10() as i32)) };
        tick_label(drawing, Point(frame.left - 9.0, below), Anchor::End, base, power);
    }

    let place = |d: &Datum| {
        let below = 0.5 * (plot.bottom + frame.bottom);
        Point(x.place(d.cost[0]), if d.error < ERROR_FLOOR { below } else { y.place(d.error) })
    };
    let front = front(data);
    let stairs = staircase(frame, &front.iter().map(|&i| place(&data[i])).collect::<Vec<_>>());
    drawing.dashed(&stairs, 1.3, GREY, DASHES);
    let whiskers: Vec<Rect> = data
        .iter()
        .map(|d| {
            let ([_, fast, slow], Point(_, at)) = (d.cost.map(|cost| x.place(cost)), place(d));
            Rect { left: fast, top: at - 3.0, right: slow, bottom: at + 3.0 }
        })
        .collect();
    let mut obstacles = whiskers.clone();
    obstacles.extend(stairs.windows(2).map(|pair| {
        let [Point(x0, y0), Point(x1, y1)] = [pair[0], pair[1]];
        Rect { left: x0.min(x1), top: y0.min(y1), right: x0.max(x1), bottom: y0.max(y1) }.inset(-1.5)
    }));
    if strip {
        obstacles.push(Rect { top: plot.bottom - 1.5, bottom: plot.bottom + 1.5, ..frame });
    }
    labels(drawing, frame, data, families, &front, &obstacles, place);
    for (d, r) in data.iter().zip(&whiskers) {
        let color = families[d.family].color;
        if d.cost[1] < d.cost[2] {
            whisker(drawing, *r, color);
        }
        if d.error >= ERROR_FLOOR && d.ends[0] < d.ends[1] {
            let [bottom, top] = d.ends.map(|end| y.place(end).clamp(plot.top, plot.bottom));
            drawing.line(&[Point(place(d).0, top), Point(place(d).0, bottom)], 1.0, color);
        }
    }
    for d in data {
        let family = &families[d.family];
        marker(drawing, place(d), family.marker, family.color);
    }
}

/// Draws an error bar with a cap at both ends in a plot of error against cost.
fn whisker(drawing: &mut Drawing, r: Rect, color: Rgb) {
    let middle = 0.5 * (r.top + r.bottom);
    drawing.line(&[Point(r.left, middle), Point(r.right, middle)], 1.0, color);
    for end in [r.left, r.right] {
        drawing.line(&[Point(end, r.top), Point(end, r.bottom)], 1.0, color);
    }
}

/// Draws the settings of each shadow method as labels beside the plot points, those on the Pareto front first. A
/// label without a free place is omitted.
fn labels(
    drawing: &mut Drawing,
    frame: Rect,
    data: &[Datum],
    families: &[Family],
    front: &[usize],
    obstacles: &[Rect],
    at: impl Fn(&Datum) -> Point,
) {
    let rest = (0..data.len()).filter(|i| !front.contains(i));
    let order: Vec<usize> = front.iter().copied().chain(rest).collect();
    let wanted: Vec<label::Wanted> = order
        .iter()
        .map(|&i| label::Wanted {
            point: at(&data[i]),
            width: FALLBACK_FONT * text_width(&data[i].label, SMALL),
            height: SMALL,
            // Only labels of Pareto-front rows may be placed far from their point.
            far: front.contains(&i),
        })
        .collect();
    for (&i, place) in order.iter().zip(label::place(&wanted, MARKER + 2.0, obstacles, frame.inset(4.0))) {
        let Some(label::Placed { rect, leader }) = place else { continue };
        if let Some([from, to]) = leader {
            drawing.line(&[from, to], 0.7, GREY);
        }
        // Lines stop short of the text instead of striking it through.
        drawing.polygon(&rect.corners(), WHITE);
        let color = families[data[i].family].color.map(|c| (f64::from(c) * LABEL_SHADE) as u8);
        let start = Point(rect.left, 0.5 * (rect.top + rect.bottom));
        drawing.text(start, Anchor::Start, SMALL, color, &data[i].label);
    }
}

/// Draws the legend below the plots: a row of shadow methods, and one of the dashed Pareto front and the error bars.
fn legend(drawing: &mut Drawing, families: &[Family], cost: Cost) {
    const FRONT: &str = "Pareto front";
    const REPEATS: &str = "fastest to slowest repeat";
    const SPACE: f64 = 30.0;
    const BAR: f64 = 36.0;
    let entry = |name: &str, symbol: f64| symbol + 8.0 + text_width(name, TEXT) + SPACE;
    // Draws the text of an entry, and returns the left edge of its symbol.
    let named = |drawing: &mut Drawing, at: &mut Point, name: &str, symbol: f64| {
        let left = at.0;
        drawing.text(Point(left + symbol + 8.0, at.1), Anchor::Start, TEXT, BLACK, name);
        at.0 += entry(name, symbol);
        left
    };
    let centered = |width: f64, y: f64| Point(0.5 * (WIDTH - width + SPACE), y);
    let mut at = centered(families.iter().map(|f| entry(&f.name, 12.0)).sum(), HEIGHT - 42.0);
    for f in families {
        let left = named(drawing, &mut at, &f.name, 12.0);
        marker(drawing, Point(left + 6.0, at.1), f.marker, f.color);
    }
    let repeats = if cost == Cost::Time { entry(REPEATS, BAR) } else { 0.0 };
    let mut at = centered(entry(FRONT, BAR) + repeats, HEIGHT - 18.0);
    let left = named(drawing, &mut at, FRONT, BAR);
    drawing.dashed(&[Point(left, at.1), Point(left + BAR, at.1)], 1.3, GREY, DASHES);
    if cost == Cost::Time {
        let left = named(drawing, &mut at, REPEATS, BAR);
        whisker(drawing, Rect { left, top: at.1 - 3.0, right: left + BAR, bottom: at.1 + 3.0 }, INK);
    }
}

/// Joins the distinct values of one text column of the comparison table, in order of appearance.
fn distinct<'a>(rows: &'a [Row], column: fn(&'a Row) -> &'a String) -> String {
    let values = rows.iter().map(column).map(String::as_str).filter(|value| !value.is_empty());
    values.unique().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::defaults::style;
    use crate::measure::table::tests::sample_rows;
    use crate::report::plot::write_plots;

    fn svg(rows: &[Row], cost: Cost) -> String {
        figure(rows, cost).svg(None).into_string()
    }

    fn error_time(rows: &[Row]) -> String {
        svg(rows, Cost::Time)
    }

    #[test]
    fn svg_names_scene_adapter_units_methods_and_settings() {
        let svg = error_time(&sample_rows());
        for text in [
            "CT_AVM vessels",
            "llvmpipe (LLVM 19.1, 256 bits), 512 x 512 pixels, wall clock",
            "[ms]",
            "point_err_rms",
            "ray_err_max",
            "dsm",
            "epsilon=0.005",
            "Pareto front",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.contains("width=\"1240\" height=\"610\" viewBox=\"0 0 1240 610\""));
        assert!(svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn memory_is_drawn_of_what_stores_something() {
        let mut rows = sample_rows();
        rows[0].bytes = Some(0);
        rows[3].bytes = Some(4 << 20);
        let svg = svg(&rows, Cost::Memory);
        for text in ["Error against memory: CT_AVM vessels", "[MiB]", "dsm", "epsilon=0.005", "Pareto front"]
        {
            assert!(svg.contains(text), "{text}");
        }
        // Neither rows without bytes nor repeats, which bytes do not differ between.
        for text in [">none<", "osm", "repeat", "clock"] {
            assert!(!svg.contains(text), "{text}");
        }
        assert_eq!(Cost::Memory.of(&rows[3]), Some([4.0; 3]));
        assert_eq!(Cost::Memory.of(&rows[0]), None);
    }

    #[test]
    fn intervals_of_errors_are_drawn_and_named() {
        let mut rows = sample_rows();
        let lines = |svg: &str| svg.matches("<line").count() + svg.matches("<poly").count();
        let plain = error_time(&rows);
        rows[2].point_err_rms_lo = Some(0.008);
        rows[2].point_err_rms_hi = Some(0.013);
        let with = error_time(&rows);
        assert!(lines(&with) > lines(&plain), "one more bar");
        assert_eq!([&plain, &with].map(|svg| svg.contains("95 % interval")), [false, true]);
    }

    #[test]
    fn errors_of_zero_are_drawn_in_a_strip_named_for_what_it_holds() {
        let strip = |error: f64| {
            let mut rows = sample_rows();
            rows[1].point_err_rms = Some(error);
            let svg = error_time(&rows);
            (svg.contains(">0<"), svg.contains("≤ 10"))
        };
        assert_eq!(strip(0.0), (true, false));
        assert_eq!(strip(3e-9), (false, true));
        assert_eq!(strip(1e-3), (false, false));
    }

    #[test]
    fn rows_that_cannot_be_drawn_are_left_out() {
        let mut rows = sample_rows();
        rows[0].frame_ms = None;
        rows[1].point_err_rms = Some(f64::INFINITY);
        rows[2].point_err_rms = None;
        rows[3].frame_ms = Some(f64::NAN);
        let families = families(rows.iter().map(|r| r.method.as_str()));
        let drawn: Vec<bool> = rows
            .iter()
            .map(|r| datum(r, "", &families, Cost::Time, |r| Some([r.point_err_rms?; 3])).is_some())
            .collect();
        assert_eq!(drawn, [false, false, false, false, true]);
        for rows in [&rows[..1], &[]] {
            assert!(error_time(rows).contains("not measured"));
        }
    }

    #[test]
    fn png_is_twice_the_size_in_points_and_holds_the_colours() {
        let folder = tempfile::tempdir().unwrap();
        let paths =
            write_plots(&sample_rows(), folder.path(), &crate::report::names::plots("head"), &[]).unwrap();
        let names = ["png", "svg", "pdf"].map(|e| format!("compare_head.{e}"));
        assert!(paths.iter().zip(names).all(|(p, n)| p.ends_with(n) && p.exists()), "{paths:?}");
        assert_eq!(paths.len(), 6);
        assert!(std::fs::read(&paths[2]).unwrap().starts_with(b"%PDF-"));
        let picture = image::open(&paths[0]).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (2480, 1220));
        for name in ["none", "rays", "dsm", "osm"] {
            let color = style(name).unwrap().color;
            assert!(picture.pixels().any(|p| p.0 == color), "{name}");
        }
        assert_eq!(picture.get_pixel(0, 0).0, WHITE);
    }
}
