//! Whether a method's transmittance stays within the band that it promises around the exact curve.
//!
//! Transmittance never rises with depth, so a tolerance of `b` in value and `d` in depth is the band
//! `T_exact(z + d) - b <= T_method(z) <= T_exact(z - d) + b`. At a jump of the transfer function no sampled
//! method can hold a purely vertical bound; the depth tolerance is what makes a promise possible there.
//!
//! Where the ray grazes a surface, float32 decides whether it meets it: a promise then speaks of the rays and values that
//! float32 cannot tell from the exact ones (`Bound::lateral_mm`, `Bound::value`), and depths that are outside the band of
//! the exact curve are held against a [`Neighbourhood`] of curves. How many there were is counted.

use crate::shadow::Bound;
use serde::Serialize;

/// Slack for the exact curve's own rounding, in transmittance.
pub const EXACT_ROUNDING: f64 = 1e-12;

/// Transmittance from the light to depth `z` (mm) along one light ray.
///
/// It must answer for every `z`: 1 before the ray meets anything, and what is left after the last of it beyond.
pub trait Curve {
    /// Transmittance at the depth `z`, mm.
    fn transmittance(&self, z: f64) -> f64;
}

impl<F: Fn(f64) -> f64> Curve for F {
    fn transmittance(&self, z: f64) -> f64 {
        self(z)
    }
}

/// The mean of several curves: what a pre-filtered map answers to. Of no curves it is 1, nothing in the way.
#[derive(Debug, Clone)]
pub struct MeanCurve<C>(pub Vec<C>);

impl<C: Curve> Curve for MeanCurve<C> {
    fn transmittance(&self, z: f64) -> f64 {
        if self.0.is_empty() {
            return 1.0;
        }
        self.0.iter().map(|c| c.transmittance(z)).sum::<f64>() / self.0.len() as f64
    }
}

/// Transmittances between which any curve lies that follows, from stretch to stretch, one or another of some curves; of
/// several sets of curves, the means of these.
#[derive(Debug, Clone)]
pub struct Neighbourhood(Vec<Envelope>);

/// The least and the largest transmittance at each of some depths (mm, ascending).
#[derive(Debug, Clone)]
struct Envelope {
    depths_mm: Vec<f64>,
    range: Vec<[f64; 2]>,
}

impl Neighbourhood {
    /// Builds the neighbourhood of some curves of optical depth, which may change places at `depths_mm` (ascending).
    pub fn of(optical_depths: &[impl Fn(f64) -> f64], depths_mm: Vec<f64>) -> Self {
        let mut range = Vec::with_capacity(depths_mm.len());
        let mut before: Vec<f64> = vec![0.0; optical_depths.len()];
        let [mut least, mut most] = [0.0, 0.0];
        for &z in &depths_mm {
            let here: Vec<f64> = optical_depths.iter().map(|curve| curve(z)).collect();
            let steps = || here.iter().zip(&before).map(|(b, a)| (b - a).max(0.0));
            least += steps().fold(f64::INFINITY, f64::min);
            most += steps().fold(0.0, f64::max);
            range.push([(-most).exp(), (-least).exp()]);
            before = here;
        }
        Self(vec![Envelope { depths_mm, range }])
    }

    /// The mean of several: what a pre-filtered map's curves lie around.
    pub fn mean(all: Vec<Self>) -> Self {
        Self(all.into_iter().flat_map(|n| n.0).collect())
    }

    fn mean_of(&self, of: impl Fn(&Envelope) -> f64) -> f64 {
        self.0.iter().map(of).sum::<f64>() / self.0.len().max(1) as f64
    }

    /// The least transmittance at a depth (that of the next one further on that it was made for).
    fn least(&self, z: f64) -> f64 {
        self.mean_of(|e| {
            let i = e.depths_mm.partition_point(|d| *d < z);
            e.range.get(i).or(e.range.last()).map_or(0.0, |r| r[0])
        })
    }

    /// The largest (that of the next one nearer).
    fn most(&self, z: f64) -> f64 {
        self.mean_of(|e| {
            let i = e.depths_mm.partition_point(|d| *d <= z);
            i.checked_sub(1).map_or(1.0, |i| e.range[i][1])
        })
    }
}

