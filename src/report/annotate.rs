//! Marks on a picture: directions of the patient, a scale bar, and the colours of the transfer function.

use super::canvas::{Anchor, Drawing, Point, Rect, Rgb, srgb_picture, text_width};
use super::number::{significant, trimmed};
use crate::error::Result;
use crate::files::color::srgb8_from_linear;
use crate::scene::{Scene, anatomical_marks};
use crate::transfer::TransferFunction;
use image::RgbImage;
use ndarray::Array3;

/// Height of the text as a share of the smaller side of the picture, and its limits in pixels.
const TEXT_SHARE: f64 = 1.0 / 30.0;
const TEXT_PX: [f64; 2] = [9.0, 32.0];
/// Largest share of the picture's width that the scale bar takes.
const SCALE_BAR_SHARE: f64 = 0.25;
/// Luminance of the background from which on marks are dark.
const BRIGHT: f64 = 0.18;
const DARK_MARKS: Rgb = [20, 20, 20];
const BRIGHT_MARKS: Rgb = [235, 235, 235];
/// Number of rectangles of the colour bar.
const COLOUR_STEPS: u32 = 128;

/// Returns the picture of a scene with marks. The letters at its edges are directions of the patient (`L`, `PS`). The
/// length of the scale bar holds at the distance of the camera's target. The colour bar covers the scalar values of
/// `value_range` between which the transfer function has its points.
///
/// # Errors
/// The picture is too large for a drawing.
pub fn annotated(
    picture: &Array3<f32>,
    scene: &Scene,
    (tf, value_range): (&TransferFunction, [f64; 2]),
) -> Result<RgbImage> {
    let image = srgb_picture(picture);
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let whole = Rect { left: 0.0, top: 0.0, right: width, bottom: height };
    let mut drawing = Drawing::new(width, height);
    drawing.picture(whole, image);
    let [r, g, b] = scene.background;
    let is_bright = 0.2126 * r + 0.7152 * g + 0.0722 * b > BRIGHT;
    let mut marks = Marks {
        drawing,
        whole,
        size: (TEXT_SHARE * width.min(height)).clamp(TEXT_PX[0], TEXT_PX[1]),
        color: if is_bright { DARK_MARKS } else { BRIGHT_MARKS },
    };
    marks.directions(scene);
    marks.scale_bar(scene);
    marks.colour_bar(tf, value_range);
    marks.drawing.bitmap_of(1.0)
}

/// Drawing with marks, in pixels.
struct Marks {
    drawing: Drawing,
    whole: Rect,
    /// Height of the text.
    size: f64,
    color: Rgb,
}

impl Marks {
    fn text(&mut self, at: Point, anchor: Anchor, text: &str) {
        self.drawing.text(at, anchor, self.size, self.color, text);
    }

    fn directions(&mut self, scene: &Scene) {
        let frame = scene.camera.frame();
        let Point(x, y) = self.whole.middle();
        let (near, Rect { right, bottom, .. }) = (self.size, self.whole);
        self.text(Point(right - near, y), Anchor::End, &anatomical_marks(frame.right));
        self.text(Point(near, y), Anchor::Start, &anatomical_marks(-frame.right));
        self.text(Point(x, near), Anchor::Middle, &anatomical_marks(frame.up));
        self.text(Point(x, bottom - near), Anchor::Middle, &anatomical_marks(-frame.up));
    }

    fn scale_bar(&mut self, scene: &Scene) {
        let camera = &scene.camera;
        let distance_mm = camera.eye.distance(camera.target);
        let pixel_mm = 2.0 * distance_mm * (0.5 * camera.fov_deg.to_radians()).tan() / self.whole.bottom;
        let length_mm = round_length(SCALE_BAR_SHARE * self.whole.right * pixel_mm);
        let (left, y) = (self.size, self.whole.bottom - self.size);
        let right = left + length_mm / pixel_mm;
        let thick = (0.15 * self.size).max(1.0);
        self.drawing.line(&[Point(left, y), Point(right, y)], thick, self.color);
        for x in [left, right] {
            self.drawing.line(&[Point(x, y - 0.4 * self.size), Point(x, y)], thick, self.color);
        }
        let label = format!("{} mm", number(length_mm));
        self.text(Point(0.5 * (left + right), y - self.size), Anchor::Middle, &label);
    }

