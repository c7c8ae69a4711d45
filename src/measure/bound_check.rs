//! Test whether a shadow method's transmittance along light rays lies within its error bound around the exact
//! transmittance curve.
//!
//! Transmittance never increases with depth. A bound with the tolerances `b` in transmittance and `d` in depth is
//! therefore the interval `T_exact(z + d) - b <= T_method(z) <= T_exact(z - d) + b`. At a jump of the transfer
//! function, no sampled method can satisfy a bound in transmittance alone. The tolerance in depth makes a bound
//! possible there.
//!
//! Where a light ray grazes a surface, float32 rounding decides whether the ray meets it. A bound then applies to all
//! rays and values that float32 cannot distinguish from the exact ones (`Bound::lateral_mm`, `Bound::value`). Depths
//! outside the interval of the exact curve are therefore compared with a [`RoundingEnvelope`]. The report counts
//! these depths.

use super::histogram::Histogram;
use super::rounding_envelope::RoundingEnvelope;
use super::test_depths::sort_distinct;
use crate::shadow::Bound;

/// Tolerance in transmittance for rounding errors of the exact transmittance curve itself.
pub const EXACT_ROUNDING: f64 = 1e-12;

/// Deviation of a shadow method's transmittance from the exact transmittance at one depth of one light ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Index of the light ray with this deviation, as passed to [`BoundReport::of_ray`].
    pub ray: usize,
    /// Depth along the light ray at which the deviation was measured, mm.
    pub depth_mm: f64,
    /// Transmittance from the light to the depth of this deviation, by the shadow method.
    pub t_method: f64,
    /// Exact transmittance from the light to the depth of this deviation.
    pub t_exact: f64,
    /// Deviation of the method's transmittance: `|t_method - t_exact|`, or the distance outside the interval that the
    /// error bound allows. Infinite where the method's transmittance is NaN.
    pub amount: f64,
}

/// Result of testing a shadow method's transmittance along light rays against the exact transmittance and the error
/// bound.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BoundReport {
    /// Number of light rays along which a shadow method's transmittance was tested against the exact one.
    pub rays: usize,
    /// Number of depths at which a shadow method's transmittance was tested against the exact one, over all light
    /// rays.
    pub depths: usize,
    /// Largest deviation `|T_method - T_exact|` of transmittance along the light rays, ignoring the error bound's
    /// tolerances. Its amount is the column `ray_err_max` of the comparison table.
    pub largest: Option<Deviation>,
    /// Distribution of the deviations `|T_method - T_exact|` at all depths.
    deviations: Histogram,
    /// Number of depths on light rays at which the transmittance violates the shadow method's error bound.
    pub violations: usize,
    /// Number of depths on light rays at which the error bound is satisfied only if float32 rounding of the ray and
    /// of the volume's values is allowed for.
    pub limited: usize,
    /// Largest amount by which the method's transmittance lies outside the interval allowed by its error bound.
    /// Negative where all tested depths lie inside.
    pub margin: Option<f64>,
    /// Violation of the shadow method's error bound with the largest distance in transmittance from the allowed
    /// interval.
    pub worst: Option<Deviation>,
    /// Whether the shadow method states an error bound for its transmittance.
    has_bound: bool,
}

