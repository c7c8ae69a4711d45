//! A list of shapes in points, painted by plotters' bitmap or SVG backend.

use crate::error::{Error, Result};
use plotters::coord::Shift;
use plotters::prelude::{
    BitMapBackend, DrawingArea, DrawingBackend, FontDesc, FontFamily, FontStyle, IntoDrawingArea,
    IntoTextStyle, PathElement, Polygon, RGBColor, SVGBackend,
};
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, register_font};
use std::sync::Once;

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

/// Which part of a text lies at its place; vertically it is always the middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

#[derive(Debug, Clone)]
enum Shape {
    Line { points: Vec<Point>, width: f64, color: Rgb },
    Polygon { points: Vec<Point>, color: Rgb },
    Text { at: Point, anchor: Anchor, size: f64, color: Rgb, text: String, upwards: bool },
}

/// Units of the backends a point: their coordinates are integers, so finer ones place things better.
const UNITS: f64 = 4.0;
/// Bitmaps are painted at [`UNITS`] pixels a point and averaged over squares of this side, which smooths edges.
const SMOOTHING: u32 = 2;
/// Of [`Drawing::bitmap`].
pub const PIXELS_PER_POINT: u32 = UNITS as u32 / SMOOTHING;

/// Shapes on a white page, later ones over earlier ones.
#[derive(Debug, Clone)]
pub struct Drawing {
    width: f64,
    height: f64,
    shapes: Vec<Shape>,
}

