//! A drawing in points: an SVG document, and that same document as pixels and as a PDF file.

use crate::error::{Error, Result};
use crate::files::color::srgb8_from_linear;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use image::RgbImage;
use image::imageops::{self, FilterType};
use maud::{Markup, PreEscaped, html};
use ndarray::Array3;
use resvg::{tiny_skia, usvg};
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};
use std::sync::{Arc, LazyLock};

/// A colour, sRGB.
pub type Rgb = [u8; 3];

/// Letters.
pub const BLACK: Rgb = [0, 0, 0];
/// Lines and small text.
pub const INK: Rgb = [40, 40, 40];
/// The ground.
pub const WHITE: Rgb = [255, 255, 255];

/// `x` to the right, `y` down, points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point(pub f64, pub f64);

/// A rectangle, points.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "its sides are their names")]
pub struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    /// Rectangle with a centre and half sides.
    pub fn around(center: Point, half_width: f64, half_height: f64) -> Self {
        let Point(x, y) = center;
        Self { left: x - half_width, top: y - half_height, right: x + half_width, bottom: y + half_height }
    }

    /// Centre of the rectangle.
    pub fn middle(&self) -> Point {
        Point(0.5 * (self.left + self.right), 0.5 * (self.top + self.bottom))
    }

    /// Moves every side inwards.
    pub fn inset(&self, by: f64) -> Self {
        Self { left: self.left + by, top: self.top + by, right: self.right - by, bottom: self.bottom - by }
    }

    /// Clockwise from the upper left.
    pub fn corners(&self) -> [Point; 4] {
        let Self { left, top, right, bottom } = *self;
        [Point(left, top), Point(right, top), Point(right, bottom), Point(left, bottom)]
    }

    /// Square points.
    pub fn area(&self) -> f64 {
        (self.right - self.left) * (self.bottom - self.top)
    }

    /// Area of the intersection.
    pub fn overlap(&self, other: &Self) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }

    /// Whether another rectangle lies within this one.
    pub fn holds(&self, other: &Self) -> bool {
        other.left >= self.left
            && other.right <= self.right
            && other.top >= self.top
            && other.bottom <= self.bottom
    }

    /// Whether a point lies within the rectangle.
    pub fn contains(&self, p: Point) -> bool {
        (self.left..=self.right).contains(&p.0) && (self.top..=self.bottom).contains(&p.1)
    }
}

/// Part of a text at its position; vertically it is always the middle of the digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Anchor {
    /// Start of the text.
    Start,
    /// Middle of the text.
    Middle,
    /// End of the text.
    End,
}

/// Resolution of [`Drawing::bitmap`], pixels per point.
pub const PIXELS_PER_POINT: u32 = 2;
/// The family as SVG viewers see it; pixels are drawn in its first, which is compiled in.
const FONT_FAMILY: &str = "Ubuntu, Helvetica, Arial, sans-serif";
/// Half the height of a digit, in font sizes.
const HALF_DIGIT: f64 = 0.35;

/// Shapes on a page, later ones over earlier ones, and pictures under them all.
#[derive(Debug, Clone)]
pub struct Drawing {
    width: f64,
    height: f64,
    ground: Rgb,
    shapes: String,
    pictures: Vec<(Rect, RgbImage)>,
}