impl BoundReport {
    /// Tests a shadow method's transmittance along one light ray: `values[i]` is the method's transmittance at
    /// `depths_mm[i]`, and `exact` returns the exact transmittance from the light to any depth (mm). Without an error
    /// `bound`, only `|T_method - T_exact|` is measured.
    ///
    /// If a depth lies outside the interval of the exact curve, `envelope` is called with depths (mm, ascending). It
    /// returns the rounding envelope with values at these depths: bounds of the curves that float32 cannot
    /// distinguish from the exact one.
    ///
    /// # Panics
    /// `depths_mm` and `values` differ in length.
    pub fn of_ray(
        ray: usize,
        exact: &impl Fn(f64) -> f64,
        depths_mm: &[f64],
        values: &[f32],
        bound: Option<Bound>,
        envelope: impl FnOnce(Vec<f64>) -> Option<RoundingEnvelope>,
    ) -> Self {
        assert_eq!(depths_mm.len(), values.len(), "one value a depth");
        let mut report =
            Self { rays: 1, depths: depths_mm.len(), has_bound: bound.is_some(), ..Self::default() };
        let mut suspects = Vec::new();
        for (&z, &value) in depths_mm.iter().zip(values) {
            let (t_method, t_exact) = (f64::from(value), exact(z));
            let deviation = |amount: f64| Deviation {
                ray,
                depth_mm: z,
                t_method,
                t_exact,
                amount: if amount.is_nan() { f64::INFINITY } else { amount },
            };
            let plain = deviation((t_method - t_exact).abs());
            report.largest = worse(report.largest, Some(plain));
            report.deviations.add(plain.amount);
            let Some(bound) = bound else { continue };
            let interval = [exact(z + bound.depth_mm), exact(z - bound.depth_mm)];
            let outside = deviation(bound.distance(t_method, interval));
            if outside.amount > EXACT_ROUNDING {
                suspects.push(outside);
            } else {
                report.margin = larger(report.margin, Some(outside.amount));
            }
        }
        let Some(bound) = bound.filter(|_| !suspects.is_empty()) else { return report };
        let mut known: Vec<f64> = suspects
            .iter()
            .flat_map(|s| [s.depth_mm - bound.depth_mm, s.depth_mm + bound.depth_mm])
            .collect();
        sort_distinct(&mut known);
        let envelope = envelope(known);
        for suspect in suspects {
            let (z, t) = (suspect.depth_mm, suspect.t_method);
            let outside = envelope.as_ref().map_or(suspect.amount, |envelope| {
                bound.distance(t, [envelope.least(z + bound.depth_mm), envelope.most(z - bound.depth_mm)])
            });
            report.margin = larger(report.margin, Some(outside));
            if outside > EXACT_ROUNDING {
                report.violations += 1;
                report.worst = worse(report.worst, Some(Deviation { amount: outside, ..suspect }));
            } else {
                report.limited += 1;
            }
        }
        report
    }

    /// Merges two reports on errors of transmittance from two sets of light rays. The order of merging does not
    /// matter.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            depths: self.depths + other.depths,
            largest: worse(self.largest, other.largest),
            deviations: self.deviations.merge(&other.deviations),
            violations: self.violations + other.violations,
            limited: self.limited + other.limited,
            margin: larger(self.margin, other.margin),
            worst: worse(self.worst, other.worst),
            has_bound: self.has_bound || other.has_bound,
        }
    }

    /// Adds the report on errors of transmittance from other light rays.
    pub fn add(&mut self, other: Self) {
        *self = std::mem::take(self).merge(other);
    }

    /// Returns `ray_err_max`, the largest `|T_method - T_exact|` (T: transmittance) along light rays; `None` where no
    /// depth was tested.
    pub fn ray_err_max(&self) -> Option<f64> {
        self.largest.map(|m| m.amount)
    }

    /// Returns `ray_err_p999`, the 99.9th percentile of `|T_method - T_exact|` (T: transmittance) over the depths on light
    /// rays, rounded up by at most 1 %; `None` where no depth was tested.
    pub fn ray_err_p999(&self) -> Option<f64> {
        self.deviations.percentile(0.999)
    }

    /// Returns `bound_held`: whether the shadow method's error bound is satisfied at every tested depth. `None`
    /// without an error bound or without tested depths.
    pub fn satisfied(&self) -> Option<bool> {
        (self.has_bound && self.depths > 0).then_some(self.violations == 0)
    }
}

fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).max_by(f64::total_cmp)
}

/// Returns the larger of two deviations from the exact transmittance. Ties go to the smaller light ray index, then to
/// the smaller depth.
fn worse(a: Option<Deviation>, b: Option<Deviation>) -> Option<Deviation> {
    match (a, b) {
        (Some(a), Some(b)) => {
            let order = b.amount.total_cmp(&a.amount);
            let order = order.then(a.ray.cmp(&b.ray)).then(a.depth_mm.total_cmp(&b.depth_mm));
            Some(if order.is_le() { a } else { b })
        }
        (a, b) => a.or(b),
    }
}

/// Counts of transmittance values that cannot be physical: not monotone, outside `[0, 1]` or not finite.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sanity {
    /// Number of transmittance values that increase along a light ray: they exceed the smallest value nearer to the
    /// light by more than a tolerance.
    pub monotone_violations: usize,
    /// Largest increase of transmittance along a light ray, over the smallest value nearer to the light. Increases
    /// within the tolerance count too.
    pub largest_rise: f64,
    /// Number of finite transmittance values along light rays that lie outside `[0, 1]` by more than a tolerance.
    pub out_of_range: usize,
    /// Number of transmittance values along light rays that are NaN or infinite.
    pub non_finite: usize,
}

