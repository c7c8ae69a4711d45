//! Detection of numerical faults of a method on a stability case.

use crate::measure::band::{BandReport, Sanity};
use crate::shadow::{Bound, Curve};
use serde::Serialize;

/// The column `status`, from good to bad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Nothing is wrong.
    Ok,
    /// Transmittance left the promised band.
    BoundExceeded,
    /// Transmittance rose with depth.
    NotMonotone,
    /// A value was outside `[0, 1]`.
    OutOfRange,
    /// A value was not finite.
    Nan,
    /// The method could not be built, drawn or asked.
    Failed,
}

impl Status {
    /// From good to bad.
    pub const ALL: [Self; 6] =
        [Self::Ok, Self::BoundExceeded, Self::NotMonotone, Self::OutOfRange, Self::Nan, Self::Failed];

    /// Spelling of the status in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::BoundExceeded => "bound_exceeded",
            Self::NotMonotone => "not_monotone",
            Self::OutOfRange => "out_of_range",
            Self::Nan => "nan",
            Self::Failed => "failed",
        }
    }

    /// Symbol of the status in the summary.
    pub fn glyph(self) -> char {
        match self {
            Self::Ok => '✓',
            Self::BoundExceeded => 'B',
            Self::NotMonotone => 'M',
            Self::OutOfRange => 'R',
            Self::Nan => 'N',
            Self::Failed => 'F',
        }
    }
}

/// Results of one light ray test and one picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Findings {
    /// Transmittance along light rays against the exact curve.
    pub band: BandReport,
    /// Error bound that the method guarantees for transmittance along light rays, if any.
    pub promise: Option<Bound>,
    /// Sanity of transmittance along light rays, judged without the exact curve.
    pub rays: Sanity,
    /// Shape that the method's definition allows transmittance to have along a ray.
    pub curve: Curve,
    /// Channels of the picture that are not finite, and that are outside `[0, 1]`.
    pub picture_non_finite: usize,
    /// Finite channels outside `[0, 1]`.
    pub picture_out_of_range: usize,
}

/// Pictures of white light and no background lie in `[0, 1]`, but for the rounding of sums of thousands of samples.
const PICTURE_RANGE: f32 = 1e-5;

impl Findings {
    /// Counts a picture's channels.
    pub fn look_at<'a>(&mut self, channels: impl IntoIterator<Item = &'a f32>) {
        for v in channels {
            self.picture_non_finite += usize::from(!v.is_finite());
            self.picture_out_of_range +=
                usize::from(v.is_finite() && !(-PICTURE_RANGE..=1.0 + PICTURE_RANGE).contains(v));
        }
    }

    /// Non-finite values, on rays and in the picture.
    pub fn non_finite(&self) -> usize {
        self.rays.non_finite + self.picture_non_finite
    }

    /// Finite values outside `[0, 1]`, on rays and in the picture.
    pub fn out_of_range(&self) -> usize {
        self.rays.out_of_range + self.picture_out_of_range
    }

    /// The worst that is wrong.
    pub fn status(&self) -> Status {
        if self.non_finite() > 0 {
            Status::Nan
        } else if self.out_of_range() > 0 && self.curve != Curve::Rings {
            Status::OutOfRange
        } else if self.rays.monotone_violations > 0 && self.curve == Curve::Falls {
            // What a method may do by its own definition is counted and said all the same.
            Status::NotMonotone
        } else if self.band.held() == Some(false) {
            Status::BoundExceeded
        } else {
            Status::Ok
        }
    }

    /// Descriptions of all faults found, worst first; empty where there are none.
    pub fn complaints(&self) -> Vec<String> {
        let mut said = Vec::new();
        let mut count = |n: usize, what: &str| {
            if n > 0 {
                said.push(format!("{n} {what}"));
            }
        };
        count(self.rays.non_finite, "transmittances are not finite");
        count(self.picture_non_finite, "channels of the picture are not finite");
        count(self.rays.out_of_range, "transmittances are outside [0, 1]");
        count(self.picture_out_of_range, "channels of the picture are outside [0, 1]");
        if self.rays.monotone_violations > 0 {
            said.push(format!(
                "transmittance rises with depth at {} of {} depths, by up to {:.2e}",
                self.rays.monotone_violations, self.band.depths, self.rays.largest_rise
            ));
        }
        if let Some(worst) = self.band.worst {
            said.push(format!(
                "the bound is missed at {} of {} depths, by up to {:.2e} (depth {} mm: {}, exact {})",
                self.band.violations,
                self.band.depths,
                worst.amount,
                worst.depth_mm,
                worst.t_method,
                worst.t_exact
            ));
        }
        said
    }
}

