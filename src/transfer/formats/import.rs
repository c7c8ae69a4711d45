//! Conversion of a transfer function from another program's file to a [`TransferFunction`], with warnings about
//! losses.

use super::curve::{CurveNode, Interpolation, LimitSide, NodeCurve, linear};
use super::sampling::Sampled;
use crate::files::color::{linear_from_srgb, srgb_from_linear};
use crate::transfer::{
    ControlPoint, GradientLength, GradientOpacity, MOST_GRADIENT_POINTS, Quantity, TransferFunction,
};

/// Transfer function read from a file, with the warnings of its import.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// Transfer function that was read from the file, after conversion.
    pub tf: TransferFunction,
    /// Warnings about parts of the transfer-function file that the import skipped, approximated or assumed, one line
    /// each.
    pub warnings: Vec<String>,
    /// Name of the file format of the imported transfer function, as in [`super::TRANSFER_FORMATS`].
    pub format: &'static str,
}

/// Transfer function as another program's file describes it, before conversion to a [`TransferFunction`].
#[derive(Debug)]
pub struct Foreign {
    /// Name of the other program's transfer-function format.
    pub format: &'static str,
    /// Name that the file gives to the transfer function.
    pub name: String,
    /// Whether the transfer function's scalar values are fractions of a volume's value range.
    pub has_fractions: bool,
    /// Opacity curve of the transfer function, as opacity over a length of `reference_length_mm`.
    pub opacity: Vec<CurveNode<1>>,
    /// Colour curve of the transfer function, gamma-encoded sRGB in `[0, 1]`.
    pub color: Vec<CurveNode<3>>,
    /// Way in which colours of the transfer function are interpolated between the nodes of its colour curve.
    pub color_interpolation: Interpolation<3>,
    /// Curve of the gradient opacity by the gradient magnitude per mean voxel spacing; empty if it is 1 everywhere.
    pub gradient: Vec<CurveNode<1>>,
    /// Length to which the transfer function's opacities refer, mm; `None` if the file does not give it.
    pub reference_length_mm: Option<f64>,
    /// Warnings about the transfer-function file that were collected so far during its import.
    pub warnings: Vec<String>,
}

/// Unit name of a transfer function whose scalar values are fractions of a volume's value range.
pub const FRACTION: &str = "fraction";

/// Largest number of control points of an imported transfer function. Devices support a few more, which leaves room
/// for edits.
const MOST_POINTS: usize = 1000;
/// Largest error of the opacity between two control points of an imported transfer function.
const OPACITY_TOLERANCE: f64 = 2e-4;
/// Largest error of a colour channel between two control points of an imported transfer function: half an 8-bit step
/// of encoded sRGB. Rounding to 8 bits adds an error of equal size.
const COLOR_TOLERANCE: f64 = 0.5 / 255.0;

impl Foreign {
    /// Creates an imported transfer function from its opacity and colour curves, with linear interpolation, no name
    /// and unknown reference length.
    pub fn new(format: &'static str, opacity: Vec<CurveNode<1>>, color: Vec<CurveNode<3>>) -> Self {
        Self {
            format,
            name: String::new(),
            has_fractions: false,
            opacity,
            color,
            color_interpolation: Interpolation::LINEAR,
            gradient: Vec::new(),
            reference_length_mm: None,
            warnings: Vec::new(),
        }
    }

    /// Creates a piecewise-linear imported transfer function through points of scalar value, red, green, blue and
    /// opacity.
    pub fn through(format: &'static str, points: &[[f64; 5]]) -> Self {
        let opacity = points.iter().map(|[v, _, _, _, o]| CurveNode::straight(*v, [*o])).collect();
        let color = points.iter().map(|[v, r, g, b, _]| CurveNode::straight(*v, [*r, *g, *b])).collect();
        Self::new(format, opacity, color)
    }