    fn colour_bar(&mut self, tf: &TransferFunction, [least, largest]: [f64; 2]) {
        let values = || tf.points.iter().map(|point| point.value.clamp(least, largest));
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        if low >= high {
            return;
        }
        let (right, bottom) = (self.whole.right - self.size, self.whole.bottom - self.size);
        let bar = Rect {
            left: right - SCALE_BAR_SHARE * self.whole.right,
            top: bottom - 1.9 * self.size,
            right,
            bottom: bottom - 1.2 * self.size,
        };
        for i in 0..COLOUR_STEPS {
            let share = f64::from(i) / f64::from(COLOUR_STEPS);
            let color = tf.color(low + (share + 0.5 / f64::from(COLOUR_STEPS)) * (high - low));
            // Each step extends to the end and is covered by the next one: adjacent edges would show the background.
            let step = Rect { left: bar.left + share * (bar.right - bar.left), ..bar };
            self.drawing.polygon(&step.corners(), color.map(srgb8_from_linear));
        }
        self.drawing.outline(bar, 1.0, self.color);
        let units = if tf.units.is_empty() { String::new() } else { format!(" {}", tf.units) };
        let [low, high] = [number(low), number(high) + &units];
        self.text(Point(bar.left, bottom - 0.3 * self.size), Anchor::Start, &low);
        // Two numbers that meet would be read as one.
        if text_width(&low, self.size) + text_width(&high, self.size) + self.size < bar.right - bar.left {
            self.text(Point(bar.right, bottom - 0.3 * self.size), Anchor::End, &high);
        }
    }
}

/// Returns the largest of the lengths 1, 2 and 5 times a power of ten that is at most `most`.
fn round_length(most: f64) -> f64 {
    let power = 10f64.powf(most.log10().floor());
    [5.0, 2.0].map(|factor| factor * power).into_iter().find(|length| *length <= most).unwrap_or(power)
}

/// Formats a number with three significant digits and without zeros at its end.
fn number(x: f64) -> String {
    trimmed(&significant(x, 3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;
    use crate::transfer::presets::PRESETS;

    #[test]
    fn scale_bars_have_round_lengths() {
        for (most, expected) in
            [(0.7, 0.5), (1.0, 1.0), (19.9, 10.0), (20.0, 20.0), (499.0, 200.0), (5e3, 5e3)]
        {
            assert!((round_length(most) / expected - 1.0).abs() < 1e-12, "{most}");
        }
        assert_eq!([number(200.0), number(0.5), number(-980.0)], ["200", "0.5", "-980"]);
    }

    #[test]
    fn marks_change_their_places_alone() {
        let volume = Phantom::Thorax.build(16).unwrap();
        let scene = Scene { width: 320, height: 240, ..Scene::framing(&volume) };
        let picture = Array3::zeros((240, 320, 4));
        let tf = PRESETS[0].transfer_function();
        let marked = annotated(&picture, &scene, (&tf, volume.value_range())).unwrap();
        assert_eq!(marked.dimensions(), (320, 240));
        let is_marked = |x: std::ops::Range<u32>, y: std::ops::Range<u32>| {
            y.flat_map(|y| x.clone().map(move |x| (x, y))).any(|(x, y)| marked.get_pixel(x, y).0 != [0; 3])
        };
        // Middle, four edges, scale bar and colour bar.
        assert!(!is_marked(60..260, 40..180));
        let marks = [(0..40, 100..140), (280..320, 100..140), (140..180, 0..30), (140..180, 215..240)];
        assert!(marks.into_iter().all(|(x, y)| is_marked(x, y)));
        assert!(is_marked(5..90, 200..240) && is_marked(230..320, 200..240));
    }
}