/// Checks the values of one ray without the exact curve. A rise is from the smallest value that lies at least
/// `apart_mm` nearer to the light. Tolerances are of the range and of rises.
pub fn sanity(depths_mm: &[f64], values: &[f32], [range, rise]: [f64; 2], apart_mm: f64) -> Sanity {
    let mut found = Sanity { monotone_violations: 0, largest_rise: 0.0, ..Sanity::of_ray(values, range) };
    let finite = || depths_mm.iter().zip(values).filter(|(_, v)| v.is_finite());
    let mut before = finite().peekable();
    let mut smallest = f64::INFINITY;
    for (z, &value) in finite() {
        while let Some((_, &v)) = before.next_if(|(nearer, _)| **nearer <= z - apart_mm) {
            smallest = smallest.min(f64::from(v));
        }
        let here = f64::from(value) - smallest;
        found.largest_rise = found.largest_rise.max(here);
        found.monotone_violations += usize::from(here > rise);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const BAND: Bound =
        Bound { transmittance: 0.02, depth_mm: 0.1, lateral_mm: 0.0, value: 0.0, from_light_mm: 0.0 };

    /// Findings of one ray with the exact curve `exp(-z)` at depths 0, 1, 2, 3.
    fn of(values: [f32; 4], promise: Option<Bound>) -> Findings {
        let band = BandReport::of_ray(0, &|z: f64| (-z).exp(), &[0.0, 1.0, 2.0, 3.0], &values, promise);
        let rays = sanity(&[0.0, 1.0, 2.0, 3.0], &values, [1e-6, 1e-4], 0.1);
        Findings { band, promise, rays, ..Findings::default() }
    }

    const EXACT: [f32; 4] = [1.0, 0.367_88, 0.135_34, 0.049_79];

    #[test]
    fn what_is_right_is_ok() {
        let right = of(EXACT, Some(BAND));
        assert_eq!((right.status(), right.complaints()), (Status::Ok, vec![]));
        let [a, b, c, d] = EXACT;
        assert_eq!(of([a, b + 0.03, c - 0.02, d], Some(BAND)).status(), Status::Ok, "within the band");
    }

    #[test]
    fn planted_violations_come_out() {
        let [a, b, c, d] = EXACT;
        for (values, status, said) in [
            ([a, b, c - 0.06, d], Status::BoundExceeded, "missed at 1 of 4 depths"),
            (
                [a, b, c, c + 0.001],
                Status::NotMonotone,
                "rises with depth at 1 of 4 depths, by up to 1.00e-3",
            ),
            ([1.001, b, c, d], Status::OutOfRange, "1 transmittances are outside"),
            ([a, b, c, -0.01], Status::OutOfRange, "1 transmittances are outside"),
            ([a, f32::NAN, c, d], Status::Nan, "1 transmittances are not finite"),
            ([f32::INFINITY, b, c, d], Status::Nan, "1 transmittances are not finite"),
        ] {
            let found = of(values, Some(BAND));
            assert_eq!(found.status(), status, "{values:?}");
            assert!(found.complaints().iter().any(|c| c.contains(said)), "{:?}", found.complaints());
        }
    }

    #[test]
    fn a_method_is_judged_by_its_own_definition() {
        let [a, b, c, d] = EXACT;
        for (values, by_falling, by_staying, by_ringing) in [
            (EXACT, Status::Ok, Status::Ok, Status::Ok),
            ([a, b, c, c + 0.001], Status::NotMonotone, Status::Ok, Status::Ok),
            ([1.001, b, c, d], Status::OutOfRange, Status::OutOfRange, Status::Ok),
            ([a, b, f32::NAN, d], Status::Nan, Status::Nan, Status::Nan),
        ] {
            for (curve, status) in
                [(Curve::Falls, by_falling), (Curve::Stays, by_staying), (Curve::Rings, by_ringing)]
            {
                let found = Findings { curve, ..of(values, None) };
                assert_eq!(found.status(), status, "{curve:?}: {values:?}");
                assert_eq!(found.complaints().is_empty(), values == EXACT, "what is allowed is said too");
            }
        }
    }

    #[test]
    fn rises_count_between_depths_that_are_apart() {
        let rises = |depths: &[f64], values: &[f32]| {
            let found = sanity(depths, values, [1e-6, 1e-3], 0.1);
            (found.monotone_violations, (1e6 * found.largest_rise).round())
        };
        assert_eq!(rises(&[0.0, 0.01, 1.0], &[0.5, 0.6, 0.5]), (0, 0.0), "nearer than 0.1");
        assert_eq!(rises(&[0.0, 0.2, 1.0], &[0.5, 0.6, 0.5]), (1, 100_000.0));
        // A slow creep, each step of which is small or near: the values at 0.1 and 0.12 have 0.5 before them.
        assert_eq!(rises(&[0.0, 0.06, 0.1, 0.12], &[0.5, 0.5005, 0.5008, 0.5015]).0, 1);
        assert_eq!(rises(&[0.0, 1.0, 2.0], &[0.5, f32::NAN, 0.7]), (1, 200_000.0));
        assert_eq!(rises(&[0.0, 1.0, 2.0], &[0.5, f32::NEG_INFINITY, 0.5]).0, 0);
    }

    #[test]
    fn without_a_promise_an_error_is_no_fault_but_a_rise_is() {
        let far = of([1.0, 0.9, 0.8, 0.7], None);
        assert_eq!(far.status(), Status::Ok);
        assert!(far.band.ray_err_max().unwrap() > 0.6);
        assert_eq!(of([1.0, 0.8, 0.9, 0.7], None).status(), Status::NotMonotone);
    }

    #[test]
    fn the_worst_of_several_is_the_status_and_all_are_named() {
        let found = of([1.0, 0.1, 0.5, f32::NAN], Some(BAND));
        assert_eq!(found.status(), Status::Nan);
        assert_eq!(found.complaints().len(), 3);
        assert!(Status::ALL.is_sorted());
    }

    #[test]
    fn pictures_count() {
        let mut found = of(EXACT, Some(BAND));
        found.look_at(&[0.0, 1.0, 0.5, 1.000_001]);
        assert_eq!(found.status(), Status::Ok);
        found.look_at(&[1.01, 0.2, -0.5]);
        assert_eq!((found.status(), found.out_of_range()), (Status::OutOfRange, 2));
        found.look_at(&[f32::NAN, f32::NEG_INFINITY]);
        assert_eq!((found.status(), found.non_finite()), (Status::Nan, 2));
        assert!(found.complaints()[0].contains("2 channels of the picture are not finite"));
    }
}
