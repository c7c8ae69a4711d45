//! Transfer functions in the formats of other programs: lists of opacities over 1 mm and of encoded sRGB colours, between
//! which those programs interpolate linearly.

use super::curve::{LimitSide, NodeCurve, linear};
use super::import::FRACTION;
use super::quantity::sample_amounts;
use super::sampling::{SamplePoint, Sampled};
use crate::files::color::srgb_from_linear;
use crate::transfer::{MAX_OPACITY, Quantity, TransferFunction};
use serde_json::json;

/// Text of a file, with warnings about what it does not hold of the function.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// Text of the file.
    pub text: String,
    /// One line each.
    pub warnings: Vec<String>,
}

/// Tolerance of an opacity between two points: relative, and absolute near 0.
const OPACITY_SHARE: f64 = 1e-3;
const OPACITY_LEAST: f64 = 1e-6;
/// Tolerance of a colour: a quarter of a step of 8 bits.
const COLOR_TOLERANCE: f64 = 0.25 / 255.0;
/// Smallest errors that cause a warning: relative for opacities, in steps of 8 bits for colours.
pub(super) const OPACITY_WARNING: f64 = 0.01;
pub(super) const COLOR_WARNING: f64 = 1.0;
/// Limit on the points of a list; ParaView's editor shows each as a handle.
const MOST_POINTS: usize = 1000;
/// Longest line that 3D Slicer reads; behind a longer one it loses the lines that follow.
const MOST_LINE: usize = 1023;

/// Opacities over 1 mm, and colours.
struct Lists {
    opacity: Vec<SamplePoint<1>>,
    color: Vec<SamplePoint<3>>,
    warnings: Vec<String>,
}

impl Lists {
    /// Samples a function with limits on the points of both lists.
    fn of(tf: &TransferFunction, most: [usize; 2]) -> Self {
        let colors = NodeCurve::through(tf.points.iter().map(|p| (p.value, p.color)));
        let color = |value: f64, side: LimitSide| colors.at(value, side).map(srgb_from_linear);
        let opacity_error = |want: &[f64; 1], got: &[f64; 1]| {
            (want[0] - got[0]).abs() / (OPACITY_LEAST + OPACITY_SHARE * want[0])
        };
        let color_error = |want: &[f64; 3], got: &[f64; 3]| {
            (0..3).map(|c| (want[c] - got[c]).abs()).fold(0.0, f64::max) / COLOR_TOLERANCE
        };
        let like = TransferFunction::new(Quantity::Opacity, &[]);
        let (opacity, opacity_worst) = sample_amounts(tf, &like, most[0], &opacity_error);
        let sampled = Sampled { breaks: tf.point_values(), at: &color, between: linear, error: &color_error };
        let (color, color_worst) = sampled.points(most[1]);
        let mut warnings = Vec::new();
        let mut warn = |error: f64, least: f64, text: String| {
            if error > least {
                warnings.push(text);
            }
        };
        let (share, steps) = (opacity_worst * OPACITY_SHARE, color_worst * COLOR_TOLERANCE * 255.0);
        let percent = 100.0 * share;
        let reason = "there is no room for more points";
        let text = format!("opacities are off by up to {percent:.1} % of themselves: {reason}");
        warn(share, OPACITY_WARNING, text);
        warn(steps, COLOR_WARNING, format!("colours are off by up to {steps:.1} of 255 steps: {reason}"));
        let (densest, most) = (tf.max_extinction(f64::NEG_INFINITY, f64::INFINITY), -(-MAX_OPACITY).ln_1p());
        let reason = format!("is more than an opacity over 1 mm can express: {most:.4} is used");
        let text = format!("an extinction of {densest:.4} per mm {reason}");
        warn(densest, most * (1.0 + 1e-9), text);
        Self { opacity, color, warnings }
    }
}

/// Separates the two points of a jump by the last digit: the programs keep one point a value.
fn separated<const N: usize>(mut points: Vec<SamplePoint<N>>) -> Vec<SamplePoint<N>> {
    for i in 1..points.len() {
        if points[i - 1].0 == points[i].0 {
            points[i - 1].0 = points[i - 1].0.next_down();
        }
    }
    points
}

