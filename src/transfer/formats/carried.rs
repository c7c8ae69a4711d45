//! What is carried over from another program's transfer function: opacities and colours of the same values become one
//! [`TransferFunction`], and what that lacks of them is said.

use super::curve::{Curve, Node, Side, Ways, linear};
use super::pieces::Sampled;
use crate::files::color::{linear_from_srgb, srgb_from_linear};
use crate::transfer::{ControlPoint, Quantity, TransferFunction};

/// A transfer function that was read, and what could not be carried over.
#[derive(Debug, Clone, PartialEq)]
pub struct Carried {
    /// The function.
    pub tf: TransferFunction,
    /// One line each: what was left out, approximated or assumed.
    pub warnings: Vec<String>,
    /// Name of the format, as in [`super::TRANSFER_FORMATS`].
    pub format: &'static str,
}

/// What another program says, before it is carried over.
#[derive(Debug)]
pub struct Parts {
    pub name: String,
    pub units: &'static str,
    /// Opacities in `[0, 1]`, per `reference_length_mm`.
    pub opacity: Curve<1>,
    /// Encoded sRGB in `[0, 1]`.
    pub color: Curve<3>,
    /// Length that opacities refer to, mm; 1 where nothing says it.
    pub reference_length_mm: f64,
    /// What was left out already.
    pub warnings: Vec<String>,
}

/// Units of a function whose values are shares of a volume's range.
pub const FRACTION: &str = "fraction";

/// Points of a function that is read: what devices hold, with room for edits.
const MOST_POINTS: usize = 1000;
/// How far an opacity may be off between two points.
const OPACITY_TOLERANCE: f64 = 2e-4;
/// How far a colour may be off between two points, encoded sRGB: half a step of 8 bits. Rounding to 8 bits adds as much.
const COLOR_TOLERANCE: f64 = 0.5 / 255.0;

/// Opacities from nodes, put into `[0, 1]`.
///
/// # Errors
/// As [`Curve::new`].
pub fn opacities(mut nodes: Vec<Node<1>>, warnings: &mut Vec<String>) -> Result<Curve<1>, String> {
    let mut clamped = 0;
    for node in &mut nodes {
        clamped += usize::from(put_in_range(&mut node.amounts[0]));
    }
    if clamped > 0 {
        warnings.push(format!("{clamped} opacities outside of 0 to 1 became 0 or 1"));
    }
    let curve = Curve::new(nodes, linear, Ways::default()).map_err(|why| format!("its opacities: {why}"))?;
    say_left_out(&curve, "opacities", warnings);
    Ok(curve)
}

/// Colours from nodes of encoded sRGB, put into `[0, 1]`; mixed as `mix` says.
///
/// # Errors
/// As [`Curve::new`].
pub fn colors(
    mut nodes: Vec<Node<3>>,
    mix: super::curve::Mix<3>,
    ways: Ways,
    warnings: &mut Vec<String>,
) -> Result<Curve<3>, String> {
    let mut clamped = 0;
    for node in &mut nodes {
        // Every channel is looked at, whatever the one before was.
        clamped += node.amounts.iter_mut().filter_map(|c| put_in_range(c).then_some(())).count().min(1);
    }
    if clamped > 0 {
        warnings.push(format!("{clamped} colours outside of 0 to 1 were clamped"));
    }
    let curve = Curve::new(nodes, mix, ways).map_err(|why| format!("its colours: {why}"))?;
    say_left_out(&curve, "colours", warnings);
    Ok(curve)
}

fn put_in_range(x: &mut f64) -> bool {
    // What is not a number is refused later.
    let outside = *x < 0.0 || *x > 1.0;
    if outside && x.is_finite() {
        *x = x.clamp(0.0, 1.0);
    }
    outside
}

fn say_left_out<const N: usize>(curve: &Curve<N>, what: &str, warnings: &mut Vec<String>) {
    if curve.left_out > 0 {
        let count = curve.left_out;
        warnings.push(format!(
            "{count} {what} between the first and the last of one value were left out: a jump has two sides"
        ));
    }
}