/// One depth of one ray, and how far off the method is there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Miss {
    /// Number of the ray, passed to [`BandReport::of_ray`].
    pub ray: usize,
    /// Along the ray, mm.
    pub depth_mm: f64,
    /// The method's transmittance.
    pub t_method: f64,
    /// The exact curve at this very depth.
    pub t_exact: f64,
    /// The amount concerned: `|t_method - t_exact|`, or the distance outside the band. Infinite where the
    /// method's value is not a number.
    pub amount: f64,
}

/// Accumulated result of testing a method's transmittance along rays against the exact curves and the band.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct BandReport {
    /// Rays tested.
    pub rays: usize,
    /// Depths tested, over all rays.
    pub depths: usize,
    /// The largest plain difference; its amount is `ray_err_max`.
    pub largest: Option<Miss>,
    /// Depths outside the band.
    pub violations: usize,
    /// Depths that are in the band of a curve that float32 cannot tell from the exact one, but not in that one's own.
    pub limited: usize,
    /// How far outside the band the worst depth is; negative inside.
    pub margin: Option<f64>,
    /// The depth farthest outside the band.
    pub worst: Option<Miss>,
    /// Whether a promise was tested.
    promised: bool,
}

impl BandReport {
    /// Tests one ray: `values[i]` is the method's transmittance at `depths_mm[i]`. Without a `band` only the
    /// plain difference is taken.
    ///
    /// # Panics
    /// If the two slices differ in length.
    pub fn of_ray(
        ray: usize,
        exact: &impl Curve,
        depths_mm: &[f64],
        values: &[f32],
        band: Option<Bound>,
    ) -> Self {
        Self::of_ray_among(ray, exact, depths_mm, values, band, |_| None)
    }

    /// Tests one ray like [`Self::of_ray`], also against the curves that float32 cannot tell from the exact one.
    /// `neighbours` is asked for these where a depth lies outside the band of the exact curve, with the depths (mm,
    /// ascending) at which they must be known.
    ///
    /// # Panics
    /// If the two slices differ in length.
    pub fn of_ray_among(
        ray: usize,
        exact: &impl Curve,
        depths_mm: &[f64],
        values: &[f32],
        band: Option<Bound>,
        neighbours: impl FnOnce(Vec<f64>) -> Option<Neighbourhood>,
    ) -> Self {
        assert_eq!(depths_mm.len(), values.len(), "one value a depth");
        let mut report =
            Self { rays: 1, depths: depths_mm.len(), promised: band.is_some(), ..Self::default() };
        let mut suspects = Vec::new();
        for (&z, &value) in depths_mm.iter().zip(values) {
            let (t_method, t_exact) = (f64::from(value), exact.transmittance(z));
            let miss = |amount: f64| Miss {
                ray,
                depth_mm: z,
                t_method,
                t_exact,
                amount: if amount.is_nan() { f64::INFINITY } else { amount },
            };
            report.largest = worse(report.largest, Some(miss((t_method - t_exact).abs())));
            let Some(Bound { transmittance: bound, depth_mm, .. }) = band else { continue };
            let lowest = exact.transmittance(z + depth_mm) - bound;
            let highest = exact.transmittance(z - depth_mm) + bound;
            let outside = miss((lowest - t_method).max(t_method - highest));
            if outside.amount > EXACT_ROUNDING {
                suspects.push(outside);
            } else {
                report.margin = larger(report.margin, Some(outside.amount));
            }
        }
        let Some(band) = band.filter(|_| !suspects.is_empty()) else { return report };
        let mut known: Vec<f64> =
            suspects.iter().flat_map(|s| [s.depth_mm - band.depth_mm, s.depth_mm + band.depth_mm]).collect();
        sort_distinct(&mut known);
        let near = neighbours(known);
        for suspect in suspects {
            let (z, t) = (suspect.depth_mm, suspect.t_method);
            let outside = near.as_ref().map_or(suspect.amount, |near| {
                let lowest = near.least(z + band.depth_mm) - band.transmittance;
                let highest = near.most(z - band.depth_mm) + band.transmittance;
                // What is not a number is outside of everything.
                if t.is_nan() { f64::INFINITY } else { (lowest - t).max(t - highest) }
            });
            report.margin = larger(report.margin, Some(outside));
            if outside > EXACT_ROUNDING {
                report.violations += 1;
                report.worst = worse(report.worst, Some(Miss { amount: outside, ..suspect }));
            } else {
                report.limited += 1;
            }
        }
        report
    }

