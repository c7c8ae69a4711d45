//! Makes docs/strip.png: a scene without shadows, with shadow rays and with a deep shadow map, the error of that map, and
//! the error-against-time plot of a table of `compare`.
//!
//! `make pictures` runs it: `strip SCENE.toml COMPARE.csv STRIP.png`.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{RgbImage, imageops};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use umbravox::error::Error;
use umbravox::exact::ExactField;
use umbravox::files::loading::Loading;
use umbravox::files::output::write_whole;
use umbravox::files::picture::picture_png;
use umbravox::measure::error_map::{ExactView, Quantity};
use umbravox::open::{Loaded, SceneRequest};
use umbravox::render::{DisabledOptimizations, Session};
use umbravox::report::canvas::{Anchor, Drawing, Point, Rect, Rgb};
use umbravox::report::heat::false_colour;
use umbravox::shadow;

const DSM: &str = "dsm:epsilon=0.02,map=256";
/// Error of the brightest colour.
const BRIGHTEST: f32 = 0.1;
/// Side of a panel in pixels, less than that of the rendered pictures: edges are smooth and the file is small.
const SIDE: u32 = 264;
/// Gap between panels in pixels, and width of the plot in heights of a panel.
const GAP: u32 = 6;
const PLOT: f64 = 1.25;
const BLACK: Rgb = [0; 3];
const WHITE: Rgb = [255; 3];
const GREY: Rgb = [187; 3];
const GRID: Rgb = [68; 3];
/// Methods with their colours, distinct on black.
const METHODS: [(&str, Rgb); 15] = [
    ("none", WHITE),
    ("rays", [228, 140, 191]),
    ("dsm", [90, 180, 240]),
    ("osm", [230, 159, 0]),
    ("dom", [31, 193, 145]),
    ("bom", [240, 122, 48]),
    ("clusters", [200, 200, 80]),
    ("fourier", [216, 96, 156]),
    ("wavelet", [206, 120, 230]),
    ("avsm", [102, 217, 196]),
    ("moments", [154, 140, 240]),
    ("beer", [136, 204, 238]),
    ("lightvolume", [111, 207, 128]),
    ("sat", [221, 204, 119]),
    ("halfangle", [170, 68, 153]),
];
/// Smallest error in the plot; the error of `rays` is far smaller and is printed as text.
const LEAST_ERROR: f64 = 1e-3;

fn main() -> umbravox::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [scene, table, output] = &args[..] else {
        return Err(Error::input("bad command line", "strip", "expected SCENE.toml COMPARE.csv STRIP.png"));
    };
    let panels = panels(Path::new(scene))?;
    // One point is one pixel.
    let side = f64::from(SIDE);
    let apart = side + f64::from(GAP);
    let left = panels.len() as f64 * apart;
    let size = side / 15.0;
    let mut strip = Drawing::new((left + PLOT * side).floor(), side).on(BLACK);
    for (i, (label, picture)) in panels.into_iter().enumerate() {
        let x = i as f64 * apart;
        let picture = imageops::resize(&picture, SIDE, SIDE, imageops::FilterType::Lanczos3);
        strip.picture(Rect { left: x, top: 0.0, right: x + side, bottom: side }, picture);
        text(&mut strip, [x + 0.5 * size, 0.85 * size], size, WHITE, label);
    }
    plot(&mut strip, Path::new(table), left, side, size)?;
    let mut bytes = std::io::Cursor::new(Vec::new());
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    let encoded = strip.bitmap_of(1.0)?.write_with_encoder(encoder);
    encoded.map_err(|e| failed(output, &e))?;
    write_whole(Path::new(output), |file| file.write_all(bytes.get_ref()))
}

/// Panels with their labels.
fn panels(path: &Path) -> umbravox::Result<Vec<(&'static str, RgbImage)>> {
    let Loaded { volume, tf, scene, .. } = SceneRequest::read(path)?.settings.load(&Loading::default())?;
    let session = Session::open(None, Arc::clone(&volume), &tf, DisabledOptimizations::NONE)?;
    let mut panels = Vec::new();
    for (label, method) in [("no shadows", "none"), ("shadow rays", "rays"), ("deep shadow map", DSM)] {
        let shadow = session.shadow_of(shadow::parse(method)?.as_ref(), &scene, scene.light())?;
        let png = picture_png(&session.render(&shadow, &scene)?.pixels)?;
        let picture = image::load_from_memory(&png).map_err(|e| failed(label, &e))?;
        panels.push((label, picture.to_rgb8()));
    }
    let go_on = || true;
    let field = ExactField::new(&volume, &tf);
    let shadow = session.shadow_of(shadow::parse(DSM)?.as_ref(), &scene, scene.light())?;
    let exact = ExactView::new(&field, &scene, Quantity::Light, go_on);
    let map = exact.map(|e| e.errors(&session.renderer, &session.loaded, &session.transfer, &shadow, go_on));
    if let Some(map) = map.transpose()?.flatten() {
        // Pixels without extinction have no error.
        let errors = map.errors.mapv(|e| if e.is_nan() { 0.0 } else { e.abs() });
        panels.push(("its error to 0.1", false_colour(&errors, BRIGHTEST)));
    }
    Ok(panels)
}

