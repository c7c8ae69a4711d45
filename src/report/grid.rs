//! All pictures of a scene beside each other, under each where it is wrong, with one colour bar for all.

use super::canvas::{Anchor, BLACK, Drawing, PIXELS_PER_POINT, Point, WHITE, encode_png, text_width};
use super::heat::{false_colour, with_legend};
use crate::error::Result;
use crate::files::color::srgb8_from_linear;
use image::imageops::{self, FilterType};
use image::{Rgb, RgbImage};
use ndarray::{Array2, Array3};

/// Pictures are shown no wider than this, and no narrower than the other.
const WIDEST_PX: u32 = 360;
const NARROWEST_PX: u32 = 220;
/// Columns of the sheet.
const MOST_ACROSS: usize = 4;
const GAP_PX: u32 = 12;
const TEXT: f64 = 9.5;
const LINE: f64 = 12.5;

/// A picture with what is said above it.
#[derive(Debug, Clone)]
pub struct Shown<'a> {
    /// Method and settings, `METHOD:key=value,...`.
    pub label: String,
    /// `height x width x 4`, linear RGBA.
    pub picture: &'a Array3<f32>,
    /// `height x width`, not negative; none where the picture is what others differ from.
    pub difference: Option<&'a Array2<f32>>,
}

/// The sheet as a PNG file: black is no difference, the end of the colour bar is `max`, which `label` says the meaning of.
///
/// # Errors
/// The drawing backend's own.
pub fn png(shown: &[Shown], max: f32, label: &str) -> Result<Vec<u8>> {
    encode_png(&with_legend(&sheet(shown, max)?, max, label)?)
}

fn sheet(shown: &[Shown], max: f32) -> Result<RgbImage> {
    let size = |s: &Shown| (s.picture.dim().1 as u32, s.picture.dim().0 as u32);
    let (width, height) = shown.iter().map(size).next().unwrap_or((1, 1));
    let cell_width = width.clamp(NARROWEST_PX, WIDEST_PX);
    let cell_height = (u64::from(cell_width) * u64::from(height) / u64::from(width.max(1))).max(1) as u32;
    let labels: Vec<Vec<String>> = shown.iter().map(|s| lines(&s.label, points(cell_width))).collect();
    let label_height = labels.iter().map(Vec::len).max().unwrap_or(0) as f64 * LINE + 2.0;
    let label_px = (label_height * f64::from(PIXELS_PER_POINT)).ceil() as u32;
    let across = shown.len().clamp(1, MOST_ACROSS);
    let down = shown.len().div_ceil(across).max(1);
    let (column, row) = (cell_width + GAP_PX, label_px + 2 * cell_height + GAP_PX / 3 + GAP_PX);
    let mut sheet =
        RgbImage::from_pixel(across as u32 * column + GAP_PX, down as u32 * row + GAP_PX, Rgb(WHITE));
    for (i, (s, lines)) in shown.iter().zip(&labels).enumerate() {
        let left = i64::from(GAP_PX + (i % across) as u32 * column);
        let top = i64::from(GAP_PX + (i / across) as u32 * row);
        let words = words(lines, points(cell_width), points(label_px))?;
        imageops::replace(&mut sheet, &words, left, top);
        let fitted = |picture: &RgbImage| {
            // Enlarged, a pixel stays one; made smaller, none is dropped.
            let filter =
                if cell_width >= picture.width() { FilterType::Nearest } else { FilterType::Triangle };
            imageops::resize(picture, cell_width, cell_height, filter)
        };
        let below = top + i64::from(label_px);
        imageops::replace(&mut sheet, &fitted(&encoded(s.picture)), left, below);
        if let Some(difference) = s.difference {
            let lower = below + i64::from(cell_height + GAP_PX / 3);
            imageops::replace(&mut sheet, &fitted(&false_colour(difference, max)), left, lower);
        }
    }
    Ok(sheet)
}

/// As a PNG file of the picture has it.
fn encoded(picture: &Array3<f32>) -> RgbImage {
    let (height, width, _) = picture.dim();
    RgbImage::from_fn(width as u32, height as u32, |column, row| {
        Rgb([0, 1, 2].map(|c| srgb8_from_linear(f64::from(picture[[row as usize, column as usize, c]]))))
    })
}

fn points(pixels: u32) -> f64 {
    f64::from(pixels) / f64::from(PIXELS_PER_POINT)
}

fn words(lines: &[String], width: f64, height: f64) -> Result<RgbImage> {
    let mut drawing = Drawing::new(width, height);
    for (i, line) in lines.iter().enumerate() {
        let place = Point(0.0, (i as f64 + 0.5) * LINE);
        drawing.text(place, Anchor::Start, TEXT, BLACK, line);
    }
    drawing.bitmap()
}

/// Method and settings in lines no wider than `width` points, broken where a setting ends; a setting that is wider
/// itself has a line of its own.
fn lines(label: &str, width: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    for part in label.split_inclusive([':', ',']) {
        // There is always a last line.
        let last = lines.len() - 1;
        let longer = format!("{}{part}", lines[last]);
        if lines[last].is_empty() || text_width(longer.trim_end_matches(','), TEXT) <= width {
            lines[last] = longer;
        } else {
            lines.push(part.to_owned());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_broken_between_settings() {
        assert_eq!(lines("none", 100.0), ["none"]);
        let label = "dsm:epsilon=0.06,prefilter=5,map=512";
        let broken = lines(label, 90.0);
        assert!(broken.len() > 1 && broken.iter().all(|l| text_width(l, TEXT) <= 93.0), "{broken:?}");
        assert_eq!(broken.concat(), label);
    }

    #[test]
    fn each_picture_has_its_difference_below_on_the_one_scale() {
        let picture = |grey: f32| Array3::from_elem((30, 40, 4), grey);
        let (dark, bright) = (picture(0.0), picture(1.0));
        let (half, full) = (Array2::from_elem((30, 40), 0.05), Array2::from_elem((30, 40), 0.1));
        let shown = [
            Shown { label: "rays".into(), picture: &bright, difference: None },
            Shown { label: "osm:map=256".into(), picture: &dark, difference: Some(&half) },
            Shown { label: "osm:map=512".into(), picture: &dark, difference: Some(&full) },
        ];
        let sheet = sheet(&shown, 0.1).unwrap();
        let column = NARROWEST_PX + GAP_PX;
        let label_px = ((LINE + 2.0) * f64::from(PIXELS_PER_POINT)).ceil() as u32;
        let height = NARROWEST_PX * 30 / 40;
        let at = |i: u32, y: u32| *sheet.get_pixel(GAP_PX + i * column + 50, GAP_PX + label_px + y);
        assert_eq!((at(0, 5), at(1, 5)), (Rgb(WHITE), Rgb(BLACK)));
        let lower = height + GAP_PX / 3 + 5;
        assert_eq!(at(0, lower), Rgb(WHITE), "the reference has no difference");
        assert_eq!([at(1, lower), at(2, lower)], [0.5, 1.0].map(super::super::heat::inferno));
        assert!(png(&[], 1.0, "").is_ok());
    }
}
