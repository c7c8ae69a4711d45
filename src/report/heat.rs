//! Converts arrays of rendering errors and picture differences to false-colour images with a colour bar as legend.

use super::canvas::{Anchor, BLACK, Drawing, INK, PIXELS_PER_POINT, Point, Rect, encode_png, text_width};
use super::number::{significant, trimmed};
use crate::error::Result;
use image::{Rgb, RgbImage};
use ndarray::Array2;

/// Colour of NaN values in false-colour images, distinct from every colour of the `inferno` colour map.
const NOT_A_NUMBER: Rgb<u8> = Rgb([0, 255, 0]);

/// Returns the colour of the `inferno` colour map (Smith and van der Walt 2015) at a position from 0 to 1. Positions
/// outside are clamped. Its lightness rises evenly, so equal steps of error look equal, also in grey print and to
/// colour-blind readers. Black is zero error.
pub fn inferno(share: f64) -> Rgb<u8> {
    Rgb(colorous::INFERNO.eval_continuous(share).as_array())
}

/// Converts an array of errors, `height x width`, to a false-colour image from 0 (black) to `max` (pale yellow).
/// Larger values are shown as `max`, NaN in green. If `max` is not positive, every positive value has the colour of
/// `max`.
pub fn false_colour(values: &Array2<f32>, max: f32) -> RgbImage {
    let (height, width) = values.dim();
    RgbImage::from_fn(width as u32, height as u32, |column, row| {
        let value = values[[row as usize, column as usize]];
        if value.is_nan() {
            NOT_A_NUMBER
        } else if value <= 0.0 {
            inferno(0.0)
        } else {
            // A `max` of 0 gives infinity, the end of the colour map.
            inferno(f64::from(value) / f64::from(max.max(0.0)))
        }
    })
}

/// Returns the upper end of a colour bar for an array of errors: the largest finite value, rounded up to 1, 2 or 5
/// times a power of ten. Returns `None` if no value is above 0.
pub fn round_max(values: &Array2<f32>) -> Option<f32> {
    let largest = values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max);
    let largest = Some(f64::from(largest)).filter(|largest| *largest > 0.0)?;
    let decade = 10_f64.powf(largest.log10().floor());
    let step = [1.0, 2.0, 5.0].into_iter().find(|m| m * decade >= largest * (1.0 - 1e-6)).unwrap_or(10.0);
    Some((step * decade) as f32)
}

const LEGEND_HEIGHT_PX: u32 = 98;
const LEGEND_MIN_WIDTH_PX: u32 = 420;

/// Adds a colour bar with numbers from 0 to `max` below a false-colour image. `label` is the title of the bar. An
/// image narrower than the colour bar is centred over it.
///
/// # Errors
/// The image cannot be drawn or encoded.
pub fn with_legend(picture: &RgbImage, max: f32, label: &str) -> Result<RgbImage> {
    let points = |px: u32| f64::from(px) / f64::from(PIXELS_PER_POINT);
    let width = points(picture.width().max(LEGEND_MIN_WIDTH_PX));
    let (wide, high) = (points(picture.width()), points(picture.height()));
    let mut page = Drawing::new(width, high + points(LEGEND_HEIGHT_PX));
    // Whole pixels, so that the picture is not resampled.
    let left = points(((width - wide) / points(1) / 2.0) as u32);
    page.picture(Rect { left, top: 0.0, right: left + wide, bottom: high }, picture.clone());
    let bar = Rect { left: 24.0, top: high + 6.0, right: width - 24.0, bottom: high + 17.0 };
    colour_bar(&mut page, bar, max, label, 11.5);
    page.bitmap()
}

/// Draws the colour bar of a false-colour image from 0 to `max`, with numbers and the title `label` below it. `size`
/// is the font size in points. The total height is [`bar_height`].
pub(super) fn colour_bar(drawing: &mut Drawing, bar: Rect, max: f32, label: &str, size: f64) {
    let Rect { left, top, right, bottom } = bar;
    const STEPS: u32 = 256;
    for i in 0..STEPS {
        // Each step extends to the end and is covered by the next one: adjacent edges would show the background.
        let step = Rect { left: left + (right - left) * f64::from(i) / f64::from(STEPS), top, right, bottom };
        let Rgb(color) = inferno((f64::from(i) + 0.5) / f64::from(STEPS));
        drawing.polygon(&step.corners(), color);
    }
    const TICKS: u32 = 4;
    for i in 0..=TICKS {
        let share = f64::from(i) / f64::from(TICKS);
        let x = left + (right - left) * share;
        drawing.line(&[Point(x, bottom), Point(x, bottom + 3.0)], 0.8, INK);
        let number = trimmed(&significant(f64::from(max) * share, 3));
        let text = if i == TICKS { format!("≥ {number}") } else { number };
        // The last number may reach a little over the bar, to the border of a legend, but not over that.
        let x = x.min(right + 22.0 - 0.5 * text_width(&text, size));
        drawing.text(Point(x, bottom + 0.87 * size), Anchor::Middle, size, INK, &text);
    }
    let below = Point(0.5 * (left + right), bottom + 2.0 * size);
    drawing.text(below, Anchor::Middle, size, BLACK, label);
}

