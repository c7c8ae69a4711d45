//! Adaptive sampling of an opacity or colour function, so that interpolation between the samples is within a
//! tolerance.

use super::curve::LimitSide;

/// Sample of an opacity or colour function: a scalar value, and the opacity or colour there.
pub type SamplePoint<const N: usize> = (f64, [f64; N]);

/// Opacity or colour function to be sampled, with the interpolation between samples and the measure of its error.
pub struct Sampled<'a, const N: usize> {
    /// Scalar values at which the opacity or colour function may bend or jump: ascending, distinct, at least one.
    pub breaks: Vec<f64>,
    /// Opacity or colour function to be sampled, evaluated at a scalar value from a given side.
    pub at: &'a dyn Fn(f64, LimitSide) -> [f64; N],
    /// Function that interpolates between two samples of an opacity or colour function; its last argument is the
    /// weight of the second sample.
    pub between: fn(&[f64; N], &[f64; N], f64) -> [f64; N],
    /// Function that measures the error of an interpolated opacity or colour (second argument) against the exact one
    /// (first), in units of the tolerance.
    pub error: &'a dyn Fn(&[f64; N], &[f64; N]) -> f64,
}

/// Largest number of successive bisections of the range between two breakpoints of the sampled opacity or colour
/// function.
const MOST_HALVINGS: u32 = 12;
/// Largest number of samples of an opacity or colour function. It bounds the memory that reading a file can take.
const MOST_POINTS: usize = 1 << 17;
/// Number of equal parts into which the range between two samples is divided. The interpolation error is evaluated at
/// the points between the parts.
const PROBES: u32 = 8;

