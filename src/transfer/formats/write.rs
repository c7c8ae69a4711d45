//! Our transfer functions as other programs read them: opacity over 1 mm and encoded sRGB colours, each a list of points
//! between which those programs go straight.

use super::carried::FRACTION;
use super::curve::{Curve, Side, linear};
use super::pieces::{Point, Sampled};
use crate::files::color::srgb_from_linear;
use crate::transfer::{MAX_OPACITY, Quantity, TransferFunction};
use serde_json::json;

/// A file's text, and what it does not hold of the function.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The text.
    pub text: String,
    /// One line each.
    pub warnings: Vec<String>,
}

/// How far an opacity may be off between two points, as a share of itself, and where it is next to nothing.
const OPACITY_SHARE: f64 = 1e-3;
const OPACITY_LEAST: f64 = 1e-6;
/// How far a colour may be off: a quarter of a step of 8 bits.
const COLOR_OFF: f64 = 0.25 / 255.0;
/// From which error on too few points are worth a warning: a share of the opacity, and steps of 8 bits.
pub(super) const OPACITY_SAID: f64 = 0.01;
pub(super) const COLOR_SAID: f64 = 1.0;
/// Points of a list; ParaView's editor shows each as a handle.
const MOST_POINTS: usize = 1000;
/// Characters of a line that 3D Slicer reads; behind a longer one it loses the lines that follow.
const MOST_LINE: usize = 1023;

/// Opacity over 1 mm, and colours, as lists of at most so many points.
struct Lists {
    opacity: Vec<Point<1>>,
    color: Vec<Point<3>>,
    warnings: Vec<String>,
}

impl Lists {
    fn of(tf: &TransferFunction, most: [usize; 2]) -> Self {
        let amounts = Curve::through(tf.points.iter().map(|p| (p.value, [p.amount])));
        let colors = Curve::through(tf.points.iter().map(|p| (p.value, p.color)));
        let as_it_is = tf.quantity == Quantity::Opacity && tf.reference_length_mm == 1.0;
        let opacity = |value: f64, side: Side| {
            let [amount] = amounts.at(value, side);
            [if as_it_is { amount } else { -(-tf.extinction_of_amount(amount)).exp_m1() }]
        };
        let color = |value: f64, side: Side| colors.at(value, side).map(srgb_from_linear);
        let mut breaks: Vec<f64> = tf.points.iter().map(|p| p.value).collect();
        breaks.dedup();
        let opacity_off = |want: &[f64; 1], got: &[f64; 1]| {
            (want[0] - got[0]).abs() / (OPACITY_LEAST + OPACITY_SHARE * want[0])
        };
        let color_off = |want: &[f64; 3], got: &[f64; 3]| {
            (0..3).map(|c| (want[c] - got[c]).abs()).fold(0.0, f64::max) / COLOR_OFF
        };
        let sampled = Sampled { breaks: breaks.clone(), at: &opacity, between: linear, off: &opacity_off };
        let (opacity, opacity_worst) = sampled.points(most[0]);
        let sampled = Sampled { breaks, at: &color, between: linear, off: &color_off };
        let (color, color_worst) = sampled.points(most[1]);
        let mut warnings = Vec::new();
        let share = opacity_worst * OPACITY_SHARE;
        if share > OPACITY_SAID {
            let percent = 100.0 * share;
            warnings.push(format!(
                "opacities are off by up to {percent:.1} % of themselves: there is no room for more points"
            ));
        }
        let steps = color_worst * COLOR_OFF * 255.0;
        if steps > COLOR_SAID {
            warnings.push(format!(
                "colours are off by up to {steps:.1} of 255 steps: there is no room for more points"
            ));
        }
        let densest = tf.max_extinction(f64::NEG_INFINITY, f64::INFINITY);
        let most = -(-MAX_OPACITY).ln_1p();
        if densest > most * (1.0 + 1e-9) {
            warnings.push(format!("an extinction of {densest:.4} per mm is more than an opacity over 1 mm can say: {most:.4} is left"));
        }
        Self { opacity, color, warnings }
    }
}

