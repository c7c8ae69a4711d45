//! Makes docs/strip.png: a scene without shadows, with shadow rays and with a deep shadow map, where that map is wrong
//! against the exact answer, and the error-against-time plot of a table of `compare`.
//!
//! `make strip` runs it: `strip SCENE.toml COMPARE.csv STRIP.png`.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, Rgba, RgbaImage, imageops};
use resvg::{tiny_skia, usvg};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use umbravox::error::Error;
use umbravox::exact::ExactField;
use umbravox::files::loading::Loading;
use umbravox::files::output::write_whole;
use umbravox::files::picture::picture_png;
use umbravox::measure::error_map::{ExactView, Quantity};
use umbravox::open::{Loaded, SceneSettings};
use umbravox::render::{Forced, Session};
use umbravox::report::heat::false_colour;
use umbravox::shadow;

const DSM: &str = "dsm:epsilon=0.02,map=256";
/// The error that is drawn brightest.
const BRIGHTEST: f32 = 0.1;
/// Pixels of a panel's sides: fewer than are drawn, so that edges are smooth and the file is small.
const SIDE: u32 = 264;
/// Pixels between panels, and the width of the plot in heights of a panel.
const GAP: u32 = 6;
const PLOT: f64 = 1.25;
/// Methods with their colours.
const METHODS: [(&str, &str); 11] = [
    ("none", "#ffffff"),
    ("rays", "#e48cbf"),
    ("dsm", "#5ab4f0"),
    ("osm", "#e69f00"),
    ("dom", "#1fc191"),
    ("bom", "#f07a30"),
    ("clusters", "#c8c850"),
    ("fourier", "#d8609c"),
    ("avsm", "#66d9c4"),
    ("moments", "#9a8cf0"),
    ("lightvolume", "#6fcf80"),
];
/// What the plot shows: errors from this one on (`rays` is farther off than all others are apart, and is said in words).
const LEAST_ERROR: f64 = 1e-3;

fn main() -> umbravox::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [scene, table, output] = &args[..] else {
        return Err(Error::input("bad command line", "strip", "expected SCENE.toml COMPARE.csv STRIP.png"));
    };
    let panels = panels(Path::new(scene))?;
    let left = panels.len() as u32 * (SIDE + GAP);
    let (width, height) = (left + (PLOT * f64::from(SIDE)) as u32, SIDE);
    let mut strip = RgbaImage::from_pixel(width, height, Rgba([0, 0, 0, 255]));
    let size = f64::from(SIDE) / 15.0;
    let mut svg = String::new();
    for (i, (label, picture)) in (0_u32..).zip(&panels) {
        let x = i * (SIDE + GAP);
        let picture = imageops::resize(picture, SIDE, SIDE, imageops::FilterType::Lanczos3);
        imageops::overlay(&mut strip, &picture, i64::from(x), 0);
        svg += &text([f64::from(x) + 0.5 * size, 1.2 * size], size, "#ffffff", label);
    }
    svg += &plot(Path::new(table), f64::from(left), f64::from(height), size)?;
    imageops::overlay(&mut strip, &drawn(&svg, width, height)?, 0, 0);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    let encoded = DynamicImage::from(strip).to_rgb8().write_with_encoder(encoder);
    encoded.map_err(|e| failed(output, &e))?;
    write_whole(Path::new(output), |file| file.write_all(bytes.get_ref()))
}

/// The four pictures with their labels.
fn panels(path: &Path) -> umbravox::Result<Vec<(&'static str, RgbaImage)>> {
    let Loaded { volume, tf, scene, .. } = SceneSettings::read(path)?.load(&Loading::default())?;
    let session = Session::open(None, Arc::clone(&volume), &tf, Forced::default())?;
    let mut panels = Vec::new();
    for (label, method) in [("no shadows", "none"), ("shadow rays", "rays"), ("deep shadow map", DSM)] {
        let shadow = session.shadow_of(shadow::parse(method)?.as_ref(), &scene, scene.light())?;
        let png = picture_png(&session.render(&shadow, &scene)?.pixels)?;
        let picture = image::load_from_memory(&png).map_err(|e| failed(label, &e))?;
        panels.push((label, picture.to_rgba8()));
    }
    let go_on = || true;
    let field = ExactField::new(&volume, &tf);
    let shadow = session.shadow_of(shadow::parse(DSM)?.as_ref(), &scene, scene.light())?;
    let exact = ExactView::new(&field, &scene, Quantity::Light, go_on);
    let map = exact.map(|e| e.errors(&session.renderer, &session.loaded, &session.transfer, &shadow, go_on));
    if let Some(map) = map.transpose()?.flatten() {
        // What sees nothing has no error to show.
        let errors = map.errors.mapv(|e| if e.is_nan() { 0.0 } else { e.abs() });
        panels.push(("its error to 0.1", DynamicImage::from(false_colour(&errors, BRIGHTEST)).to_rgba8()));
    }
    Ok(panels)
}

/// Time and error of every row of a table, a list a method.
fn points(table: &Path) -> umbravox::Result<BTreeMap<String, Vec<[f64; 2]>>> {
    let mut reader = csv::Reader::from_path(table).map_err(|e| failed(table.display(), &e))?;
    let mut points: BTreeMap<String, Vec<[f64; 2]>> = BTreeMap::new();
    for row in reader.deserialize::<BTreeMap<String, String>>() {
        let row = row.map_err(|e| failed(table.display(), &e))?;
        let number = |column: &str| row.get(column).and_then(|v| v.parse::<f64>().ok());
        if let (Some(build), Some(frame), Some(error)) =
            (number("build_ms"), number("frame_ms"), number("point_err_rms"))
        {
            let method = row.get("method").cloned().unwrap_or_default();
            points.entry(method).or_default().push([1e-3 * (build + frame), error]);
        }
    }
    Ok(points)
}