/// Time and error of every row of a table, by method, without the rows of papers.
fn points(table: &Path) -> umbravox::Result<BTreeMap<String, Vec<[f64; 2]>>> {
    let mut reader = csv::Reader::from_path(table).map_err(|e| failed(table.display(), &e))?;
    let mut points: BTreeMap<String, Vec<[f64; 2]>> = BTreeMap::new();
    for row in reader.deserialize::<BTreeMap<String, String>>() {
        let row = row.map_err(|e| failed(table.display(), &e))?;
        if row.get("published").is_some_and(|paper| !paper.is_empty()) {
            continue;
        }
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

/// Draws error against time with one line per method, on logarithmic axes, and the names in a column beside it.
fn plot(strip: &mut Drawing, table: &Path, left: f64, height: f64, size: f64) -> umbravox::Result<()> {
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
    text(strip, [left + 0.5 * size, 0.85 * size], size, WHITE, "rms error at visible points, against time");
    let small = 0.72 * size;
    for error in [0.003, 0.01, 0.03, 0.1, 0.3, 1.0] {
        let at = y(error);
        if (from[1]..=to[1]).contains(&at) {
            strip.line(&[Point(from[0], at), Point(to[0], at)], 2.0, GRID);
            text(strip, [left + 0.4 * size, at], small, GREY, &error.to_string());
        }
    }
    for seconds in [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0] {
        let at = x(seconds);
        if (from[0]..=to[0]).contains(&at) {
            strip.line(&[Point(at, from[1]), Point(at, to[1])], 2.0, GRID);
            text(strip, [at - small, to[1] + 1.1 * small], small, GREY, &format!("{seconds} s"));
        }
    }
    let mut names: Vec<(f64, Point, &str, Rgb)> = Vec::new();
    for (method, color) in METHODS {
        let Some(points) = points.get(method) else { continue };
        let shown: Vec<Point> = points.iter().filter(shown).map(|p| Point(x(p[0]), y(p[1]))).collect();
        let Some(&last) = shown.last() else {
            for [seconds, error] in points {
                let words = format!("{method}: {error:.0e} in {seconds:.0} s");
                text(strip, [from[0], height - 0.65 * size], small, color, &words);
            }
            continue;
        };
        strip.line(&shown, 2.0, color);
        for place in &shown {
            strip.polygon(&disc(*place, 0.25 * size), color);
        }
        names.push((last.1, last, method, color));
    }
    // Names in the order of their last points, one line height apart.
    names.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (apart, letters, bottom) = (0.88 * size, 0.85 * size, to[1] + 1.6 * size);
    for i in 0..names.len() {
        let lowest = bottom - (names.len() - 1 - i) as f64 * apart;
        let above = if i == 0 { from[1] - size } else { names[i - 1].0 + apart };
        names[i].0 = names[i].0.min(lowest).max(above);
    }
    for (at, Point(last_x, last_y), method, color) in names {
        strip.line(&[Point(last_x + 0.35 * size, last_y), Point(to[0] + 0.4 * size, at)], 0.7, color);
        text(strip, [to[0] + 0.6 * size, at], letters, color, method);
    }
    Ok(())
}

/// Polygon of a disc.
fn disc(Point(x, y): Point, radius: f64) -> Vec<Point> {
    let corner = |i: i32| f64::from(i) * std::f64::consts::TAU / 24.0;
    (0..24).map(|i| Point(x + radius * corner(i).cos(), y + radius * corner(i).sin())).collect()
}

/// Draws text from the left, centred vertically.
fn text(strip: &mut Drawing, [x, y]: [f64; 2], size: f64, color: Rgb, text: &str) {
    strip.text(Point(x, y), Anchor::Start, size, color, text);
}

fn failed(place: impl std::fmt::Display, why: &dyn std::fmt::Display) -> Error {
    Error::runtime("cannot make the strip", place, why)
}
