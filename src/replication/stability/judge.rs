//! Detection of numerical faults of a shadow method in a stability case.

use crate::measure::bound_check::{BoundReport, Sanity};
use crate::measure::point_report::PointReport;
use crate::shadow::{Bound, Curve};
use serde::{Deserialize, Serialize};

/// Outcome of testing a shadow method in a stability case, from good to bad, for the column `status` of the stability
/// table.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The shadow method shows no numerical fault.
    #[default]
    Ok,
    /// The transmittance by the shadow method violates the method's error bound.
    BoundExceeded,
    /// The transmittance by the shadow method increases with depth along a light ray.
    NotMonotone,
    /// A transmittance by the shadow method, or a colour or opacity of its picture, lies outside `[0, 1]`.
    OutOfRange,
    /// A transmittance by the shadow method, or a colour or opacity of its picture, is NaN or infinite.
    Nan,
    /// The shadow method could not be built, rendered or queried.
    Failed,
}

impl Status {
    /// All possible outcomes of testing a shadow method in a stability case, from good to bad.
    pub const ALL: [Self; 6] =
        [Self::Ok, Self::BoundExceeded, Self::NotMonotone, Self::OutOfRange, Self::Nan, Self::Failed];

    /// Name and symbol of each outcome in [`Self::ALL`], for the stability table and its summary.
    const TEXTS: [(&'static str, char); 6] = [
        ("ok", '✓'),
        ("bound_exceeded", 'B'),
        ("not_monotone", 'M'),
        ("out_of_range", 'R'),
        ("nan", 'N'),
        ("failed", 'F'),
    ];

    /// Name of the outcome of testing a shadow method, as the stability table shows it.
    pub fn name(self) -> &'static str {
        Self::TEXTS[self as usize].0
    }

    /// Symbol of the outcome of testing a shadow method, as the Markdown summary of the stability table shows it.
    pub fn glyph(self) -> char {
        Self::TEXTS[self as usize].1
    }
}

/// Test results of one shadow method in a stability case with one light: along light rays and in one picture.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Findings {
    /// Errors of the shadow method's transmittance along light rays, against the exact transmittance and the error
    /// bound.
    pub check: BoundReport,
    /// Error bound that the shadow method states for transmittance along light rays, if any.
    pub bound: Option<Bound>,
    /// Error bound tested at points between the light rays of texels.
    pub points: PointReport,
    /// Enclosure of the exact transmittance (`enclose=on`), tested at points.
    pub enclosure: PointReport,
    /// Counts of transmittance values along light rays that increase with depth, lie outside `[0, 1]`, or are not
    /// finite.
    pub rays: Sanity,
    /// Shape that the shadow method's transmittance may have along a light ray by its definition, such as a monotone
    /// decrease.
    pub curve: Curve,
    /// Number of colour or opacity values in the picture that are NaN or infinite.
    pub picture_non_finite: usize,
    /// Number of finite colour or opacity values in the picture that lie outside `[0, 1]`.
    pub picture_out_of_range: usize,
}

/// Tolerance for colour and opacity values of a picture outside `[0, 1]`. It covers the rounding of sums over
/// thousands of samples under white light without background.
const PICTURE_RANGE: f32 = 1e-5;