impl Drawing {
    /// An empty page of a size in points.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, shapes: Vec::new() }
    }

    pub fn line(&mut self, points: &[Point], width: f64, color: Rgb) {
        self.shapes.push(Shape::Line { points: points.to_vec(), width, color });
    }

    pub fn outline(&mut self, r: Rect, width: f64, color: Rgb) {
        let [a, b, c, d] = r.corners();
        self.line(&[a, b, c, d, a], width, color);
    }

    pub fn polygon(&mut self, points: Vec<Point>, color: Rgb) {
        self.shapes.push(Shape::Polygon { points, color });
    }

    /// A path in dashes and gaps of these lengths, running on around corners; a dash is one line however many corners
    /// it has.
    pub fn dashed(&mut self, path: &[Point], width: f64, color: Rgb, [dash, gap]: [f64; 2]) {
        let (mut drawing, mut left) = (true, dash);
        let mut line: Vec<Point> = path.first().copied().into_iter().collect();
        for pair in path.windows(2) {
            let (dx, dy) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
            let length = dx.hypot(dy);
            let mut done = 0.0;
            while length - done >= left {
                done += left;
                line.push(Point(pair[0].0 + dx * done / length, pair[0].1 + dy * done / length));
                if drawing {
                    self.line(&line, width, color);
                }
                line.drain(..line.len() - 1);
                drawing = !drawing;
                left = if drawing { dash } else { gap };
            }
            left -= length - done;
            if drawing {
                line.push(pair[1]);
            }
        }
        if drawing && line.len() > 1 {
            self.line(&line, width, color);
        }
    }

    pub fn text(&mut self, at: Point, anchor: Anchor, size: f64, color: Rgb, text: String) {
        self.shapes.push(Shape::Text { at, anchor, size, color, text, upwards: false });
    }

    /// Text that reads upwards, centred at its place.
    pub fn rotated_text(&mut self, at: Point, size: f64, color: Rgb, text: String) {
        self.shapes.push(Shape::Text { at, anchor: Anchor::Middle, size, color, text, upwards: true });
    }

    /// The page as an SVG document.
    ///
    /// # Errors
    /// The backend's own.
    pub fn svg(&self) -> Result<String> {
        let mut document = String::new();
        let (width, height) = self.units();
        let area = SVGBackend::with_string(&mut document, (width, height)).into_drawing_area();
        self.paint(&area, 0.09)?;
        drop(area);
        // The page has its size in points; the finer units stay inside, in the viewBox.
        Ok(document.replacen(
            &format!("width=\"{width}\" height=\"{height}\""),
            &format!("width=\"{}\" height=\"{}\"", self.width, self.height),
            1,
        ))
    }

    /// The page as a bitmap of [`PIXELS_PER_POINT`].
    ///
    /// # Errors
    /// The backend's own.
    pub fn bitmap(&self) -> Result<image::RgbImage> {
        let (width, height) = self.units();
        let mut fine = image::RgbImage::new(width, height);
        let area = BitMapBackend::with_buffer(&mut fine, (width, height)).into_drawing_area();
        self.paint(&area, 0.2)?;
        drop(area);
        let (width, height) = (width / SMOOTHING, height / SMOOTHING);
        Ok(image::imageops::thumbnail(&fine, width, height))
    }

    /// Page size in the backends' units, a multiple of [`SMOOTHING`].
    fn units(&self) -> (u32, u32) {
        let units = |length: f64| ((length * UNITS) as u32).next_multiple_of(SMOOTHING);
        (units(self.width), units(self.height))
    }

    /// `sink` is how much lower a text has to be put for its digits to be centred, in font sizes; the two backends
    /// take the middle of a line from different measures of the font.
    fn paint<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>, sink: f64) -> Result<()> {
        let failed = |e: &dyn std::fmt::Display| Error::runtime("cannot draw", "plot", e);
        let units = |p: &Point| ((p.0 * UNITS).round() as i32, (p.1 * UNITS).round() as i32);
        let rgb = |[r, g, b]: Rgb| RGBColor(r, g, b);
        area.fill(&rgb(WHITE)).map_err(|e| failed(&e))?;
        for shape in &self.shapes {
            match shape {
                Shape::Line { points, width, color } => {
                    let stroke = rgb(*color).stroke_width((width * UNITS).round().max(1.0) as u32);
                    let path = points.iter().map(units).collect::<Vec<_>>();
                    area.draw(&PathElement::new(path, stroke)).map_err(|e| failed(&e))?;
                }
                Shape::Polygon { points, color } => {
                    let path = points.iter().map(units).collect::<Vec<_>>();
                    area.draw(&Polygon::new(path, rgb(*color).filled())).map_err(|e| failed(&e))?;
                }
                Shape::Text { at, anchor, size, color, text, upwards } => {
                    let anchor = match anchor {
                        Anchor::Start => HPos::Left,
                        Anchor::Middle => HPos::Center,
                        Anchor::End => HPos::Right,
                    };
                    let Point(x, y) = *at;
                    let (turn, at) = if *upwards {
                        (FontTransform::Rotate270, Point(x + sink * size, y))
                    } else {
                        (FontTransform::None, Point(x, y + sink * size))
                    };
                    let color = rgb(*color);
                    let style = font(size * UNITS)
                        .transform(turn)
                        .into_text_style(area)
                        .color(&color)
                        .pos(Pos::new(anchor, VPos::Center));
                    area.draw_text(text, &style, units(&at)).map_err(|e| failed(&e))?;
                }
            }
        }
        area.present().map_err(|e| failed(&e))
    }
}

/// The family as SVG viewers see it; bitmaps are painted with the font registered under this name.
const FONT_FAMILY: &str = "Ubuntu, Helvetica, Arial, sans-serif";

fn font(size: f64) -> FontDesc<'static> {
    static REGISTER: Once = Once::new();
    REGISTER.call_once(|| {
        // It is compiled in and known to be a font; were it not, drawing text says so.
        let _ = register_font(FONT_FAMILY, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
    });
    FontDesc::new(FontFamily::Name(FONT_FAMILY), size, FontStyle::Normal)
}

/// Width of a text in points.
pub fn text_width(text: &str, size: f64) -> f64 {
    font(size * UNITS).box_size(text).map_or(0.0, |(width, _)| f64::from(width) / UNITS)
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