    /// Converts another program's transfer function to a [`TransferFunction`]. Curved opacities are sampled.
    /// Additional points keep the colours, which are interpolated in linear light here, within an 8-bit step of the
    /// original.
    ///
    /// # Errors
    /// The curves are invalid, or the transfer function breaks the rules of this program's own files.
    pub fn convert(self) -> Result<Imported, String> {
        let mut warnings = self.warnings;
        let opacity = curve_in_range(self.opacity, "opacities", &Interpolation::LINEAR, &mut warnings)?;
        if opacity.is_bent() {
            warnings.push("midpoints and sharpness of opacities became points on their curve".into());
        }
        let color = curve_in_range(self.color, "colours", &self.color_interpolation, &mut warnings)?;
        let reference_length_mm = self.reference_length_mm.unwrap_or_else(|| {
            warnings.push(ASSUMED_LENGTH.into());
            1.0
        });
        let at = |value: f64, side: LimitSide| {
            let ([o], [r, g, b]) = (opacity.at(value, side), color.at(value, side));
            [r, g, b, o]
        };
        // Colours of values without opacity are invisible.
        let color_error = |want: &[f64; 4], got: &[f64; 4]| {
            let apart = (0..3).map(|c| (want[c] - got[c]).abs()).fold(0.0, f64::max);
            if want[3] > 0.0 || got[3] > 0.0 { apart } else { 0.0 }
        };
        let opacity_error = |want: &[f64; 4], got: &[f64; 4]| (want[3] - got[3]).abs();
        let error = |want: &[f64; 4], got: &[f64; 4]| {
            (color_error(want, got) / COLOR_TOLERANCE).max(opacity_error(want, got) / OPACITY_TOLERANCE)
        };
        let mut breaks: Vec<f64> = opacity.values().chain(color.values()).collect();
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let sampled = Sampled { breaks, at: &at, between: in_linear_light, error: &error };
        let (mut points, _) = sampled.points(MOST_POINTS);
        for (_, [rgb @ .., _]) in &mut points {
            rgb.iter_mut().for_each(|c: &mut f64| *c = (*c * 255.0).round() / 255.0);
        }
        for (what, error, allowed, scale, unit) in [
            ("opacities", &opacity_error as &dyn Fn(&_, &_) -> f64, 1e-9, 1.0, ""),
            ("colours", &color_error, 1.02 / 255.0, 255.0, " of 255 steps"),
        ] {
            let worst = Sampled { error, breaks: sampled.breaks.clone(), ..sampled }.worst(&points);
            if worst > allowed {
                warnings.push(format!("{what} are off by up to {:.2e}{unit} between points", worst * scale));
            }
        }
        let point = |(value, [r, g, b, amount]): (f64, [f64; 4])| {
            let color = [r, g, b].map(linear_from_srgb);
            ControlPoint { value, amount, color }
        };
        let tf = TransferFunction {
            name: self.name,
            units: if self.has_fractions { FRACTION.into() } else { String::new() },
            reference_length_mm,
            points: points.into_iter().map(point).collect(),
            ..TransferFunction::new(Quantity::Opacity, &[])
        };
        let tf = match self.gradient.iter().all(|node| node.amounts == [1.0]) {
            true => tf,
            false => tf.with_gradient_opacity(gradient_opacity(self.gradient, &mut warnings)?),
        };
        // Checks the rules of this program's own files.
        let tf = TransferFunction::from_json(&tf.to_json())?;
        Ok(Imported { tf, warnings, format: self.format })
    }
}

const ASSUMED_LENGTH: &str =
    "the file does not say over what length its opacities are: 1 mm is assumed (--opacity-scale changes it)";

/// Builds an opacity or colour curve from nodes, and clamps opacities or colours outside `[0, 1]` with a warning.
///
/// # Errors
/// The nodes are invalid.
pub fn curve_in_range<const N: usize>(
    mut nodes: Vec<CurveNode<N>>,
    what: &str,
    interpolation: &Interpolation<N>,
    warnings: &mut Vec<String>,
) -> Result<NodeCurve<N>, String> {
    let mut clamped = 0;
    for node in &mut nodes {
        // Infinite amounts stay, and are refused below.
        let inside = node.amounts.map(|x| if x.is_finite() { x.clamp(0.0, 1.0) } else { x });
        clamped += usize::from(inside.iter().zip(&node.amounts).any(|(a, b)| (a - b).abs() > 0.0));
        node.amounts = inside;
    }
    if clamped > 0 {
        warnings.push(format!("{clamped} {what} outside of 0 to 1 were clamped"));
    }
    let curve = NodeCurve::new(nodes, interpolation).map_err(|why| format!("its {what}: {why}"))?;
    if curve.skipped > 0 {
        let count = curve.skipped;
        warnings.push(format!(
            "{count} {what} between the first and the last of one value were skipped: a jump has two sides"
        ));
    }
    Ok(curve)
}

/// Largest error of the factor between two points of an imported gradient opacity.
const FACTOR_TOLERANCE: f64 = 1e-3;