/// Extends a list to both ends of a range, and to at least two points.
fn extended<const N: usize>(mut points: Vec<SamplePoint<N>>, range: Option<[f64; 2]>) -> Vec<SamplePoint<N>> {
    if let Some([low, high]) = range {
        let (first, last) = (points[0], points[points.len() - 1]);
        if first.0 > low {
            points.insert(0, (low, first.1));
        }
        if last.0 < high {
            points.push((high, last.1));
        }
    }
    if let [only] = points[..] {
        points.push((only.0 + 1.0, only.1));
    }
    points
}

/// Whether values are fractions of a volume's range.
pub fn has_fractions(tf: &TransferFunction) -> bool {
    tf.units.eq_ignore_ascii_case(FRACTION)
}

/// Writes ParaView's JSON.
///
/// # Errors
/// None; the signature is that of all formats.
pub fn paraview(tf: &TransferFunction) -> Result<Written, String> {
    let Lists { opacity, color, mut warnings } = Lists::of(tf, [MOST_POINTS; 2]);
    let (first, last) = (tf.points[0].value, tf.points[tf.points.len() - 1].value);
    let range = if has_fractions(tf) {
        Some([first.min(0.0), last.max(1.0)])
    } else {
        warnings.push("ParaView maps it to the data's range unless `Use preset range` is chosen".into());
        // Exactly these ranges are read as fractions; one more value avoids that.
        [[0.0, 1.0], [-1.0, 1.0]].contains(&[first, last]).then_some([first, last + 1.0])
    };
    let opacity = extended(separated(opacity), range);
    let color = extended(separated(color), range);
    let map = json!([{
        "ColorSpace": "RGB",
        "Name": tf.name,
        "Points": opacity.iter().flat_map(|(v, [o])| [*v, *o, 0.5, 0.0]).collect::<Vec<f64>>(),
        "RGBPoints": color.iter().flat_map(|(v, [r, g, b])| [*v, *r, *g, *b]).collect::<Vec<f64>>(),
    }]);
    warnings.push("opacities are over 1 mm: set Scalar Opacity Unit Distance to 1".into());
    let text = serde_json::to_string_pretty(&map).map_err(|e| e.to_string())? + "\n";
    Ok(Written { text, warnings })
}

/// Writes 3D Slicer's `.vp`.
///
/// # Errors
/// The function's values are fractions of a range, which the format cannot express.
pub fn vp(tf: &TransferFunction) -> Result<Written, String> {
    if has_fractions(tf) {
        let why = "its values are fractions of a volume's range, and a .vp holds values: give --range LO,HI";
        return Err(why.into());
    }
    let mut most = [MOST_POINTS; 2];
    loop {
        let Lists { opacity, color, warnings } = Lists::of(tf, most);
        let (opacity, color) = (extended(separated(opacity), None), extended(separated(color), None));
        let lines = [line(&opacity), line(&color)];
        let mut is_long = false;
        for (i, points) in [opacity.len(), color.len()].into_iter().enumerate() {
            if lines[i].len() > MOST_LINE && points > 2 {
                most[i] = (points * MOST_LINE / lines[i].len()).min(points - 1).max(2);
                is_long = true;
            }
        }
        if !is_long {
            // Trilinear, shaded like Slicer's own presets, and no opacity by the gradient.
            let text = format!("1\n1\n0.9\n0.1\n0.2\n10\n{}\n4 0 1 255 1\n{}\n", lines[0], lines[1]);
            return Ok(Written { text, warnings });
        }
    }
}

/// Line of a `.vp`: the count of numbers, then value and amounts of each point.
fn line<const N: usize>(points: &[SamplePoint<N>]) -> String {
    let mut text = (points.len() * (N + 1)).to_string();
    for (value, amounts) in points {
        text += &format!(" {value}");
        amounts.iter().for_each(|x| text += &format!(" {}", digits(*x)));
    }
    text
}

/// Number with five significant digits, without zeros at the end.
fn digits(x: f64) -> String {
    if x != 0.0 && x.abs() < 0.01 {
        return format!("{x:.4e}");
    }
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
