//! A transfer function in the kind of another: opacities over the same length, or extinction as well.

use super::curve::{Curve, Side, linear};
use super::pieces::Sampled;
use crate::transfer::{ControlPoint, Quantity, TransferFunction};

/// How far extinction may be off between two points, as a share of itself, and where it is next to nothing.
const SHARE: f64 = 1e-3;
const LEAST: f64 = 1e-7;
/// Points of one function: several share the intervals that a device holds.
const MOST_POINTS: usize = 250;

/// Whether both give the same quantity over the same length, so that they can stand in one set of tables.
pub fn are_alike(a: &TransferFunction, b: &TransferFunction) -> bool {
    let same_length = a.quantity == Quantity::Extinction || a.reference_length_mm == b.reference_length_mm;
    a.quantity == b.quantity && same_length
}

/// `tf` with amounts as `like` gives them: what is straight in the one quantity is bent in the other, and so has points
/// added until it is off by no more than a thousandth of itself. Also how far it is off, as a share of itself.
pub fn alike(tf: &TransferFunction, like: &TransferFunction) -> (TransferFunction, f64) {
    if are_alike(tf, like) {
        return (tf.clone(), 0.0);
    }
    let amounts = Curve::through(tf.points.iter().map(|p| (p.value, [p.amount])));
    let colors = Curve::through(tf.points.iter().map(|p| (p.value, p.color)));
    let given = |value: f64, side: Side| {
        let [amount] = amounts.at(value, side);
        let extinction = tf.extinction_of_amount(amount);
        match like.quantity {
            Quantity::Extinction => [extinction],
            Quantity::Opacity => [-(-extinction * like.reference_length_mm).exp_m1()],
        }
    };
    let mut breaks: Vec<f64> = tf.points.iter().map(|p| p.value).collect();
    breaks.dedup();
    // Near opacity 1 little of an amount is much extinction.
    let off = |want: &[f64; 1], got: &[f64; 1]| {
        let [want, got] = [want, got].map(|amount| like.extinction_of_amount(amount[0]));
        (want - got).abs() / (LEAST + SHARE * want)
    };
    let (points, worst) = Sampled { breaks, at: &given, between: linear, off: &off }.points(MOST_POINTS);
    let point = |i: usize| {
        let (value, [amount]) = points[i];
        // Of the two points of a jump the first is what lies below it.
        let is_below = points.get(i + 1).is_some_and(|next| next.0 == value);
        let color = colors.at(value, if is_below { Side::Below } else { Side::From });
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
    fn another_kind_gives_the_same_extinction() {
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
                let (made, off) = alike(tf, like);
                assert!(are_alike(&made, like) && off <= 4e-3 && made.points.len() <= MOST_POINTS, "{off}");
                for i in -10..600 {
                    let value = f64::from(i) * 0.5 + 0.1;
                    // More than opacity 1 less a 2^24th nothing of a kind can say.
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