/// Converts a curve of another program to a gradient opacity by the gradient magnitude per mean voxel spacing.
///
/// # Errors
/// The nodes are invalid.
fn gradient_opacity(nodes: Vec<CurveNode<1>>, warnings: &mut Vec<String>) -> Result<GradientOpacity, String> {
    let curve = curve_in_range(nodes, "gradient opacities", &Interpolation::LINEAR, warnings)?;
    let mut breaks: Vec<f64> = curve.values().collect();
    breaks.dedup();
    let at = |value: f64, side: LimitSide| curve.at(value, side);
    let error = |want: &[f64; 1], got: &[f64; 1]| (want[0] - got[0]).abs() / FACTOR_TOLERANCE;
    let sampled = Sampled { breaks, at: &at, between: linear, error: &error };
    // One more point lies at 0.
    let (points, worst) = sampled.points(MOST_GRADIENT_POINTS - 1);
    if worst > 1.0 {
        let off = worst * FACTOR_TOLERANCE;
        warnings
            .push(format!("gradient opacities are off by up to {off:.2e}: there is no room for more points"));
    }
    // Magnitudes are not negative, and the factor is constant before the first point.
    let ahead = points.iter().filter(|p| p.0 > 0.0).map(|(value, [factor])| (*value, *factor));
    let [at_zero] = curve.at(0.0, LimitSide::From);
    let opacity = GradientOpacity::new(std::iter::once((0.0, at_zero)).chain(ahead));
    Ok(opacity.map_err(|why| format!("its gradient opacity: {why}"))?.per(GradientLength::Voxel))
}

/// Interpolates two points of red, green, blue and opacity like [`TransferFunction`]: colours in linear light,
/// opacities linearly.
fn in_linear_light(a: &[f64; 4], b: &[f64; 4], share: f64) -> [f64; 4] {
    let mixed = |i: usize| {
        let [a, b] = [a[i], b[i]].map(linear_from_srgb);
        srgb_from_linear(a + (b - a) * share)
    };
    [mixed(0), mixed(1), mixed(2), a[3] + (b[3] - a[3]) * share]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_mixed_in_srgb_stay_within_a_step_of_8_bits() {
        let color = vec![CurveNode::straight(-3.0, [0.0; 3]), CurveNode::straight(5.0, [1.0, 0.5, 0.0])];
        let opacity = vec![CurveNode::straight(0.0, [0.0]), CurveNode::straight(5.0, [1.0])];
        let foreign = Foreign {
            reference_length_mm: Some(2.0),
            ..Foreign::new("test", opacity.clone(), color.clone())
        };
        let imported = foreign.convert().unwrap();
        assert_eq!(imported.warnings, [""; 0]);
        let tf = imported.tf;
        assert!((8..60).contains(&tf.points.len()), "{}", tf.points.len());
        let opacity = NodeCurve::new(opacity, &Interpolation::LINEAR).unwrap();
        let color = NodeCurve::new(color, &Interpolation { mix: linear, ..Interpolation::LINEAR }).unwrap();
        for i in 0..=1000 {
            let value = -3.0 + 8.0 * f64::from(i) / 1000.0;
            let ([want], got) = (opacity.at(value, LimitSide::From), tf.amount(value));
            assert!((want - got).abs() < 1e-12, "{value}");
            if want > 0.0 {
                let want = color.at(value, LimitSide::From);
                let got = tf.color(value).map(srgb_from_linear);
                for c in 0..3 {
                    assert!((want[c] - got[c]).abs() < 1.05 / 255.0, "{value}: {want:?} {got:?}");
                }
            }
        }
    }

    #[test]
    fn amounts_out_of_range_are_clamped_with_a_warning() {
        let mut warnings = Vec::new();
        let mut curve = |amounts: &[f64]| {
            let nodes =
                amounts.iter().enumerate().map(|(v, a)| CurveNode::straight(v as f64, [*a])).collect();
            curve_in_range(nodes, "opacities", &Interpolation::LINEAR, &mut warnings)
        };
        let opacity = curve(&[-0.5, 1.5, 0.5]).unwrap();
        assert_eq!([0.0, 1.0, 2.0].map(|v| opacity.at(v, LimitSide::From)[0]), [0.0, 1.0, 0.5]);
        assert!(curve(&[f64::NAN]).is_err() && curve(&[f64::INFINITY]).is_err());
        assert_eq!(warnings, ["2 opacities outside of 0 to 1 were clamped"]);
    }
}
