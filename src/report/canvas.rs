//! Vector drawing for plots and figures, with sizes in points; exports SVG, PNG and PDF.

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

/// 8-bit sRGB colour of a plot element.
pub type Rgb = [u8; 3];

/// Text colour of plots and figures.
pub const BLACK: Rgb = [0, 0, 0];
/// Colour of lines and small text in plots and figures.
pub const INK: Rgb = [40, 40, 40];
/// Default background colour of plots and figures.
pub const WHITE: Rgb = [255, 255, 255];

/// Position on the page of a drawing, in points: `x` to the right, `y` down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point(pub f64, pub f64);

/// Axis-aligned rectangle on the page of a drawing, in points.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "its sides are their names")]
pub struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    /// Creates a rectangle from its centre, half width and half height, in points.
    pub fn around(center: Point, half_width: f64, half_height: f64) -> Self {
        let Point(x, y) = center;
        Self { left: x - half_width, top: y - half_height, right: x + half_width, bottom: y + half_height }
    }

    /// Returns the centre of a rectangle on the page of a drawing.
    pub fn middle(&self) -> Point {
        Point(0.5 * (self.left + self.right), 0.5 * (self.top + self.bottom))
    }

    /// Moves every side of a rectangle on a drawing's page inwards by a distance in points; a negative distance
    /// enlarges the rectangle.
    pub fn inset(&self, by: f64) -> Self {
        Self { left: self.left + by, top: self.top + by, right: self.right - by, bottom: self.bottom - by }
    }

    /// Returns the corners of a rectangle on the page of a drawing, clockwise from the upper left.
    pub fn corners(&self) -> [Point; 4] {
        let Self { left, top, right, bottom } = *self;
        [Point(left, top), Point(right, top), Point(right, bottom), Point(left, bottom)]
    }

    /// Returns the area of a rectangle on the page of a drawing, in square points.
    pub fn area(&self) -> f64 {
        (self.right - self.left) * (self.bottom - self.top)
    }

    /// Returns the area of the intersection of two rectangles on the page of a drawing, in square points.
    pub fn overlap(&self, other: &Self) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }

    /// Returns whether a rectangle on the page of a drawing contains another one completely.
    pub fn holds(&self, other: &Self) -> bool {
        other.left >= self.left
            && other.right <= self.right
            && other.top >= self.top
            && other.bottom <= self.bottom
    }

    /// Returns whether a rectangle on the page of a drawing contains a point.
    pub fn contains(&self, p: Point) -> bool {
        (self.left..=self.right).contains(&p.0) && (self.top..=self.bottom).contains(&p.1)
    }
}

/// Horizontal alignment of a text relative to its position in a drawing (SVG `text-anchor`). Vertically, the digits
/// of a text are centred on its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Anchor {
    /// Text alignment in a drawing: the text starts at its position.
    Start,
    /// Text alignment in a drawing: the text is centred at its position.
    Middle,
    /// Text alignment in a drawing: the text ends at its position.
    End,
}

/// Default resolution at which a [`Drawing`] becomes a bitmap, pixels per point.
pub const PIXELS_PER_POINT: u32 = 2;
/// Font family of a drawing in SVG. Bitmaps and PDF files use its first font, which is compiled into the program.
const FONT_FAMILY: &str = "Ubuntu, Helvetica, Arial, sans-serif";
/// Half the height of a digit as a fraction of the font size, for the vertical centring of text in drawings.
const HALF_DIGIT: f64 = 0.35;

/// Drawing of one page: vector shapes in drawing order, with raster pictures behind all shapes.
#[derive(Debug, Clone)]
pub struct Drawing {
    width: f64,
    height: f64,
    ground: Rgb,
    shapes: String,
    pictures: Vec<(Rect, RgbImage)>,
}