    /// Both reports as one; the result does not depend on the order in which rays are merged.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            depths: self.depths + other.depths,
            largest: worse(self.largest, other.largest),
            violations: self.violations + other.violations,
            limited: self.limited + other.limited,
            margin: larger(self.margin, other.margin),
            worst: worse(self.worst, other.worst),
            promised: self.promised || other.promised,
        }
    }

    /// `ray_err_max`: the largest `|T_method - T_exact|`, empty where no depth was tested.
    pub fn ray_err_max(&self) -> Option<f64> {
        self.largest.map(|m| m.amount)
    }

    /// `bound_held`: whether every depth lies in the band; empty where nothing was promised or tested.
    pub fn held(&self) -> Option<bool> {
        (self.promised && self.depths > 0).then_some(self.violations == 0)
    }
}

fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).max_by(f64::total_cmp)
}

/// The larger miss; of equal ones that of the first ray, then of the smallest depth.
fn worse(a: Option<Miss>, b: Option<Miss>) -> Option<Miss> {
    match (a, b) {
        (Some(a), Some(b)) => {
            let order = b.amount.total_cmp(&a.amount);
            let order = order.then(a.ray.cmp(&b.ray)).then(a.depth_mm.total_cmp(&b.depth_mm));
            Some(if order.is_le() { a } else { b })
        }
        (a, b) => a.or(b),
    }
}

/// Violations of properties that any transmittance has, bound or no bound: monotone, within `[0, 1]`, finite.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Sanity {
    /// Values above the smallest one before them by more than the tolerance.
    pub monotone_violations: usize,
    /// The largest such rise, tolerated ones included.
    pub largest_rise: f64,
    /// Finite values outside `[0, 1]` by more than the tolerance.
    pub out_of_range: usize,
    /// Values that are NaN or infinite.
    pub non_finite: usize,
}

impl Sanity {
    /// Checks one ray's values, in order of depth. A rise is measured from the smallest value so far, so that a
    /// slow creep cannot stay under the tolerance at every step.
    pub fn of_ray(values: &[f32], tolerance: f64) -> Self {
        let mut found = Self::default();
        let mut smallest = f64::INFINITY;
        for value in values.iter().map(|&v| f64::from(v)) {
            if !value.is_finite() {
                found.non_finite += 1;
                continue;
            }
            if value < -tolerance || value > 1.0 + tolerance {
                found.out_of_range += 1;
            }
            let rise = value - smallest;
            if rise > tolerance {
                found.monotone_violations += 1;
            }
            found.largest_rise = found.largest_rise.max(rise);
            smallest = smallest.min(value);
        }
        found
    }