/// Height of a colour bar together with the numbers and the title below it, points.
pub(super) fn bar_height(bar_height: f64, size: f64) -> f64 {
    bar_height + 2.6 * size
}

/// Returns an array of errors as a false-colour PNG file with a colour bar from 0 to `max`; `label` is the title of
/// the bar.
///
/// # Errors
/// The image cannot be drawn or encoded.
pub fn heat_map_png(values: &Array2<f32>, max: f32, label: &str) -> Result<Vec<u8>> {
    encode_png(&with_legend(&false_colour(values, max), max, label)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::imageops;

    #[test]
    fn the_scale_is_matplotlibs_inferno_and_its_lightness_rises() {
        // Values of matplotlib 3.11's table at 0, 64, 128, 192 and 255.
        let table = [[0, 0, 4], [87, 16, 110], [188, 55, 84], [249, 142, 9], [252, 255, 164]];
        for (i, expected) in [0.0, 64.0, 128.0, 192.0, 255.0].into_iter().zip(table) {
            // The crate cuts off what matplotlib rounds.
            let Rgb(color) = inferno(i / 255.0);
            assert!(color.iter().zip(expected).all(|(a, b): (_, u8)| a.abs_diff(b) <= 1), "{i}: {color:?}");
        }
        let luminance = |Rgb([r, g, b]): Rgb<u8>| {
            let linear = |c: u8| (f64::from(c) / 255.0).powf(2.2);
            0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
        };
        let rising: Vec<f64> = (0..=20).map(|i| luminance(inferno(f64::from(i) / 20.0))).collect();
        assert!(rising.is_sorted(), "{rising:?}");
    }

    #[test]
    fn values_become_colours_in_place() {
        let values = ndarray::arr2(&[[0.0, 0.05, 0.1], [7.0, f32::NAN, -1.0]]);
        let picture = false_colour(&values, 0.1);
        assert_eq!(picture.dimensions(), (3, 2));
        assert_eq!(*picture.get_pixel(0, 0), inferno(0.0));
        assert_eq!(*picture.get_pixel(1, 0), inferno(0.5));
        assert_eq!(*picture.get_pixel(2, 0), inferno(1.0));
        assert_eq!(*picture.get_pixel(0, 1), inferno(1.0));
        assert_eq!(*picture.get_pixel(1, 1), NOT_A_NUMBER);
        assert_eq!(*picture.get_pixel(2, 1), inferno(0.0));
        // A scale of no length: what is wrong at all is as wrong as can be.
        let flat = false_colour(&values, 0.0);
        assert_eq!((*flat.get_pixel(0, 0), *flat.get_pixel(1, 0)), (inferno(0.0), inferno(1.0)));
    }

    #[test]
    fn scales_end_at_round_numbers() {
        let of = |v: f32| round_max(&ndarray::arr2(&[[0.0, v], [f32::NAN, f32::INFINITY]]));
        for (largest, expected) in [(0.043, 0.05), (0.05, 0.05), (0.11, 0.2), (0.9, 1.0), (1e-6, 1e-6)] {
            let end = of(largest).unwrap();
            assert!((end / expected - 1.0).abs() < 1e-6, "{largest}: {end}");
        }
        assert_eq!(of(0.0), None);
    }

    #[test]
    fn a_legend_is_added_below_and_the_picture_is_untouched() {
        let values = Array2::from_shape_fn((30, 500), |(_, column)| column as f32 / 499.0);
        let picture = false_colour(&values, 1.0);
        let page = with_legend(&picture, 1.0, "|T_method − T_exact|").unwrap();
        assert_eq!(page.dimensions(), (500, 30 + LEGEND_HEIGHT_PX));
        assert_eq!(imageops::crop_imm(&page, 0, 0, 500, 30).to_image(), picture);
        let legend = imageops::crop_imm(&page, 0, 30, 500, LEGEND_HEIGHT_PX).to_image();
        let has = |color: Rgb<u8>| legend.pixels().any(|p| *p == color);
        assert!(has(inferno(0.5 / 256.0)) && has(inferno(255.5 / 256.0)), "both ends of the scale");
        assert!(has(Rgb(BLACK)), "letters");
        // A narrow picture is centred.
        let narrow = false_colour(&Array2::from_elem((10, 20), 1.0), 1.0);
        let page = with_legend(&narrow, 1.0, "").unwrap();
        assert_eq!(page.width(), LEGEND_MIN_WIDTH_PX);
        assert_eq!(*page.get_pixel(LEGEND_MIN_WIDTH_PX / 2, 5), inferno(1.0));
        assert_eq!(*page.get_pixel(5, 5), Rgb([255, 255, 255]));
    }

    #[test]
    fn the_file_is_a_png_that_reads_back() {
        let png = heat_map_png(&Array2::from_elem((64, 64), 0.5), 1.0, "error").unwrap();
        let size = image::load_from_memory(&png).unwrap().to_rgb8().dimensions();
        assert_eq!(size, (LEGEND_MIN_WIDTH_PX, 64 + LEGEND_HEIGHT_PX));
    }
}