/// Error against time of a table's rows, a line a method, on logarithmic axes; names stand in a column beside it.
fn plot(table: &Path, left: f64, height: f64, size: f64) -> umbravox::Result<String> {
    let points = points(table)?;
    let shown = |p: &&[f64; 2]| p[1] >= LEAST_ERROR;
    let range = |axis: usize| {
        let all = points.values().flatten().filter(shown).map(|p| p[axis].log10());
        let [lo, hi] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        [lo - 0.08 * (hi - lo), hi + 0.08 * (hi - lo)]
    };
    let (xs, ys) = (range(0), range(1));
    let (from, to) =
        ([left + 2.6 * size, 3.2 * size], [left + PLOT * height - 7.0 * size, height - 2.6 * size]);
    let x = |v: f64| from[0] + (v.log10() - xs[0]) / (xs[1] - xs[0]) * (to[0] - from[0]);
    let y = |v: f64| to[1] - (v.log10() - ys[0]) / (ys[1] - ys[0]) * (to[1] - from[1]);
    let mut svg =
        text([left + 0.5 * size, 1.2 * size], size, "#ffffff", "rms error of what is seen, against time");
    let small = 0.72 * size;
    let line = |a: [f64; 2], b: [f64; 2], color: &str, width: f64| {
        let [[ax, ay], [bx, by]] = [a, b];
        format!(
            r#"<line x1="{ax:.1}" y1="{ay:.1}" x2="{bx:.1}" y2="{by:.1}" stroke="{color}" stroke-width="{width}"/>"#
        )
    };
    for error in [0.003, 0.01, 0.03, 0.1, 0.3, 1.0] {
        let at = y(error);
        if (from[1]..=to[1]).contains(&at) {
            svg += &line([from[0], at], [to[0], at], "#444444", 2.0);
            svg += &text([left + 0.4 * size, at + 0.3 * small], small, "#bbbbbb", &error.to_string());
        }
    }
    for seconds in [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0] {
        let at = x(seconds);
        if (from[0]..=to[0]).contains(&at) {
            svg += &line([at, from[1]], [at, to[1]], "#444444", 2.0);
            svg += &text([at - small, to[1] + 1.4 * small], small, "#bbbbbb", &format!("{seconds} s"));
        }
    }
    let mut names: Vec<(f64, [f64; 2], &str, &str)> = Vec::new();
    for (method, color) in METHODS {
        let Some(points) = points.get(method) else { continue };
        let shown: Vec<[f64; 2]> = points.iter().filter(shown).map(|p| [x(p[0]), y(p[1])]).collect();
        let Some(&last) = shown.last() else {
            for [seconds, error] in points {
                let words = format!("{method}: {error:.0e} in {seconds:.0} s");
                svg += &text([from[0], height - 0.4 * size], small, color, &words);
            }
            continue;
        };
        let places: Vec<String> = shown.iter().map(|p| format!("{:.1},{:.1}", p[0], p[1])).collect();
        svg += &format!(r#"<polyline points="{}" fill="none" stroke="{color}"/>"#, places.join(" "));
        for [x, y] in &shown {
            svg += &format!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="{:.1}" fill="{color}"/>"#, 0.25 * size);
        }
        names.push((last[1], last, method, color));
    }
    // Names in the order of their points, a line's height apart.
    names.sort_by(|a, b| a.0.total_cmp(&b.0));
    let apart = 1.05 * size;
    for i in 0..names.len() {
        let room_below = to[1] - (names.len() - 1 - i) as f64 * apart;
        let above = if i == 0 { from[1] - size } else { names[i - 1].0 + apart };
        names[i].0 = names[i].0.min(room_below).max(above);
    }
    for (at, last, method, color) in names {
        svg += &line([last[0] + 0.35 * size, last[1]], [to[0] + 0.4 * size, at], color, 0.7);
        svg += &text([to[0] + 0.6 * size, at + 0.3 * size], size, color, method);
    }
    Ok(svg)
}

fn text([x, y]: [f64; 2], size: f64, color: &str, text: &str) -> String {
    format!(r#"<text x="{x:.1}" y="{y:.1}" font-size="{size:.1}" fill="{color}">{text}</text>"#)
}

/// What an SVG's elements look like, over nothing.
fn drawn(elements: &str, width: u32, height: u32) -> umbravox::Result<RgbaImage> {
    let mut options = usvg::Options { font_family: "Ubuntu".into(), ..Default::default() };
    options.fontdb_mut().load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    let svg = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="Ubuntu" stroke-width="2">{elements}</svg>"#
    );
    let tree = usvg::Tree::from_str(&svg, &options).map_err(|e| failed("SVG", &e))?;
    let mut pixels =
        tiny_skia::Pixmap::new(width, height).ok_or_else(|| failed("SVG", &"it is too large"))?;
    resvg::render(&tree, tiny_skia::Transform::identity(), &mut pixels.as_mut());
    let straight = pixels.pixels().iter().map(|p| p.demultiply());
    let bytes = straight.flat_map(|p| [p.red(), p.green(), p.blue(), p.alpha()]).collect();
    RgbaImage::from_raw(width, height, bytes).ok_or_else(|| failed("SVG", &"it has another size"))
}

fn failed(place: impl std::fmt::Display, why: &dyn std::fmt::Display) -> Error {
    Error::runtime("cannot make the strip", place, why)
}
