//! Writes transfer functions in the formats of other programs, as lists of opacities over 1 mm and of gamma-encoded
//! sRGB colours. The other programs interpolate linearly between the entries of a list.

use super::curve::{LimitSide, NodeCurve, linear};
use super::import::FRACTION;
use super::quantity::sample_amounts;
use super::sampling::{SamplePoint, Sampled};
use crate::files::color::srgb_from_linear;
use crate::transfer::{GradientLength, MAX_OPACITY, Quantity, TransferFunction};
use serde_json::json;

/// Text of an exported transfer-function file, with warnings about features that the file cannot store.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// Text of the exported transfer-function file.
    pub text: String,
    /// Warnings about features of the transfer function that the exported file cannot store, one line each.
    pub warnings: Vec<String>,
}

/// Largest error of the opacity between two points of an exported transfer function: relative, and absolute near 0.
const OPACITY_SHARE: f64 = 1e-3;
const OPACITY_LEAST: f64 = 1e-6;
/// Largest error of a colour channel between two points of an exported transfer function: a quarter of an 8-bit step.
const COLOR_TOLERANCE: f64 = 0.25 / 255.0;
/// Errors of an exported transfer function above which the user gets a warning: relative for opacities, in 8-bit
/// steps for colours.
pub(super) const OPACITY_WARNING: f64 = 0.01;
pub(super) const COLOR_WARNING: f64 = 1.0;
/// Largest number of opacities or colours of an exported transfer function. ParaView's editor shows a handle for each
/// of them.
const MOST_POINTS: usize = 1000;
/// Longest line of a `.vp` file that 3D Slicer reads correctly, characters. After a longer line it loses the lines
/// that follow.
const MOST_LINE: usize = 1023;

/// Samples of an exported transfer function: opacities over 1 mm, and gamma-encoded sRGB colours.
struct Lists {
    opacity: Vec<SamplePoint<1>>,
    color: Vec<SamplePoint<3>>,
    warnings: Vec<String>,
}

impl Lists {
    /// Samples a transfer function for export; `most` limits the numbers of opacities and of colours.
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

/// Separates the two points of a jump in an exported list by one rounding step, since other programs allow one point
/// for each scalar value.
fn separated<const N: usize>(mut points: Vec<SamplePoint<N>>) -> Vec<SamplePoint<N>> {
    for i in 1..points.len() {
        if points[i - 1].0 == points[i].0 {
            points[i - 1].0 = points[i - 1].0.next_down();
        }
    }
    points
}

/// Extends an exported list of opacities or colours to both ends of a value range, and to at least two points.
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

/// Whether the transfer function's scalar values are fractions of a volume's value range.
pub fn has_fractions(tf: &TransferFunction) -> bool {
    tf.units.eq_ignore_ascii_case(FRACTION)
}

/// Writes a transfer function as a ParaView colour map (JSON).
///
/// # Errors
/// It never fails; writers of all formats share this return type.
pub fn paraview(tf: &TransferFunction) -> Result<Written, String> {
    let Lists { opacity, color, mut warnings } = Lists::of(tf, [MOST_POINTS; 2]);
    let (first, last) = (tf.points[0].value, tf.points[tf.points.len() - 1].value);
    let range = if has_fractions(tf) {
        Some([first.min(0.0), last.max(1.0)])
    } else {
        warnings.push("ParaView maps it to the data's range unless `Use preset range` is chosen".into());
        // ParaView files with exactly these ranges are read as fractions; one more value avoids that.
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
    if tf.gradient_opacity.is_some() {
        warnings.push("gradient opacity was left out: ParaView's colour maps have none".into());
    }
    let text = serde_json::to_string_pretty(&map).map_err(|e| e.to_string())? + "\n";
    Ok(Written { text, warnings })
}

/// Writes a transfer function as a 3D Slicer `.vp` file.
///
/// # Errors
/// The transfer function's values are fractions of a volume's value range, which the format cannot express.
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
            let mut warnings = warnings;
            let gradient = gradient_line(tf, &mut warnings);
            // Trilinear, shaded like Slicer's own presets.
            let text = format!("1\n1\n0.9\n0.1\n0.2\n10\n{}\n{gradient}\n{}\n", lines[0], lines[1]);
            return Ok(Written { text, warnings });
        }
    }
}

/// Formats the line of a 3D Slicer `.vp` file with the gradient opacity, by the gradient magnitude per mean voxel spacing.
fn gradient_line(tf: &TransferFunction, warnings: &mut Vec<String>) -> String {
    let Some(opacity) = &tf.gradient_opacity else { return "4 0 1 255 1".into() };
    if opacity.length() == GradientLength::Mm {
        warnings.push(
            "gradient opacity is right for voxels of 1 mm: 3D Slicer measures gradients over a voxel".into(),
        );
    }
    let points = opacity.points().iter().map(|p| (p.magnitude, [p.factor])).collect();
    line(&extended(separated(points), None))
}

/// Formats a line of a 3D Slicer `.vp` file: the count of numbers, then scalar value and opacity or colour of each
/// point.
fn line<const N: usize>(points: &[SamplePoint<N>]) -> String {
    let mut text = (points.len() * (N + 1)).to_string();
    for (value, amounts) in points {
        text += &format!(" {value}");
        amounts.iter().for_each(|x| text += &format!(" {}", digits(*x)));
    }
    text
}

/// Formats a number with at least five significant digits, without trailing zeros.
fn digits(x: f64) -> String {
    if x != 0.0 && x.abs() < 0.01 {
        return format!("{x:.4e}");
    }
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