impl Sanity {
    /// Counts unphysical transmittance values of one light ray at ascending depths. The two tolerances are for the
    /// range `[0, 1]` and for increases with depth. An increase is measured from the smallest value at least
    /// `apart_mm` nearer to the light; many small increases thus add up.
    pub fn of_ray(depths_mm: &[f64], values: &[f32], [range, rise]: [f64; 2], apart_mm: f64) -> Self {
        let finite = || depths_mm.iter().zip(values).filter(|(_, v)| v.is_finite());
        let mut found = Self { non_finite: values.len() - finite().count(), ..Self::default() };
        let mut before = finite().peekable();
        let mut smallest = f64::INFINITY;
        for (z, value) in finite().map(|(z, v)| (z, f64::from(*v))) {
            while let Some((_, v)) = before.next_if(|(nearer, _)| **nearer <= z - apart_mm) {
                smallest = smallest.min(f64::from(*v));
            }
            found.out_of_range += usize::from(!(-range..=1.0 + range).contains(&value));
            found.largest_rise = found.largest_rise.max(value - smallest);
            found.monotone_violations += usize::from(value - smallest > rise);
        }
        found
    }

    /// Merges two reports on unphysical transmittance values: adds the counts and takes the larger increase.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            monotone_violations: self.monotone_violations + other.monotone_violations,
            largest_rise: self.largest_rise.max(other.largest_rise),
            out_of_range: self.out_of_range + other.out_of_range,
            non_finite: self.non_finite + other.non_finite,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_depths::test_depths;
    use super::*;

    fn narrow() -> Bound {
        Bound { transmittance: 0.02, depth_mm: 0.1, ..Bound::default() }
    }

    /// Exact transmittance behind a thin sheet at 1 mm that stops half of the light and a uniform slab of 0.2/mm from
    /// 2 to 12 mm.
    fn exact(z: f64) -> f64 {
        let sheet = if z >= 1.0 { 0.5 } else { 1.0 };
        sheet * (-0.2 * (z - 2.0).clamp(0.0, 10.0)).exp()
    }

    fn depths() -> Vec<f64> {
        test_depths([0.0, 14.0], &[1.0, 2.0, 12.0], 200, narrow().depth_mm)
    }

    fn report(method: impl Fn(f64) -> f64, bound: Option<Bound>) -> BoundReport {
        let values: Vec<f32> = depths().iter().map(|&z| method(z) as f32).collect();
        BoundReport::of_ray(7, &exact, &depths(), &values, bound, |_| None)
    }

    #[test]
    fn the_exact_curve_satisfies_its_bound() {
        let r = report(exact, Some(narrow()));
        assert_eq!((r.satisfied(), r.rays, r.depths, r.violations), (Some(true), 1, 200, 0));
        assert!(r.ray_err_max().unwrap() < 1e-7, "float32 rounding alone");
        assert_eq!(r.worst, None);
    }

    #[test]
    fn without_a_bound_there_is_no_verdict() {
        let r = report(|z| exact(z) - 0.4, None);
        assert_eq!((r.satisfied(), r.violations), (None, 0));
        assert!((r.ray_err_max().unwrap() - 0.4).abs() < 1e-7);
        assert_eq!(BoundReport::of_ray(0, &exact, &[], &[], Some(narrow()), |_| None).satisfied(), None);
    }

    #[test]
    fn a_jump_misplaced_within_the_depth_tolerance_is_no_violation() {
        // `ray_err_max` stays plain: half of the light is missed either way.
        for (shift, satisfied) in [(0.099, true), (-0.099, true), (0.102, false), (-0.102, false)] {
            let r = report(|z| exact(z - shift), Some(narrow()));
            assert_eq!(r.satisfied(), Some(satisfied), "jump misplaced by {shift} mm");
            assert!(r.ray_err_max().unwrap() > 0.45);
        }
    }

    #[test]
    fn a_planted_offset_comes_out_with_its_place() {
        for sign in [1.0, -1.0] {
            // At the far end the curve is flat, so the interval is purely vertical.
            let r = report(|z| exact(z) + if z > 13.5 { sign * 0.05 } else { 0.0 }, Some(narrow()));
            let worst = r.worst.unwrap();
            assert_eq!(r.satisfied(), Some(false));
            assert_eq!(r.violations, depths().iter().filter(|&&z| z > 13.5).count());
            assert!((worst.amount - 0.03).abs() < 1e-7, "{worst:?}");
            assert_eq!((worst.ray, worst.depth_mm > 13.5), (7, true));
            assert!((r.ray_err_max().unwrap() - 0.05).abs() < 1e-7);
        }
    }

    #[test]
    fn nan_violates_any_bound() {
        let r = report(|z| if z == 1.0 { f64::NAN } else { exact(z) }, Some(narrow()));
        assert_eq!((r.satisfied(), r.violations, r.ray_err_max()), (Some(false), 1, Some(f64::INFINITY)));
        assert_eq!(r.worst.unwrap().depth_mm, 1.0);
    }