impl Parts {
    /// Carries them over: opacities as they are, or sampled where they are bent; colours with points added so that what is
    /// interpolated in linear light here stays as close to theirs as 8 bits can tell.
    ///
    /// # Errors
    /// What no transfer function may be, e.g. opacities over a length that is not above 0.
    pub fn carry(self, format: &'static str) -> Result<Carried, String> {
        let Self { name, units, opacity, color, reference_length_mm, mut warnings } = self;
        let at = |value: f64, side: Side| {
            let ([o], [r, g, b]) = (opacity.at(value, side), color.at(value, side));
            [r, g, b, o]
        };
        // What has no opacity has no colour that could be seen.
        let color_off = |want: &[f64; 4], got: &[f64; 4]| {
            let apart = (0..3).map(|c| (want[c] - got[c]).abs()).fold(0.0, f64::max);
            if want[3] > 0.0 || got[3] > 0.0 { apart } else { 0.0 }
        };
        let opacity_off = |want: &[f64; 4], got: &[f64; 4]| (want[3] - got[3]).abs();
        let off = |want: &[f64; 4], got: &[f64; 4]| {
            (color_off(want, got) / COLOR_TOLERANCE).max(opacity_off(want, got) / OPACITY_TOLERANCE)
        };
        let mut breaks: Vec<f64> = opacity.values().chain(color.values()).collect();
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let sampled = Sampled { breaks, at: &at, between: in_linear_light, off: &off };
        let (points, _) = sampled.points(MOST_POINTS);
        let rounded = |c: f64| (c * 255.0).round() / 255.0;
        let points: Vec<(f64, [f64; 4])> = points
            .into_iter()
            .map(|(v, [r, g, b, o])| (v, [rounded(r), rounded(g), rounded(b), o]))
            .collect();
        for (what, off, allowed, unit) in [
            ("opacities are off by up to", &opacity_off as &dyn Fn(&_, &_) -> f64, 1e-9, 1.0),
            ("colours are off by up to", &color_off, 1.02 / 255.0, 255.0),
        ] {
            let worst = Sampled { off, breaks: sampled.breaks.clone(), ..sampled }.worst(&points);
            if worst > allowed {
                let of = if unit == 1.0 { "" } else { " of 255 steps" };
                warnings.push(format!("{what} {:.2e}{of} between points", worst * unit));
            }
        }
        let points = points.into_iter().map(|(value, [r, g, b, amount])| ControlPoint {
            value,
            amount,
            color: [r, g, b].map(linear_from_srgb),
        });
        let tf = TransferFunction {
            name,
            units: units.into(),
            reference_length_mm,
            points: points.collect(),
            ..TransferFunction::new(Quantity::Opacity, &[])
        };
        // The file's own rules are the rules of the function.
        let tf = TransferFunction::from_json(&tf.to_json())?;
        Ok(Carried { tf, warnings, format })
    }
}

/// Encoded colours mixed in linear light, and opacities straight: what a [`TransferFunction`] does between its points.
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
        let mut warnings = Vec::new();
        let nodes = vec![Node::straight(-3.0, [0.0; 3]), Node::straight(5.0, [1.0, 0.5, 0.0])];
        let color = colors(nodes, linear, Ways::default(), &mut warnings).unwrap();
        let nodes = vec![Node::straight(0.0, [0.0]), Node::straight(5.0, [1.0])];
        let opacity = opacities(nodes, &mut warnings).unwrap();
        let parts = Parts {
            name: "ramp".into(),
            units: "",
            opacity: opacity.clone(),
            color: color.clone(),
            reference_length_mm: 2.0,
            warnings,
        };
        let carried = parts.carry("test").unwrap();
        assert_eq!(carried.warnings, [""; 0]);
        let tf = carried.tf;
        assert!((8..60).contains(&tf.points.len()), "{}", tf.points.len());
        for i in 0..=1000 {
            let value = -3.0 + 8.0 * f64::from(i) / 1000.0;
            let ([want], got) = (opacity.at(value, Side::From), tf.amount(value));
            assert!((want - got).abs() < 1e-12, "{value}");
            if want > 0.0 {
                let want = color.at(value, Side::From);
                let got = tf.color(value).map(srgb_from_linear);
                for c in 0..3 {
                    assert!((want[c] - got[c]).abs() < 1.05 / 255.0, "{value}: {want:?} {got:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_out_of_range_is_clamped_and_said() {
        let mut warnings = Vec::new();
        let nodes = vec![Node::straight(0.0, [-0.5]), Node::straight(1.0, [1.5]), Node::straight(2.0, [0.5])];
        let opacity = opacities(nodes, &mut warnings).unwrap();
        assert_eq!([0.0, 1.0, 2.0].map(|v| opacity.at(v, Side::From)[0]), [0.0, 1.0, 0.5]);
        let nodes = vec![Node::straight(0.0, [2.0, -1.0, 0.5])];
        let color = colors(nodes, linear, Ways::default(), &mut warnings).unwrap();
        assert_eq!(color.at(0.0, Side::From), [1.0, 0.0, 0.5]);
        assert!(
            warnings[0].starts_with("2 opacities") && warnings[1].starts_with("1 colours"),
            "{warnings:?}"
        );
        assert!(opacities(vec![Node::straight(0.0, [f64::NAN])], &mut warnings).is_err());
    }
}
