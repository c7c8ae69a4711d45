//! A drawing in points: an SVG document, and that same document as pixels.

use crate::error::{Error, Result};
use maud::{Markup, PreEscaped, html};
use resvg::{tiny_skia, usvg};
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};
use std::sync::{Arc, LazyLock};

pub type Rgb = [u8; 3];

pub const BLACK: Rgb = [0, 0, 0];
/// Lines and small text.
pub const INK: Rgb = [40, 40, 40];
pub const WHITE: Rgb = [255, 255, 255];

/// `x` to the right, `y` down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point(pub f64, pub f64);

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    pub fn around(center: Point, half_width: f64, half_height: f64) -> Self {
        let Point(x, y) = center;
        Self { left: x - half_width, top: y - half_height, right: x + half_width, bottom: y + half_height }
    }

    /// Moves every side inwards.
    pub fn inset(&self, by: f64) -> Self {
        Self { left: self.left + by, top: self.top + by, right: self.right - by, bottom: self.bottom - by }
    }

    pub fn corners(&self) -> [Point; 4] {
        let Self { left, top, right, bottom } = *self;
        [Point(left, top), Point(right, top), Point(right, bottom), Point(left, bottom)]
    }

    pub fn area(&self) -> f64 {
        (self.right - self.left) * (self.bottom - self.top)
    }

    /// Area of the intersection.
    pub fn overlap(&self, other: &Self) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }

    pub fn holds(&self, other: &Self) -> bool {
        other.left >= self.left
            && other.right <= self.right
            && other.top >= self.top
            && other.bottom <= self.bottom
    }

    pub fn contains(&self, p: Point) -> bool {
        (self.left..=self.right).contains(&p.0) && (self.top..=self.bottom).contains(&p.1)
    }
}

/// Which part of a text lies at its place; vertically it is always the middle of its digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

/// Of [`Drawing::bitmap`].
pub const PIXELS_PER_POINT: u32 = 2;
/// The family as SVG viewers see it; pixels are drawn in its first, which is compiled in.
const FONT_FAMILY: &str = "Ubuntu, Helvetica, Arial, sans-serif";
/// Half the height of a digit, in font sizes.
const HALF_DIGIT: f64 = 0.35;

/// Shapes on a white page, later ones over earlier ones.
#[derive(Debug, Clone)]
pub struct Drawing {
    width: f64,
    height: f64,
    shapes: String,
}