impl Findings {
    /// Counts the colour and opacity values of a picture that are not finite or lie outside `[0, 1]`.
    pub fn check_picture<'a>(&mut self, channels: impl IntoIterator<Item = &'a f32>) {
        for v in channels {
            self.picture_non_finite += usize::from(!v.is_finite());
            self.picture_out_of_range +=
                usize::from(v.is_finite() && !(-PICTURE_RANGE..=1.0 + PICTURE_RANGE).contains(v));
        }
    }

    /// Number of NaN or infinite values, over transmittances along light rays and colour and opacity values of the
    /// picture.
    pub fn non_finite(&self) -> usize {
        self.rays.non_finite + self.picture_non_finite
    }

    /// Number of finite values outside `[0, 1]`, over transmittances along light rays and colour and opacity values
    /// of the picture.
    pub fn out_of_range(&self) -> usize {
        self.rays.out_of_range + self.picture_out_of_range
    }

    /// Returns the worst numerical fault of the shadow method. Behaviour that the method's definition permits, such
    /// as ringing, is no fault.
    pub fn status(&self) -> Status {
        if self.non_finite() > 0 {
            Status::Nan
        } else if self.out_of_range() > 0 && self.curve != Curve::Rings {
            Status::OutOfRange
        } else if self.rays.monotone_violations > 0 && self.curve == Curve::Falls {
            // Increases that the method's definition permits are counted and reported, but are not a fault.
            Status::NotMonotone
        } else if self.check.satisfied() == Some(false)
            || self.points.merge(self.enclosure).satisfied() == Some(false)
        {
            Status::BoundExceeded
        } else {
            Status::Ok
        }
    }

    /// Returns descriptions of all numerical faults of the shadow method, worst first. Empty if there are none.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let mut count = |n: usize, what: &str| {
            if n > 0 {
                faults.push(format!("{n} {what}"));
            }
        };
        count(self.rays.non_finite, "transmittances are not finite");
        count(self.picture_non_finite, "channels of the picture are not finite");
        count(self.rays.out_of_range, "transmittances are outside [0, 1]");
        count(self.picture_out_of_range, "channels of the picture are outside [0, 1]");
        if self.rays.monotone_violations > 0 {
            faults.push(format!(
                "transmittance rises with depth at {} of {} depths, by up to {:.2e}",
                self.rays.monotone_violations, self.check.depths, self.rays.largest_rise
            ));
        }
        if let Some(worst) = self.check.worst {
            faults.push(format!(
                "the bound is missed at {} of {} depths, by up to {:.2e} (depth {} mm: {}, exact {})",
                self.check.violations,
                self.check.depths,
                worst.amount,
                worst.depth_mm,
                worst.t_method,
                worst.t_exact
            ));
        }
        faults.extend(self.points.note("the bound"));
        faults.extend(self.enclosure.note("the enclosure"));
        faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::point_report::PointViolation;
    use glam::DVec3;

    fn narrow() -> Bound {
        Bound { transmittance: 0.02, depth_mm: 0.1, ..Bound::default() }
    }

    /// Returns test results for given transmittances of one light ray at depths 0, 1, 2, 3, whose exact transmittance
    /// is `exp(-z)`.
    fn of(values: [f32; 4], bound: Option<Bound>) -> Findings {
        let depths = [0.0, 1.0, 2.0, 3.0];
        let check = BoundReport::of_ray(0, &|z: f64| (-z).exp(), &depths, &values, bound, |_| None);
        let rays = Sanity::of_ray(&depths, &values, [1e-6, 1e-4], 0.1);
        Findings { check, bound, rays, ..Findings::default() }
    }

    const EXACT: [f32; 4] = [1.0, 0.367_88, 0.135_34, 0.049_79];

    #[test]
    fn what_is_right_is_ok() {
        let right = of(EXACT, Some(narrow()));
        assert_eq!((right.status(), right.faults()), (Status::Ok, vec![]));
        let [a, b, c, d] = EXACT;
        assert_eq!(of([a, b + 0.03, c - 0.02, d], Some(narrow())).status(), Status::Ok, "within the bound");
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
            let found = of(values, Some(narrow()));
            assert_eq!(found.status(), status, "{values:?}");
            assert!(found.faults().iter().any(|c| c.contains(said)), "{:?}", found.faults());
        }
    }

    #[test]
    fn violations_at_points_come_out() {
        let violation = PointViolation {
            position_mm: DVec3::new(1.0, 2.0, 3.0),
            transmittance: 0.7,
            interval: [0.2, 0.5],
            amount: 0.2,
        };
        let violated = PointReport { violations: 1, worst: Some(violation), ..PointReport::of(40) };
        let right = of(EXACT, Some(narrow()));
        for (found, said) in [
            (Findings { points: violated, ..right.clone() }, "the bound does not hold at 1 of 40 points"),
            (
                Findings { enclosure: violated, ..right.clone() },
                "the enclosure does not hold at 1 of 40 points",
            ),
        ] {
            assert_eq!(found.status(), Status::BoundExceeded);
            let [fault] = &found.faults()[..] else { panic!("{:?}", found.faults()) };
            assert!(fault.contains(said) && fault.contains("0.7"), "{fault}");
        }
        let held = Findings { points: PointReport::of(40), enclosure: PointReport::of(9), ..right };
        assert_eq!((held.status(), held.faults()), (Status::Ok, vec![]));
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
                assert_eq!(found.faults().is_empty(), values == EXACT, "what is allowed is said too");
            }
        }
    }

    #[test]
    fn without_a_bound_an_error_is_no_fault_but_a_rise_is() {
        let far = of([1.0, 0.9, 0.8, 0.7], None);
        assert_eq!(far.status(), Status::Ok);
        assert!(far.check.ray_err_max().unwrap() > 0.6);
        assert_eq!(of([1.0, 0.8, 0.9, 0.7], None).status(), Status::NotMonotone);
    }

    #[test]
    fn the_worst_of_several_is_the_status_and_all_are_named() {
        let found = of([1.0, 0.1, 0.5, f32::NAN], Some(narrow()));
        assert_eq!(found.status(), Status::Nan);
        assert_eq!(found.faults().len(), 3);
        assert!(Status::ALL.is_sorted());
    }

    #[test]
    fn pictures_count() {
        let mut found = of(EXACT, Some(narrow()));
        found.check_picture(&[0.0, 1.0, 0.5, 1.000_001]);
        assert_eq!(found.status(), Status::Ok);
        found.check_picture(&[1.01, 0.2, -0.5]);
        assert_eq!((found.status(), found.out_of_range()), (Status::OutOfRange, 2));
        found.check_picture(&[f32::NAN, f32::NEG_INFINITY]);
        assert_eq!((found.status(), found.non_finite()), (Status::Nan, 2));
        assert!(found.faults()[0].contains("2 channels of the picture are not finite"));
    }
}