impl Drawing {
    /// Creates an empty drawing with a white background; width and height are in points.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, ground: WHITE, shapes: String::new(), pictures: Vec::new() }
    }

    /// Width and height of the drawing's page, points.
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

    /// Draws a path of straight line segments in a drawing; the line width is in points.
    pub fn line(&mut self, points: &[Point], width: f64, color: Rgb) {
        self.stroke(points, width, color, None);
    }

    /// Draws a dashed path with the given dash and gap lengths in points; the pattern continues around corners.
    pub fn dashed(&mut self, path: &[Point], width: f64, color: Rgb, [dash, gap]: [f64; 2]) {
        self.stroke(path, width, color, Some(format!("{dash} {gap}")));
    }

    fn stroke(&mut self, path: &[Point], width: f64, color: Rgb, dashes: Option<String>) {
        self.add(html! {
            polyline points=(list(path)) fill="none" stroke=(hex(color)) stroke-width=(width)
                stroke-linejoin="round" stroke-dasharray=[dashes] {}
        });
    }

    /// Draws the outline of a rectangle in a drawing; the line width is in points.
    pub fn outline(&mut self, r: Rect, width: f64, color: Rgb) {
        let [a, b, c, d] = r.corners();
        self.line(&[a, b, c, d, a], width, color);
    }

    /// Fills the interior of a polygon in a drawing with a colour.
    pub fn polygon(&mut self, points: &[Point], color: Rgb) {
        self.add(html! { polygon points=(list(points)) fill=(hex(color)) {} });
    }

    /// Draws a horizontal text in a drawing; the font size is in points.
    pub fn text(&mut self, at: Point, anchor: Anchor, size: f64, color: Rgb, text: &str) {
        self.letters(at, anchor, size, color, text, None);
    }

    /// Draws a text in a drawing, rotated to read upwards and centred at its position.
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
        // XML does not allow control characters.
        let text = text.replace(char::is_control, "\u{fffd}");
        self.add(html! {
            text x=(short(at.0)) y=(short(at.1 + HALF_DIGIT * size)) text-anchor=(anchor) font-size=(size)
                fill=(hex(color)) transform=[turn] { (text) }
        });
    }

    /// Adds a raster picture to the drawing, stretched to fill the rectangle `place`.
    pub fn picture(&mut self, place: Rect, picture: RgbImage) {
        self.pictures.push((place, picture));
    }

    /// Returns the drawing as an SVG document without its raster pictures. With `about` it is an SVG element for an
    /// HTML page, and `about` is its accessible label.
    pub fn svg(&self, about: Option<&str>) -> Markup {
        self.document(about, html! { rect width="100%" height="100%" fill=(hex(self.ground)) {} })
    }

    /// Returns the drawing as an SVG document: first the given markup of the background, then the vector shapes.
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

    /// Renders the drawing as a bitmap at the default resolution [`PIXELS_PER_POINT`].
    ///
    /// # Errors
    /// The drawing is too large for a bitmap.
    pub fn bitmap(&self) -> Result<RgbImage> {
        self.bitmap_of(f64::from(PIXELS_PER_POINT))
    }

    /// Renders the drawing as a bitmap at a given resolution in pixels per point. Raster pictures are resampled to
    /// the size at which the drawing shows them.
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
            // Enlarging keeps sharp pixels; reducing averages all pixels.
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

    /// Returns the drawing as the bytes of a PNG file, at the default resolution [`PIXELS_PER_POINT`].
    ///
    /// # Errors
    /// See [`Self::bitmap`].
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.bitmap()?)
    }
}

impl Drawing {
    /// Returns the drawing as the bytes of a one-page PDF file. Text stays text in an embedded font, and raster
    /// pictures keep every pixel.
    ///
    /// # Errors
    /// The drawing cannot be converted.
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

/// Rounds a coordinate of a drawing to 0.01 points.
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

/// Width of a text in points at a font size, in the font of the plots.
pub fn text_width(text: &str, size: f64) -> f64 {
    // The font is compiled in and valid.
    let Ok(font) = FontRef::new(epaint_default_fonts::UBUNTU_LIGHT) else { return 0.0 };
    let (letters, widths) =
        (font.charmap(), font.glyph_metrics(Size::new(size as f32), LocationRef::default()));
    let width = |c| widths.advance_width(letters.map(c).unwrap_or_default()).unwrap_or_default();
    text.chars().map(|c| f64::from(width(c))).sum()
}

/// Encodes an 8-bit RGB picture as the bytes of a PNG file.
///
/// # Errors
/// The PNG encoder fails.
pub fn encode_png(picture: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|e| Error::runtime("cannot encode picture", "PNG", e))?;
    Ok(bytes.into_inner())
}

/// Converts a linear RGBA picture to an 8-bit sRGB picture without its opacity channel.
pub fn srgb_picture(picture: &Array3<f32>) -> RgbImage {
    let (height, width, _) = picture.dim();
    RgbImage::from_fn(width as u32, height as u32, |column, row| {
        image::Rgb(
            [0, 1, 2].map(|c| srgb8_from_linear(f64::from(picture[[row as usize, column as usize, c]]))),
        )
    })
}