impl Drawing {
    /// An empty page of a size in points.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, shapes: String::new() }
    }

    fn add(&mut self, shape: Markup) {
        self.shapes += &shape.into_string();
    }

    pub fn line(&mut self, points: &[Point], width: f64, color: Rgb) {
        self.stroke(points, width, color, None);
    }

    /// A path in dashes and gaps of these lengths, which run on around corners.
    pub fn dashed(&mut self, path: &[Point], width: f64, color: Rgb, [dash, gap]: [f64; 2]) {
        self.stroke(path, width, color, Some(format!("{dash} {gap}")));
    }

    fn stroke(&mut self, path: &[Point], width: f64, color: Rgb, dashes: Option<String>) {
        self.add(html! {
            polyline points=(list(path)) fill="none" stroke=(hex(color)) stroke-width=(width)
                stroke-linejoin="round" stroke-dasharray=[dashes] {}
        });
    }

    pub fn outline(&mut self, r: Rect, width: f64, color: Rgb) {
        let [a, b, c, d] = r.corners();
        self.line(&[a, b, c, d, a], width, color);
    }

    pub fn polygon(&mut self, points: &[Point], color: Rgb) {
        self.add(html! { polygon points=(list(points)) fill=(hex(color)) {} });
    }

    pub fn text(&mut self, at: Point, anchor: Anchor, size: f64, color: Rgb, text: &str) {
        self.letters(at, anchor, size, color, text, None);
    }

    /// Text that reads upwards, centred at its place.
    pub fn rotated_text(&mut self, at: Point, size: f64, color: Rgb, text: &str) {
        let turn = format!("rotate(-90 {} {})", short(at.0), short(at.1));
        self.letters(at, Anchor::Middle, size, color, text, Some(turn));
    }

    fn letters(
        &mut self,
        at: Point,
        anchor: Anchor,
        size: f64,
        color: Rgb,
        text: &str,
        turn: Option<String>,
    ) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        // XML has no control characters.
        let text = text.replace(char::is_control, "\u{fffd}");
        self.add(html! {
            text x=(short(at.0)) y=(short(at.1 + HALF_DIGIT * size)) text-anchor=(anchor) font-size=(size)
                fill=(hex(color)) transform=[turn] { (text) }
        });
    }

    /// The page as an SVG document, or as an element of another document that says what it is `about`.
    pub fn svg(&self, about: Option<&str>) -> Markup {
        html! {
            svg xmlns="http://www.w3.org/2000/svg" width=(self.width) height=(self.height)
                viewBox={ "0 0 " (self.width) " " (self.height) } font-family=(FONT_FAMILY)
                role=[about.map(|_| "img")] aria-label=[about] {
                rect width="100%" height="100%" fill="#ffffff" {}
                (PreEscaped(&self.shapes))
            }
        }
    }

    /// The page as a bitmap of [`PIXELS_PER_POINT`].
    ///
    /// # Errors
    /// A page too large for any picture.
    pub fn bitmap(&self) -> Result<image::RgbImage> {
        let failed = |e: &dyn std::fmt::Display| Error::runtime("cannot draw", "plot", e);
        let options = usvg::Options { fontdb: Arc::clone(&FONTS), ..usvg::Options::default() };
        let tree = usvg::Tree::from_str(&self.svg(None).into_string(), &options).map_err(|e| failed(&e))?;
        let scale = PIXELS_PER_POINT as f32;
        let [width, height] =
            [self.width, self.height].map(|points| (points * f64::from(scale)).round() as u32);
        let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or_else(|| failed(&"it is too large"))?;
        resvg::render(&tree, tiny_skia::Transform::from_scale(scale, scale), &mut pixels.as_mut());
        let opaque = pixels.data().chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
        image::RgbImage::from_raw(width, height, opaque).ok_or_else(|| failed(&"it is too large"))
    }

    /// [`Self::bitmap`] as a PNG file.
    ///
    /// # Errors
    /// As there.
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.bitmap()?)
    }
}

impl Drawing {
    /// The page as a PDF file of one page, its letters text in an embedded font.
    ///
    /// # Errors
    /// A page that cannot be converted.
    pub fn pdf(&self) -> Result<Vec<u8>> {
        let failed = |e: &dyn std::fmt::Display| Error::runtime("cannot draw", "PDF", e);
        let mut options = svg2pdf::usvg::Options::default();
        options.fontdb_mut().load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
        let tree =
            svg2pdf::usvg::Tree::from_str(&self.svg(None).into_string(), &options).map_err(|e| failed(&e))?;
        svg2pdf::to_pdf(&tree, svg2pdf::ConversionOptions::default(), svg2pdf::PageOptions::default())
            .map_err(|e| failed(&e))
    }
}

/// A coordinate to a hundredth of a point.
fn short(x: f64) -> f64 {
    (100.0 * x).round() / 100.0
}

fn list(points: &[Point]) -> String {
    points.iter().map(|Point(x, y)| format!("{},{}", short(*x), short(*y))).collect::<Vec<_>>().join(" ")
}

fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

static FONTS: LazyLock<Arc<usvg::fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    Arc::new(fonts)
});

/// Width of a text in points.
pub fn text_width(text: &str, size: f64) -> f64 {
    // It is compiled in and known to be a font.
    let Ok(font) = FontRef::new(epaint_default_fonts::UBUNTU_LIGHT) else { return 0.0 };
    let (letters, widths) =
        (font.charmap(), font.glyph_metrics(Size::new(size as f32), LocationRef::default()));
    let width = |c| widths.advance_width(letters.map(c).unwrap_or_default()).unwrap_or_default();
    text.chars().map(|c| f64::from(width(c))).sum()
}

/// A picture as a PNG file.
///
/// # Errors
/// The encoder's own.
pub fn encode_png(picture: &image::RgbImage) -> Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|e| Error::runtime("cannot encode picture", "PNG", e))?;
    Ok(bytes.into_inner())
}