    #[test]
    fn merging_is_the_same_in_any_order() {
        let rays: Vec<BoundReport> = (0..4)
            .map(|ray| {
                let offset = [0.03, 0.06, 0.06, 0.0][ray];
                BoundReport::of_ray(
                    ray,
                    &exact,
                    &[0.0, 13.0],
                    &[1.0, (exact(13.0) + offset) as f32],
                    Some(narrow()),
                    |_| None,
                )
            })
            .collect();
        let forwards = rays.iter().cloned().fold(BoundReport::default(), BoundReport::merge);
        let backwards = rays.iter().rev().cloned().fold(BoundReport::default(), BoundReport::merge);
        assert_eq!(forwards, backwards);
        assert_eq!((forwards.worst.unwrap().ray, forwards.violations, forwards.depths), (1, 3, 8));
        assert_eq!(forwards.satisfied(), Some(false));
    }

    #[test]
    fn the_envelope_widens_the_interval_and_no_more() {
        // A jump that one of two curves has at 1 mm and the other at 1.5 mm.
        let jumps = [1.0, 1.5].map(|at| move |z: f64| if z >= at { 0.7 } else { 0.0 });
        let near = |depths: Vec<f64>| RoundingEnvelope::of(&jumps, depths);
        let one = near(vec![0.5, 1.0, 1.2, 1.5, 2.0]);
        assert_eq!([one.least(0.5), one.most(0.5)], [1.0, 1.0]);
        assert!((one.least(1.2) - (-0.7f64).exp()).abs() < 1e-12 && one.most(1.2) == 1.0);
        // For two taps with different depths, the envelope is the mean.
        let both = RoundingEnvelope::mean(vec![one, near(vec![0.1, 3.0])]);
        assert!((both.least(1.2) - (-0.7f64).exp()).abs() < 1e-12);
        assert_eq!(both.most(1.2), 1.0);
        let suspect = |t: f32, near: Option<RoundingEnvelope>| {
            BoundReport::of_ray(0, &exact, &[1.2], &[t], Some(narrow()), |_| near)
        };
        let outside = (exact(1.2) + 0.1) as f32;
        assert_eq!(suspect(outside, None).violations, 1);
        let excused = suspect(outside, Some(both.clone()));
        assert_eq!((excused.violations, excused.limited, excused.satisfied()), (0, 1, Some(true)));
        assert_eq!(suspect(f32::NAN, Some(both)).violations, 1);
    }

    #[test]
    fn sanity_counts_rises_range_and_non_numbers() {
        let of = |values: &[f32], tolerance: f64| {
            let depths: Vec<f64> = (0..values.len()).map(|i| i as f64).collect();
            Sanity::of_ray(&depths, values, [tolerance; 2], 0.0)
        };
        let good = of(&[1.0, 1.0, 0.5, 0.5, 0.0], 0.0);
        assert_eq!(good, Sanity::default());
        let bad = of(&[1.5, 0.5, 0.75, f32::NAN, 0.625, 0.25, -0.5, f32::INFINITY], 0.0);
        assert_eq!(
            bad,
            Sanity { monotone_violations: 2, largest_rise: 0.25, out_of_range: 2, non_finite: 2 }
        );
        // Each step is within the tolerance, but the total increase is not.
        let creep: Vec<f32> = (0..8).map(|i| 0.5 + 0.0078125 * i as f32).collect();
        let found = of(&creep, 0.01);
        assert_eq!((found.monotone_violations, found.largest_rise), (6, 0.0546875));
        assert_eq!(good.merge(bad).merge(found).monotone_violations, 8);
    }

    #[test]
    fn rises_count_between_depths_that_are_apart() {
        let rises = |depths: &[f64], values: &[f32]| {
            let found = Sanity::of_ray(depths, values, [1e-6, 1e-3], 0.1);
            (found.monotone_violations, (1e6 * found.largest_rise).round())
        };
        assert_eq!(rises(&[0.0, 0.01, 1.0], &[0.5, 0.6, 0.5]), (0, 0.0), "nearer than 0.1");
        assert_eq!(rises(&[0.0, 0.2, 1.0], &[0.5, 0.6, 0.5]), (1, 100_000.0));
        // A slow increase with small or close steps: the values at 0.1 and 0.12 follow 0.5.
        assert_eq!(rises(&[0.0, 0.06, 0.1, 0.12], &[0.5, 0.5005, 0.5008, 0.5015]).0, 1);
        assert_eq!(rises(&[0.0, 1.0, 2.0], &[0.5, f32::NAN, 0.7]), (1, 200_000.0));
        assert_eq!(rises(&[0.0, 1.0, 2.0], &[0.5, f32::NEG_INFINITY, 0.5]).0, 0);
    }
}