    /// Both as one.
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

/// Offsets around a jump, in units of the depth tolerance: on it, a rounding away, inside the tolerance, and on
/// both sides of its edge, where a jump put too far off shows.
const JUMP_OFFSETS: [f64; 17] =
    [0.0, -1e-6, 1e-6, -1e-3, 1e-3, -0.1, 0.1, -0.5, 0.5, -1.0, 1.0, -1.01, 1.01, -1.1, 1.1, -1.5, 1.5];

/// Offsets are at least this share of the range where the depth tolerance is smaller.
const SMALLEST_OFFSET: f64 = 1e-6;

/// `n` sorted, distinct depths in `range_mm` to test a ray at: up to half of them around the `jumps_mm` (depths
/// where the exact curve drops or kinks) at multiples of the depth tolerance `d_mm`, the rest one in each of
/// equal strata, both ends included. The same arguments always give the same depths.
///
/// Where the jumps are too many for that, each gets some of the offsets, or evenly chosen ones get one each; which
/// offsets differs from range to range. Fewer than `n` depths come back only from a range too short to hold as
/// many different numbers; none from a reversed or infinite one.
pub fn test_depths(range_mm: [f64; 2], jumps_mm: &[f64], n: usize, d_mm: f64) -> Vec<f64> {
    let [start, end] = range_mm;
    let length = end - start;
    if !length.is_finite() || length < 0.0 || n == 0 {
        return Vec::new();
    }
    let unit = d_mm.max(SMALLEST_OFFSET * length);
    let jumps: Vec<f64> = jumps_mm.iter().copied().filter(|z| (start..=end).contains(z)).collect();
    let mut depths = Vec::with_capacity(2 * n);
    let slots = (n / 2).min(jumps.len() * JUMP_OFFSETS.len());
    // Where not every jump can have every offset, rays take different ones.
    let phase = (super::rays::mix(start.to_bits() ^ end.to_bits()) % JUMP_OFFSETS.len() as u64) as usize;
    for slot in 0..slots {
        let jump = jumps[slot * jumps.len() / slots];
        let z = jump + JUMP_OFFSETS[(slot + phase) % JUMP_OFFSETS.len()] * unit;
        if (start..=end).contains(&z) {
            depths.push(z);
        }
    }
    sort_distinct(&mut depths);

    // Depths may coincide, so strata are refined until the number is right; the surplus goes evenly.
    let wanted = n - depths.len();
    let mut uniform = stratified(range_mm, wanted);
    uniform.retain(|z| depths.binary_search_by(|a| a.total_cmp(z)).is_err());
    let mut strata = wanted;
    while uniform.len() < wanted && strata < 64 * n {
        strata *= 2;
        uniform = stratified(range_mm, strata);
        uniform.retain(|z| depths.binary_search_by(|a| a.total_cmp(z)).is_err());
    }
    let available = uniform.len();
    let taken = wanted.min(available);
    depths.extend((0..taken).map(|i| uniform[i * available / taken]));
    sort_distinct(&mut depths);
    depths
}

/// One depth in each of `n` equal strata, the first and the last at the ends of the range; sorted, distinct.
fn stratified([start, end]: [f64; 2], n: usize) -> Vec<f64> {
    let mut seed = start.to_bits() ^ end.to_bits().rotate_left(32);
    let mut depths: Vec<f64> = (0..n)
        .map(|i| {
            seed = super::rays::mix(seed);
            // 53 bits make a double in [0, 1).
            let jitter = (seed >> 11) as f64 / (1_u64 << 53) as f64;
            match i {
                0 => start,
                _ if i == n - 1 => end,
                _ => (start + (end - start) * (i as f64 + jitter) / n as f64).clamp(start, end),
            }
        })
        .collect();
    sort_distinct(&mut depths);
    depths
}

fn sort_distinct(depths: &mut Vec<f64>) {
    depths.sort_by(f64::total_cmp);
    depths.dedup();
}

#[cfg(test)]
mod tests {
    use super::*;

    const BAND: Bound =
        Bound { transmittance: 0.02, depth_mm: 0.1, lateral_mm: 0.0, value: 0.0, from_light_mm: 0.0 };

    /// A uniform slab of 0.2/mm from 2 to 12 mm behind a thin sheet at 1 mm that stops half of the light.
    fn exact(z: f64) -> f64 {
        let sheet = if z >= 1.0 { 0.5 } else { 1.0 };
        sheet * (-0.2 * (z - 2.0).clamp(0.0, 10.0)).exp()
    }

    fn depths() -> Vec<f64> {
        test_depths([0.0, 14.0], &[1.0, 2.0, 12.0], 200, BAND.depth_mm)
    }

    fn report(method: impl Fn(f64) -> f64, band: Option<Bound>) -> BandReport {
        let values: Vec<f32> = depths().iter().map(|&z| method(z) as f32).collect();
        BandReport::of_ray(7, &exact, &depths(), &values, band)
    }

    #[test]
    fn the_exact_curve_itself_is_in_the_band() {
        let r = report(exact, Some(BAND));
        assert_eq!((r.held(), r.rays, r.depths, r.violations), (Some(true), 1, 200, 0));
        assert!(r.ray_err_max().unwrap() < 1e-7, "float32 rounding alone");
        assert_eq!(r.worst, None);
    }