impl<const N: usize> Sampled<'_, N> {
    /// Samples the opacity or colour function with at most `most` points (at least 2). It also returns the largest
    /// interpolation error, in units of the tolerance.
    pub fn points(&self, most: usize) -> (Vec<SamplePoint<N>>, f64) {
        let all = self.within_tolerance();
        let mut points = all.clone();
        let mut allowed = 1.0;
        while points.len() > most && allowed < 1e6 {
            points = self.thinned(&all, allowed);
            allowed *= 2.0;
        }
        // Only a function with a step at every point cannot be thinned enough.
        points.truncate(most.max(2));
        let worst = self.worst(&points);
        (points, worst)
    }

    fn within_tolerance(&self) -> Vec<SamplePoint<N>> {
        let halvings =
            (MOST_POINTS / self.breaks.len().max(1)).checked_ilog2().unwrap_or(0).min(MOST_HALVINGS);
        let mut points: Vec<SamplePoint<N>> = Vec::new();
        for (i, value) in self.breaks.iter().enumerate() {
            let [below, from] = [LimitSide::Below, LimitSide::From].map(|side| (self.at)(*value, side));
            if below != from {
                points.push((*value, below));
            }
            points.push((*value, from));
            if let Some(next) = self.breaks.get(i + 1) {
                self.bisect(
                    (*value, from),
                    (*next, (self.at)(*next, LimitSide::Below)),
                    halvings,
                    &mut points,
                );
            }
        }
        points
    }

    /// Bisects the range between two samples of the opacity or colour function until the interpolation error is
    /// within the tolerance.
    fn bisect(&self, a: SamplePoint<N>, b: SamplePoint<N>, left: u32, points: &mut Vec<SamplePoint<N>>) {
        let middle = 0.5 * (a.0 + b.0);
        if left == 0 || middle <= a.0 || middle >= b.0 || self.worst_between(&a, &b) <= 1.0 {
            return;
        }
        let middle = (middle, (self.at)(middle, LimitSide::From));
        self.bisect(a, middle, left - 1, points);
        points.push(middle);
        self.bisect(middle, b, left - 1, points);
    }

    fn worst_between(&self, a: &SamplePoint<N>, b: &SamplePoint<N>) -> f64 {
        let error = |i: u32| {
            let share = f64::from(i) / f64::from(PROBES);
            let want = (self.at)(a.0 + (b.0 - a.0) * share, LimitSide::From);
            (self.error)(&want, &(self.between)(&a.1, &b.1, share))
        };
        (1..PROBES).map(error).fold(0.0, f64::max)
    }

    /// Returns the largest error of the interpolation between samples of an opacity or colour function, in units of
    /// the tolerance.
    pub fn worst(&self, points: &[SamplePoint<N>]) -> f64 {
        let segments = points.windows(2).filter(|w| w[1].0 > w[0].0);
        let within = segments.map(|w| self.worst_between(&w[0], &w[1]));
        // A removed break may lie between two probes.
        let breaks =
            self.breaks.iter().flat_map(|v| [LimitSide::Below, LimitSide::From].map(|side| (*v, side)));
        let at_breaks = breaks.map(|(value, side)| {
            let after = match side {
                LimitSide::Below => points.partition_point(|p| p.0 < value),
                LimitSide::From => points.partition_point(|p| p.0 <= value),
            };
            let got = match (after.checked_sub(1).map(|i| &points[i]), points.get(after)) {
                (Some(a), Some(b)) => (self.between)(&a.1, &b.1, (value - a.0) / (b.0 - a.0)),
                (Some(only), None) | (None, Some(only)) => only.1,
                (None, None) => return f64::INFINITY,
            };
            (self.error)(&(self.at)(value, side), &got)
        });
        within.chain(at_breaks).fold(0.0, f64::max)
    }

    /// Removes samples of the opacity or colour function that interpolation of the remaining ones reproduces within
    /// `allowed` tolerances. The distances between the remaining samples become as large as possible.
    fn thinned(&self, all: &[SamplePoint<N>], allowed: f64) -> Vec<SamplePoint<N>> {
        let good = |from: usize, to: usize| {
            let (a, b) = (&all[from], &all[to]);
            // No segment may contain a jump.
            let jumps = (from..to).any(|i| all[i].0 == all[i + 1].0 && to > from + 1);
            let between = |p: &SamplePoint<N>| (self.between)(&a.1, &b.1, (p.0 - a.0) / (b.0 - a.0));
            !jumps && all[from + 1..to].iter().all(|p| (self.error)(&p.1, &between(p)) <= allowed)
        };
        let mut thinned = vec![all[0]];
        let mut from = 0;
        while from + 1 < all.len() {
            let mut step = 1;
            while from + 2 * step < all.len() && good(from, from + 2 * step) {
                step *= 2;
            }
            let (mut low, mut high) = (from + step, (from + 2 * step).min(all.len()));
            while high - low > 1 {
                let middle = low + (high - low) / 2;
                if good(from, middle) { low = middle } else { high = middle }
            }
            thinned.push(all[low]);
            from = low;
        }
        thinned
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve::{NodeCurve, linear};
    use super::*;

    fn sampled<'a>(curve: &'a dyn Fn(f64, LimitSide) -> [f64; 1], breaks: &[f64]) -> Sampled<'a, 1> {
        Sampled {
            breaks: breaks.to_vec(),
            at: curve,
            between: linear,
            error: &|want, got| (want[0] - got[0]).abs() / 1e-3,
        }
    }

    #[test]
    fn straight_parts_keep_their_points_and_bent_ones_get_enough() {
        let straight =
            NodeCurve::through([(0.0, [0.0]), (1.0, [3.0]), (1.0, [1.0]), (4.0, [2.0])].into_iter());
        let at = |v: f64, side: LimitSide| straight.at(v, side);
        let (points, worst) = sampled(&at, &[0.0, 1.0, 4.0]).points(100);
        assert_eq!(points, [(0.0, [0.0]), (1.0, [3.0]), (1.0, [1.0]), (4.0, [2.0])]);
        assert!(worst < 1e-9);
        let square = |v: f64, _: LimitSide| [v * v];
        let (points, worst) = sampled(&square, &[0.0, 1.0]).points(1000);
        assert!(worst <= 1.0 && (16..40).contains(&points.len()), "{worst} {}", points.len());
        let (points, worst) = sampled(&square, &[0.0, 1.0]).points(6);
        assert!(points.len() <= 6 && (2.0..60.0).contains(&worst), "{worst} {}", points.len());
        assert_eq!((points[0].0, points[points.len() - 1].0), (0.0, 1.0));
    }
}
