//! Converts a transfer function from opacity to extinction or back, or to another reference length of opacities.

use super::curve::{LimitSide, NodeCurve, linear};
use super::sampling::{SamplePoint, Sampled};
use crate::transfer::{ControlPoint, Quantity, TransferFunction};

/// Largest error of the extinction between two control points of a converted transfer function: relative, and
/// absolute near 0.
const SHARE: f64 = 1e-3;
const LEAST: f64 = 1e-7;
/// Largest number of control points of a converted transfer function. The functions of several segmentation labels
/// share one set of device tables.
const MOST_POINTS: usize = 250;

/// Samples the transfer function `tf` with at most `most` points, in the quantity (opacity or extinction) and
/// reference length of `like`. It also returns the largest error between the points; `error` measures it in units of
/// the tolerance.
pub fn sample_amounts(
    tf: &TransferFunction,
    like: &TransferFunction,
    most: usize,
    error: &dyn Fn(&[f64; 1], &[f64; 1]) -> f64,
) -> (Vec<SamplePoint<1>>, f64) {
    let amounts = NodeCurve::through(tf.points.iter().map(|p| (p.value, [p.amount])));
    let is_unchanged = tf.has_quantity_of(like);
    let at = |value: f64, side: LimitSide| {
        let [amount] = amounts.at(value, side);
        let extinction = tf.extinction_of_amount(amount);
        match like.quantity {
            _ if is_unchanged => [amount],
            Quantity::Extinction => [extinction],
            Quantity::Opacity => [-(-extinction * like.reference_length_mm).exp_m1()],
        }
    };
    Sampled { breaks: tf.point_values(), at: &at, between: linear, error }.points(most)
}

/// Converts the transfer function `tf` to the quantity (opacity or extinction) and reference length of `like`. Curves
/// between its control points are sampled with a tolerance of 0.1 % of the extinction. It also returns the largest
/// relative error.
pub fn with_quantity_of(tf: &TransferFunction, like: &TransferFunction) -> (TransferFunction, f64) {
    if tf.has_quantity_of(like) {
        return (tf.clone(), 0.0);
    }
    let colors = NodeCurve::through(tf.points.iter().map(|p| (p.value, p.color)));
    // Errors are compared as extinction: near opacity 1 a small change of opacity is a large one of extinction.
    let error = |want: &[f64; 1], got: &[f64; 1]| {
        let [want, got] = [want, got].map(|amount| like.extinction_of_amount(amount[0]));
        (want - got).abs() / (LEAST + SHARE * want)
    };
    let (points, worst) = sample_amounts(tf, like, MOST_POINTS, &error);
    let point = |i: usize| {
        let (value, [amount]) = points[i];
        // The first of the two points of a jump is its lower side.
        let is_below = points.get(i + 1).is_some_and(|next| next.0 == value);
        let color = colors.at(value, if is_below { LimitSide::Below } else { LimitSide::From });
        ControlPoint { value, amount, color }
    };
    let points = (0..points.len()).map(point).collect();
    let (quantity, reference_length_mm) = (like.quantity, like.reference_length_mm);
    (TransferFunction { quantity, reference_length_mm, points, ..tf.clone() }, SHARE * worst)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_quantity_gives_the_same_extinction() {
        let of = |quantity, reference_length_mm, points: &[(f64, f64)]| {
            let mut tf = TransferFunction { reference_length_mm, ..TransferFunction::new(quantity, points) };
            tf.points.iter_mut().for_each(|p| p.color = [p.value / 300.0, 0.5, 0.0]);
            tf
        };
        let points = [(0.0, 0.0), (100.0, 0.7), (100.0, 0.1), (250.0, 0.95)];
        let all = [
            of(Quantity::Opacity, 1.0, &points),
            of(Quantity::Opacity, 10.0, &points),
            of(Quantity::Opacity, 0.2, &points),
            of(Quantity::Extinction, 1.0, &points),
        ];
        for tf in &all {
            for like in &all {
                let (made, off) = with_quantity_of(tf, like);
                assert!(
                    made.has_quantity_of(like) && off <= 4e-3 && made.points.len() <= MOST_POINTS,
                    "{off}"
                );
                for i in -10..600 {
                    let value = f64::from(i) * 0.5 + 0.1;
                    // No opacity expresses a larger extinction.
                    let most =
                        like.extinction_of_amount(if like.quantity == Quantity::Opacity { 1.0 } else { 1e9 });
                    let (want, got) = (tf.extinction(value).min(most), made.extinction(value));
                    assert!((want - got).abs() <= 1e-6 + 1.3 * off.max(1e-3) * want, "{value}: {want} {got}");
                    let [a, b] = [tf.color(value), made.color(value)];
                    assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-9), "{value}");
                }
            }
        }
    }
}