    #[test]
    fn nothing_promised_nothing_held() {
        let r = report(|z| exact(z) - 0.4, None);
        assert_eq!((r.held(), r.violations), (None, 0));
        assert!((r.ray_err_max().unwrap() - 0.4).abs() < 1e-7);
        assert_eq!(BandReport::of_ray(0, &exact, &[], &[], Some(BAND)).held(), None);
    }

    #[test]
    fn a_jump_misplaced_within_the_depth_tolerance_is_held_and_beyond_it_is_not() {
        // `ray_err_max` stays plain: half of the light is missed either way.
        for (shift, held) in [(0.099, true), (-0.099, true), (0.102, false), (-0.102, false)] {
            let r = report(|z| exact(z - shift), Some(BAND));
            assert_eq!(r.held(), Some(held), "jump misplaced by {shift} mm");
            assert!(r.ray_err_max().unwrap() > 0.45);
        }
    }

    #[test]
    fn a_planted_offset_comes_out_with_its_place() {
        for sign in [1.0, -1.0] {
            // At the far end the curve is flat, so the band is purely vertical.
            let r = report(|z| exact(z) + if z > 13.5 { sign * 0.05 } else { 0.0 }, Some(BAND));
            let worst = r.worst.unwrap();
            assert_eq!(r.held(), Some(false));
            assert_eq!(r.violations, depths().iter().filter(|&&z| z > 13.5).count());
            assert!((worst.amount - 0.03).abs() < 1e-7, "{worst:?}");
            assert_eq!((worst.ray, worst.depth_mm > 13.5), (7, true));
            assert!((r.ray_err_max().unwrap() - 0.05).abs() < 1e-7);
        }
    }

    #[test]
    fn not_a_number_violates_any_band() {
        let r = report(|z| if z == 1.0 { f64::NAN } else { exact(z) }, Some(BAND));
        assert_eq!((r.held(), r.violations, r.ray_err_max()), (Some(false), 1, Some(f64::INFINITY)));
        assert_eq!(r.worst.unwrap().depth_mm, 1.0);
    }

    #[test]
    fn merging_is_the_same_in_any_order() {
        let rays: Vec<BandReport> = (0..4)
            .map(|ray| {
                let offset = [0.03, 0.06, 0.06, 0.0][ray];
                BandReport::of_ray(
                    ray,
                    &exact,
                    &[0.0, 13.0],
                    &[1.0, (exact(13.0) + offset) as f32],
                    Some(BAND),
                )
            })
            .collect();
        let forwards = rays.iter().copied().fold(BandReport::default(), BandReport::merge);
        let backwards = rays.iter().rev().copied().fold(BandReport::default(), BandReport::merge);
        assert_eq!(forwards, backwards);
        assert_eq!((forwards.worst.unwrap().ray, forwards.violations, forwards.depths), (1, 3, 8));
        assert_eq!(forwards.held(), Some(false));
    }

    #[test]
    fn neighbouring_curves_widen_the_band_and_no_more() {
        // A jump that one of two curves has at 1 mm and the other at 1.5 mm.
        let jumps = [1.0, 1.5].map(|at| move |z: f64| if z >= at { 0.7 } else { 0.0 });
        let near = |depths: Vec<f64>| Neighbourhood::of(&jumps, depths);
        let one = near(vec![0.5, 1.0, 1.2, 1.5, 2.0]);
        assert_eq!([one.least(0.5), one.most(0.5)], [1.0, 1.0]);
        assert!((one.least(1.2) - (-0.7f64).exp()).abs() < 1e-12 && one.most(1.2) == 1.0);
        // Of two taps with depths of their own the means.
        let both = Neighbourhood::mean(vec![one, near(vec![0.1, 3.0])]);
        assert!((both.least(1.2) - (-0.7f64).exp()).abs() < 1e-12);
        assert_eq!(both.most(1.2), 1.0);
        let suspect = |t: f32, near: Option<Neighbourhood>| {
            BandReport::of_ray_among(0, &exact, &[1.2], &[t], Some(BAND), |_| near)
        };
        let outside = (exact(1.2) + 0.1) as f32;
        assert_eq!(suspect(outside, None).violations, 1);
        let excused = suspect(outside, Some(both.clone()));
        assert_eq!((excused.violations, excused.limited, excused.held()), (0, 1, Some(true)));
        assert_eq!(suspect(f32::NAN, Some(both)).violations, 1);
    }

