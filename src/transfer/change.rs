//! Compares two transfer functions on the values that occur in a volume, to decide which computed results stay valid
//! after an edit.

use super::{ControlPoint, TransferFunction};

/// Largest effect that an edit of a transfer function has on a volume: none, on colour only, or on extinction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum TransferChange {
    /// The edit of the transfer function has no visible effect: extinction of all values, and colour of values with
    /// extinction, stay the same.
    Nothing,
    /// The edit of the transfer function changes the colour of some value with extinction in the volume, but the
    /// extinction of none.
    Color,
    /// The edit of the transfer function changes the extinction of some value in the volume.
    Extinction,
}

impl TransferChange {
    /// Returns the effect on a volume if the transfer function `old` is replaced by `new`. `occurs` tells whether the
    /// volume has a value in a closed range. The effect may be overestimated, since whole ranges between control
    /// points are tested.
    pub fn between(
        old: &TransferFunction,
        new: &TransferFunction,
        occurs: impl Fn([f64; 2]) -> bool,
    ) -> Self {
        let same_kind = old.quantity == new.quantity && old.reference_length_mm == new.reference_length_mm;
        let same_gradients = old.gradient_opacity == new.gradient_opacity;
        if !same_kind || !same_gradients || old.rules != new.rules || old.clip != new.clip {
            return Self::Extinction;
        }
        let mut most = Self::Nothing;
        for range in pieces(old, new) {
            let differs =
                |get: &dyn Fn(&ControlPoint) -> f64| old.ends_on(range, get) != new.ends_on(range, get);
            let change = if differs(&|p| p.amount) {
                Self::Extinction
            } else if (0..3).any(|c| differs(&|p| p.color[c])) && old.ends_on(range, |p| p.amount) != [0.0; 2]
            {
                Self::Color
            } else {
                continue;
            };
            if change > most && occurs(range) {
                most = change;
            }
        }
        most
    }
}

/// Returns the ranges of scalar values between neighbouring control points of two transfer functions together. Both
/// functions are linear inside each range.
fn pieces(a: &TransferFunction, b: &TransferFunction) -> Vec<[f64; 2]> {
    let mut ends: Vec<f64> = a.points.iter().chain(&b.points).map(|p| p.value).collect();
    ends.extend([f64::NEG_INFINITY, f64::INFINITY]);
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    ends.windows(2).map(|w| [w[0], w[1]]).collect()
}

impl TransferFunction {
    /// Opacity, extinction or colour of the transfer function at both ends of a range of scalar values, as limits
    /// from inside. No control point lies inside the range.
    fn ends_on(&self, [low, high]: [f64; 2], get: impl Fn(&ControlPoint) -> f64) -> [f64; 2] {
        let points = &self.points;
        // The last point at or below the range, and the first at or above it.
        let below = points.partition_point(|p| p.value <= low).checked_sub(1).map(|i| &points[i]);
        let above = points.get(points.partition_point(|p| p.value < high));
        match (below, above) {
            (Some(a), Some(b)) => {
                [low, high].map(|v| get(a) + (get(b) - get(a)) * ((v - a.value) / (b.value - a.value)))
            }
            (Some(only), None) | (None, Some(only)) => [get(only); 2],
            (None, None) => [0.0; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Quantity;
    use super::*;

    fn tf(points: &[(f64, f64, f64)]) -> TransferFunction {
        let point = |&(value, amount, red)| ControlPoint { value, amount, color: [red, 0.5, 0.0] };
        let points = points.iter().map(point).collect();
        TransferFunction { points, ..TransferFunction::new(Quantity::Extinction, &[]) }
    }

    fn change(old: &TransferFunction, new: &TransferFunction, values: [f64; 2]) -> TransferChange {
        TransferChange::between(old, new, |[lo, hi]| lo <= values[1] && hi >= values[0])
    }

    #[test]
    fn only_changes_at_values_that_occur_count() {
        use TransferChange::{Color, Extinction, Nothing};
        let base =
            [(0.0, 0.0, 0.1), (100.0, 1.0, 0.2), (100.0, 2.0, 0.3), (200.0, 2.0, 0.4), (300.0, 0.0, 0.5)];
        let old = tf(&base);
        type Points = Vec<(f64, f64, f64)>;
        let with = |edit: &dyn Fn(&mut Points)| {
            let mut points = base.to_vec();
            edit(&mut points);
            tf(&points)
        };
        let everywhere = [-1e3, 1e3];
        for (what, new, values, expected) in [
            ("nothing", old.clone(), everywhere, Nothing),
            ("a point's opacity", with(&|p| p[3].1 = 1.5), everywhere, Extinction),
            ("far above the values", with(&|p| p[3].1 = 1.5), [-50.0, 99.0], Nothing),
            ("the earlier side of a jump", with(&|p| p[1].1 = 0.5), [150.0, 160.0], Nothing),
            ("that side where it counts", with(&|p| p[1].1 = 0.5), [50.0, 60.0], Extinction),
            ("a colour", with(&|p| p[3].2 = 0.9), everywhere, Color),
            ("a colour beyond the values", with(&|p| p[3].2 = 0.9), [-50.0, 99.0], Nothing),
            ("a colour without extinction", with(&|p| p[0].2 = 0.9), [-50.0, -1.0], Nothing),
            ("a point moved along a constant", with(&|p| p[0].0 = -10.0), [-60.0, -20.0], Nothing),
            ("a point moved", with(&|p| p[0].0 = -10.0), everywhere, Extinction),
            ("a point added on a line", with(&|p| p.insert(4, (250.0, 1.0, 0.45))), everywhere, Nothing),
            ("the last extinction", with(&|p| p[4].1 = 0.1), [400.0, 500.0], Extinction),
            ("another name", TransferFunction { name: "b".into(), ..old.clone() }, everywhere, Nothing),
            (
                "a gradient opacity",
                old.clone().with_gradient_opacity("0:0,5:1".parse().unwrap()),
                everywhere,
                Extinction,
            ),
            (
                "another reference length",
                TransferFunction { reference_length_mm: 2.0, ..old.clone() },
                everywhere,
                Extinction,
            ),
        ] {
            assert_eq!(change(&old, &new, values), expected, "{what}");
            assert_eq!(change(&new, &old, values), expected, "{what}, backwards");
        }
    }
}