impl Drawing {
    /// An empty white page of a size in points.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, ground: WHITE, shapes: String::new(), pictures: Vec::new() }
    }

    /// Width and height of the page, points.
    pub fn size(&self) -> [f64; 2] {
        [self.width, self.height]
    }

    /// Replaces the background colour of the drawing.
    #[must_use]
    pub fn on(self, ground: Rgb) -> Self {
        Self { ground, ..self }
    }

    fn add(&mut self, shape: Markup) {
        self.shapes += &shape.into_string();
    }

    /// A path of straight lines.
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

    /// The sides of a rectangle.
    pub fn outline(&mut self, r: Rect, width: f64, color: Rgb) {
        let [a, b, c, d] = r.corners();
        self.line(&[a, b, c, d, a], width, color);
    }

    /// Fills the interior of a closed path.
    pub fn polygon(&mut self, points: &[Point], color: Rgb) {
        self.add(html! { polygon points=(list(points)) fill=(hex(color)) {} });
    }

    /// Letters of a size, points.
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

    /// A picture, stretched over its place.
    pub fn picture(&mut self, place: Rect, picture: RgbImage) {
        self.pictures.push((place, picture));
    }

    /// The page as an SVG document without its pictures, or as an element of another document that says what it is `about`.
    pub fn svg(&self, about: Option<&str>) -> Markup {
        self.document(about, html! { rect width="100%" height="100%" fill=(hex(self.ground)) {} })
    }

    /// The shapes over something.
    fn document(&self, about: Option<&str>, under: Markup) -> Markup {
        html! {
            svg xmlns="http://www.w3.org/2000/svg" width=(self.width) height=(self.height)
                viewBox={ "0 0 " (self.width) " " (self.height) } font-family=(FONT_FAMILY)
                role=[about.map(|_| "img")] aria-label=[about] {
                (under)
                (PreEscaped(&self.shapes))
            }
        }
    }

    /// The page as a bitmap of [`PIXELS_PER_POINT`].
    ///
    /// # Errors
    /// A page too large for any picture.
    pub fn bitmap(&self) -> Result<RgbImage> {
        self.bitmap_of(f64::from(PIXELS_PER_POINT))
    }

    /// The page as a bitmap of so many pixels a point; its pictures are fitted to their places.
    ///
    /// # Errors
    /// See [`Self::bitmap`].
    pub fn bitmap_of(&self, pixels_per_point: f64) -> Result<RgbImage> {
        let failed = |e: &dyn std::fmt::Display| Error::runtime("cannot draw", "plot", e);
        let options = usvg::Options { fontdb: Arc::clone(&FONTS), ..usvg::Options::default() };
        let shapes = self.document(None, html! {}).into_string();
        let tree = usvg::Tree::from_str(&shapes, &options).map_err(|e| failed(&e))?;
        let pixel = |points: f64| (points * pixels_per_point).round() as u32;
        let (width, height) = (pixel(self.width), pixel(self.height));
        let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or_else(|| failed(&"it is too large"))?;
        let mut under = RgbImage::from_pixel(width, height, image::Rgb(self.ground));
        for (Rect { left, top, right, bottom }, picture) in &self.pictures {
            let [left, top, right, bottom] = [left, top, right, bottom].map(|side| pixel(*side));
            let (wide, high) = ((right - left).max(1), (bottom - top).max(1));
            // Enlarged, a pixel stays one; made smaller, none is dropped.
            let filter = if wide >= picture.width() { FilterType::Nearest } else { FilterType::Triangle };
            let fitted = imageops::resize(picture, wide, high, filter);
            imageops::replace(&mut under, &fitted, left.into(), top.into());
        }
        for (pixel, image::Rgb([r, g, b])) in
            pixels.data_mut().as_chunks_mut::<4>().0.iter_mut().zip(under.pixels())
        {
            *pixel = [*r, *g, *b, u8::MAX];
        }
        let scale = pixels_per_point as f32;
        resvg::render(&tree, tiny_skia::Transform::from_scale(scale, scale), &mut pixels.as_mut());
        let opaque = pixels.data().chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
        RgbImage::from_raw(width, height, opaque).ok_or_else(|| failed(&"it is too large"))
    }

    /// [`Self::bitmap`] as a PNG file.
    ///
    /// # Errors
    /// See [`Self::bitmap`].
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.bitmap()?)
    }
}

impl Drawing {
    /// The page as a PDF file of one page, its letters text in an embedded font and its pictures with every pixel.
    ///
    /// # Errors
    /// A page that cannot be converted.
    pub fn pdf(&self) -> Result<Vec<u8>> {
        let failed = |e: &dyn std::fmt::Display| Error::runtime("cannot draw", "PDF", e);
        let mut options = svg2pdf::usvg::Options::default();
        options.fontdb_mut().load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
        let mut under = html! { rect width="100%" height="100%" fill=(hex(self.ground)) {} }.into_string();
        for (Rect { left, top, right, bottom }, picture) in &self.pictures {
            let file = BASE64.encode(encode_png(picture)?);
            let picture = html! {
                image x=(short(*left)) y=(short(*top)) width=(short(right - left)) height=(short(bottom - top))
                    preserveAspectRatio="none" href={ "data:image/png;base64," (file) } {}
            };
            under += &picture.into_string();
        }
        let page = self.document(None, PreEscaped(under)).into_string();
        let tree = svg2pdf::usvg::Tree::from_str(&page, &options).map_err(|e| failed(&e))?;
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
pub fn encode_png(picture: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|e| Error::runtime("cannot encode picture", "PNG", e))?;
    Ok(bytes.into_inner())
}

/// Converts a linear RGBA picture to 8-bit sRGB, as in its PNG file.
pub fn srgb_picture(picture: &Array3<f32>) -> RgbImage {
    let (height, width, _) = picture.dim();
    RgbImage::from_fn(width as u32, height as u32, |column, row| {
        image::Rgb(
            [0, 1, 2].map(|c| srgb8_from_linear(f64::from(picture[[row as usize, column as usize, c]]))),
        )
    })
}