/// The two points of a jump apart by the last digit: the programs keep one point a value.
fn apart<const N: usize>(points: Vec<Point<N>>) -> Vec<Point<N>> {
    let mut all = points;
    for i in 1..all.len() {
        if all[i - 1].0 == all[i].0 {
            all[i - 1].0 = all[i - 1].0.next_down();
        }
    }
    all
}

/// Points at both ends of a range too, and two at least.
fn reaching<const N: usize>(mut points: Vec<Point<N>>, range: Option<[f64; 2]>) -> Vec<Point<N>> {
    if let Some([low, high]) = range {
        if points[0].0 > low {
            points.insert(0, (low, points[0].1));
        }
        let last = points[points.len() - 1];
        if last.0 < high {
            points.push((high, last.1));
        }
    }
    if let [only] = points[..] {
        points.push((only.0 + 1.0, only.1));
    }
    points
}

/// Whether values are shares of a volume's range.
pub fn is_of_fractions(tf: &TransferFunction) -> bool {
    tf.units.eq_ignore_ascii_case(FRACTION)
}

/// ParaView's JSON.
///
/// # Errors
/// None so far; of the form of the others.
pub fn paraview(tf: &TransferFunction) -> Result<Written, String> {
    let Lists { opacity, color, mut warnings } = Lists::of(tf, [MOST_POINTS; 2]);
    let (first, last) = (tf.points[0].value, tf.points[tf.points.len() - 1].value);
    let range = if is_of_fractions(tf) {
        Some([first.min(0.0), last.max(1.0)])
    } else {
        warnings.push("ParaView lays it over the data's range unless `Use preset range` is chosen".into());
        // What lies over exactly these is read as shares of the range; one value more says that it is not.
        [[0.0, 1.0], [-1.0, 1.0]].contains(&[first, last]).then_some([first, last + 1.0])
    };
    let opacity = reaching(apart(opacity), range);
    let color = reaching(apart(color), range);
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

/// 3D Slicer's `.vp`.
///
/// # Errors
/// The function's values are shares of a range, which Slicer knows nothing of.
pub fn vp(tf: &TransferFunction) -> Result<Written, String> {
    if is_of_fractions(tf) {
        return Err(
            "its values are fractions of a volume's range, and a .vp holds values: give --range LO,HI".into(),
        );
    }
    let line = |numbers: Vec<String>| format!("{} {}", numbers.len(), numbers.join(" "));
    let mut most = [MOST_POINTS; 2];
    loop {
        let Lists { opacity, color, warnings } = Lists::of(tf, most);
        let (opacity, color) = (reaching(apart(opacity), None), reaching(apart(color), None));
        let lines = [
            line(opacity.iter().flat_map(|(v, [o])| [format!("{v}"), digits(*o)]).collect()),
            line(
                color
                    .iter()
                    .flat_map(|(v, rgb)| [format!("{v}"), digits(rgb[0]), digits(rgb[1]), digits(rgb[2])])
                    .collect(),
            ),
        ];
        let points = [opacity.len(), color.len()];
        let mut is_long = false;
        for i in 0..2 {
            if lines[i].len() > MOST_LINE && points[i] > 2 {
                most[i] = (points[i] * MOST_LINE / lines[i].len()).min(points[i] - 1).max(2);
                is_long = true;
            }
        }
        if !is_long {
            // Trilinear, shaded as Slicer's own presets are, and no opacity by the gradient.
            let text = format!("1\n1\n0.9\n0.1\n0.2\n10\n{}\n4 0 1 255 1\n{}\n", lines[0], lines[1]);
            return Ok(Written { text, warnings });
        }
    }
}

/// Five digits, without zeros at the end.
fn digits(x: f64) -> String {
    if x != 0.0 && x.abs() < 0.01 {
        return format!("{x:.4e}");
    }
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
