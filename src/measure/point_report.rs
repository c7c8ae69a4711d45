//! Result of testing at points whether a transmittance lies in the interval that a bound allows.

use super::bound_check::EXACT_ROUNDING;
use glam::DVec3;
use rayon::prelude::*;

/// Numbers of points at which a transmittance was tested, and the point with the largest violation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PointReport {
    /// Number of points at which the bound was tested.
    pub points: usize,
    /// Number of points at which the transmittance violates the bound.
    pub violations: usize,
    /// Number of points at which the bound is satisfied only if float32 rounding of the light rays and of the volume's
    /// values is allowed for.
    pub limited: usize,
    /// Largest distance of a transmittance from its interval; negative where all points lie inside.
    pub margin: Option<f64>,
    /// Violation with the largest distance from the interval.
    pub worst: Option<PointViolation>,
}

/// Point at which a transmittance lies outside the interval that a bound allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointViolation {
    /// Position of the point, world mm.
    pub position_mm: DVec3,
    /// Transmittance from the light to the point: of the method if its bound is tested, and the exact one if an
    /// enclosure is.
    pub transmittance: f64,
    /// Least and largest transmittance that the bound allows.
    pub interval: [f64; 2],
    /// Distance of the transmittance from the interval, with float32 rounding allowed for; infinite for NaN.
    pub amount: f64,
}

impl PointReport {
    /// Creates the report of points, none of which is tested yet.
    pub(crate) fn of(points: usize) -> Self {
        Self { points, ..Self::default() }
    }

    /// Records the distance of a transmittance from its interval if it lies inside, and returns whether it does.
    pub(super) fn records_inside(&mut self, amount: f64) -> bool {
        let inside = amount <= EXACT_ROUNDING;
        if inside {
            self.margin = larger(self.margin, Some(amount));
        }
        inside
    }

    /// Counts a point outside its interval, whose `amount` allows for float32 rounding.
    pub(super) fn count(&mut self, point: PointViolation) {
        self.margin = larger(self.margin, Some(point.amount));
        if point.amount > EXACT_ROUNDING {
            self.violations += 1;
            self.worst = worse(self.worst, Some(point));
        } else {
            self.limited += 1;
        }
    }

    /// Divides consecutive answers among items, and merges the reports on the items in order.
    pub(super) fn of_all<T: Sync, A: Sync>(
        items: &[T],
        answers: &[A],
        points_of: impl Fn(&T) -> usize,
        report: impl Fn(&T, &[A]) -> Self + Sync,
    ) -> Self {
        let mut rest = answers;
        let mut own = Vec::with_capacity(items.len());
        for item in items {
            let (first, others) = rest.split_at(points_of(item));
            own.push((item, first));
            rest = others;
        }
        let reports: Vec<Self> = own.into_par_iter().map(|(item, answers)| report(item, answers)).collect();
        reports.into_iter().fold(Self::default(), Self::merge)
    }

    /// Merges the reports on two sets of points. Of two equal violations, the first is kept.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            points: self.points + other.points,
            violations: self.violations + other.violations,
            limited: self.limited + other.limited,
            margin: larger(self.margin, other.margin),
            worst: worse(self.worst, other.worst),
        }
    }

    /// Returns whether the bound is satisfied at every tested point; `None` without points.
    pub fn satisfied(&self) -> Option<bool> {
        (self.points > 0).then_some(self.violations == 0)
    }

    /// Returns a note on the violations of `bound`, if there are any.
    pub fn note(&self, bound: &str) -> Option<String> {
        let PointViolation { position_mm, transmittance, interval: [least, most], amount } = self.worst?;
        let [x, y, z] = position_mm.to_array();
        Some(format!(
            "{bound} does not hold at {} of {} points; worst by {amount:.6} at ({x:.4}, {y:.4}, {z:.4}) mm: \
            {transmittance:.6} is outside {least:.6} to {most:.6}",
            self.violations, self.points,
        ))
    }
}

fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).max_by(f64::total_cmp)
}

fn worse(a: Option<PointViolation>, b: Option<PointViolation>) -> Option<PointViolation> {
    match (a, b) {
        (Some(a), Some(b)) if b.amount > a.amount => Some(b),
        (a, b) => a.or(b),
    }
}

/// Returns the distance between two intervals, negative if they overlap. NaN is infinitely far from everything.
pub(super) fn distance([a, b]: [f64; 2], [low, high]: [f64; 2]) -> f64 {
    let known = [a, b, low, high].iter().all(|end| !end.is_nan());
    if known { (low - b).max(a - high) } else { f64::INFINITY }
}