    #[test]
    fn mean_of_curves() {
        let sheets: Vec<_> = [1.0, 2.0].map(|at| move |z: f64| if z >= at { 0.0 } else { 1.0 }).into();
        let mean = MeanCurve(sheets);
        assert_eq!([0.5, 1.5, 2.5].map(|z| mean.transmittance(z)), [1.0, 0.5, 0.0]);
        assert_eq!(MeanCurve(Vec::<fn(f64) -> f64>::new()).transmittance(3.0), 1.0);
    }

    #[test]
    fn sanity_counts_rises_range_and_non_numbers() {
        let good = Sanity::of_ray(&[1.0, 1.0, 0.5, 0.5, 0.0], 0.0);
        assert_eq!(good, Sanity::default());
        let bad = Sanity::of_ray(&[1.5, 0.5, 0.75, f32::NAN, 0.625, 0.25, -0.5, f32::INFINITY], 0.0);
        assert_eq!(
            bad,
            Sanity { monotone_violations: 2, largest_rise: 0.25, out_of_range: 2, non_finite: 2 }
        );
        // Each step is under the tolerance, the creep is not.
        let creep: Vec<f32> = (0..8).map(|i| 0.5 + 0.0078125 * i as f32).collect();
        let found = Sanity::of_ray(&creep, 0.01);
        assert_eq!((found.monotone_violations, found.largest_rise), (6, 0.0546875));
        assert_eq!(good.merge(bad).merge(found).monotone_violations, 8);
    }

    #[test]
    fn depths_are_sorted_distinct_inside_and_as_many_as_asked() {
        let many: Vec<f64> = (0..500).map(|i| 0.1 * f64::from(i)).collect();
        for jumps in [&[][..], &[1.0], &[0.0, 50.0], &[-3.0, 99.0], &many] {
            for (n, d) in [(200, 0.1), (200, 0.0), (7, 0.1), (1, 0.1), (2, 1e9)] {
                let z = test_depths([0.0, 50.0], jumps, n, d);
                assert_eq!(z.len(), n, "{} jumps, n {n}, d {d}", jumps.len());
                assert!(z.windows(2).all(|w| w[0] < w[1]));
                assert!(z[0] >= 0.0 && z[n - 1] <= 50.0);
                assert_eq!(z, test_depths([0.0, 50.0], jumps, n, d), "deterministic");
            }
        }
        assert!(test_depths([1.0, 0.0], &[], 9, 0.1).is_empty());
        assert!(test_depths([0.0, f64::NAN], &[], 9, 0.1).is_empty());
        assert_eq!(test_depths([2.0, 2.0], &[2.0], 9, 0.1), [2.0]);
    }

    #[test]
    fn depths_are_dense_around_jumps_and_cover_the_range() {
        let z = depths();
        for jump in [1.0, 2.0, 12.0] {
            for offset in [0.0, -1e-7, 1e-7, -0.01, 0.01, -0.05, 0.05, -0.1, 0.1, -0.11, 0.11, -0.15, 0.15] {
                assert!(z.iter().any(|z| (z - jump - offset).abs() < 1e-12), "{jump} {offset:+}");
            }
        }
        assert_eq!((z[0], z[199]), (0.0, 14.0));
        let widest = z.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        assert!(widest < 2.0 * 14.0 / 100.0, "no gap wider than two strata: {widest}");
    }

    #[test]
    fn jumps_share_the_room_where_there_is_too_little() {
        let jumps: Vec<f64> = (1..=10).map(f64::from).collect();
        let z = test_depths([0.0, 11.0], &jumps, 60, 0.1);
        for jump in jumps {
            assert!(z.iter().any(|z| (z - jump).abs() <= 0.15 + 1e-12), "none near {jump}");
        }
        // Another range, other offsets.
        assert_ne!(z[..30], test_depths([0.0, 11.5], &[1.0], 60, 0.1)[..30]);
    }
}
