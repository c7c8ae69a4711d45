//! Rules for verdicts on claims of papers: whether measured numbers confirm what a paper states.

use serde::{Deserialize, Serialize};

/// Verdict on a claim of a paper, ordered from worst to best.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Holds {
    /// The claim of the paper does not hold.
    No,
    /// The claim of the paper holds in part: the direction is right but not the number, it holds in some of several
    /// cases, or all errors are too small to tell.
    Partly,
    /// The claim of the paper holds.
    Yes,
    /// The claim of the paper was not tested.
    #[default]
    #[serde(rename = "")]
    Untried,
}

/// Factor by which a measured ratio of times may lie outside the range stated in a paper, because other load on the
/// machine disturbs timing.
pub const TIME_SLACK: f64 = 1.15;
/// Largest ratio between two measured numbers at which they still count as equal.
pub const EQUAL: f64 = 1.05;
/// Largest root mean square error of a picture that counts as small: two steps of 8 bits.
pub const SMALL_ERROR: f64 = 2.0 / 255.0;

impl Holds {
    /// Returns the verdict on a paper's claim as tables show it; empty for a claim that was not tested.
    pub fn word(self) -> &'static str {
        match self {
            Self::No => "no",
            Self::Partly => "partly",
            Self::Yes => "yes",
            Self::Untried => "",
        }
    }

    /// Returns a verdict on a paper's claim: `Yes` if `yes` is true, else `Partly` if `partly` is true, else `No`.
    pub fn of(yes: bool, partly: bool) -> Self {
        match (yes, partly) {
            (true, _) => Self::Yes,
            (_, true) => Self::Partly,
            _ => Self::No,
        }
    }

    /// Combines the verdicts on a paper's claim over several cases: `Yes` or `No` if they agree, otherwise `Partly`;
    /// `No` without cases.
    pub fn all(cases: impl IntoIterator<Item = Self>) -> Self {
        let mut cases = cases.into_iter();
        let Some(first) = cases.next() else { return Self::No };
        cases.fold(first, |all, case| if all == case { all } else { Self::Partly })
    }
}

/// Verdict on a measured ratio, such as of two times, for which a paper states a range.
///
/// `Yes` if the ratio lies in the range widened by [`TIME_SLACK`] at both ends. If the whole range lies on one side
/// of 1, the ratio must lie on that side too.
///
/// `Partly` if the ratio lies outside, but on the range's side of 1 by more than [`EQUAL`]. Also `Partly` if the
/// widened range contains the ratio and the ratio equals 1 within [`EQUAL`].
pub fn within(ratio: f64, [low, high]: [f64; 2]) -> Holds {
    let side = if low + high > 2.0 { ratio >= EQUAL } else { ratio <= 1.0 / EQUAL };
    let opposite = (low > 1.0 && ratio <= 1.0) || (high < 1.0 && ratio >= 1.0);
    let near = low / TIME_SLACK <= ratio && ratio <= high * TIME_SLACK;
    let equal = (1.0 / EQUAL..=EQUAL).contains(&ratio);
    Holds::of(near && !opposite, side || near && equal)
}

/// Verdict on a measured ratio that is large according to a paper: `Yes` from `wanted` on, `Partly` from [`EQUAL`]
/// on.
pub fn at_least(ratio: f64, wanted: f64) -> Holds {
    Holds::of(ratio >= wanted, ratio >= EQUAL)
}

/// Verdict on a measured ratio that is small according to a paper: `Yes` up to `limit`, `Partly` up to `most`.
pub fn at_most(ratio: f64, limit: f64, most: f64) -> Holds {
    Holds::of(ratio <= limit, ratio <= most)
}

/// Verdict on a picture that is as good as another according to a paper, by the root mean square errors of the two.
/// `Yes` if the error is at most [`EQUAL`] times the other; `Partly` up to `most` times, or if both errors are small
/// ([`SMALL_ERROR`]): a mean does not tell whether they can be seen.
pub fn as_good(error: f64, other: f64, most: f64) -> Holds {
    let small = error <= SMALL_ERROR && other <= SMALL_ERROR;
    Holds::of(error <= EQUAL * other, small || error <= most * other)
}

/// Verdict on an ordering of pictures by their root mean square errors: `of`, or `Partly` if all errors are small
/// ([`SMALL_ERROR`]), since a mean does not tell whether they can be seen.
pub fn if_large(of: Holds, errors: &[f64]) -> Holds {
    if errors.iter().all(|error| *error <= SMALL_ERROR) { Holds::Partly } else { of }
}

/// Verdict on a series of measurements that rises according to a paper. `Yes` if no step falls and the total rise
/// exceeds `least`; `Partly` if only the total rise does.
pub fn rises(series: &[f64], least: f64) -> Holds {
    let (Some(first), Some(last)) = (series.first(), series.last()) else { return Holds::No };
    let whole = last - first > least;
    Holds::of(whole && series.windows(2).all(|w| w[1] >= w[0]), whole)
}

/// Verdict on a series of measurements that falls according to a paper. `Yes` if no step rises and the total fall
/// exceeds `least`; `Partly` if only the total fall does.
pub fn falls(series: &[f64], least: f64) -> Holds {
    rises(&series.iter().map(|x| -x).collect::<Vec<_>>(), least)
}

/// Verdict on measured numbers against the numbers in a paper. `Yes` if all differ by at most `near`, `Partly` if at
/// least half do. `No` if the lists are empty or differ in length.
pub fn beside(measured: &[f64], claimed: &[f64], near: f64) -> Holds {
    if measured.len() != claimed.len() || measured.is_empty() {
        return Holds::No;
    }
    let hits = measured.iter().zip(claimed).filter(|(m, c)| (*m - *c).abs() <= near + 1e-9).count();
    Holds::of(hits == measured.len(), 2 * hits >= measured.len())
}

/// Least-squares line through measured points: value at 0, slope and residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Value of the least-squares line at 0.
    pub start: f64,
    /// Slope of the least-squares line.
    pub slope: f64,
    /// Root mean square residual of the points from the least-squares line, divided by the absolute value of their
    /// mean.
    pub residual: f64,
}

/// Fits a least-squares line through points; `None` if they have fewer than two distinct x values.
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let spread = mean(&|p| (p.0 - x).powi(2));
    if points.len() < 2 || spread <= 0.0 {
        return None;
    }
    let slope = mean(&|p| (p.0 - x) * (p.1 - y)) / spread;
    let start = y - slope * x;
    let residual = mean(&|p| (p.1 - start - slope * p.0).powi(2)).sqrt() / y.abs();
    Some(Line { start, slope, residual })
}

/// Fits the exponent `p` of `y = c x^p` by least squares of logarithms. `None` if a coordinate is not positive or the
/// line fit fails.
pub fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let positive = points.iter().all(|(x, y)| *x > 0.0 && *y > 0.0);
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    positive.then(|| line(&logs)).flatten().map(|l| l.slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Holds::{No, Partly, Yes};

    #[test]
    fn ranges_of_a_paper() {
        for (ratio, range, verdict) in [
            (2.0, [1.5, 3.0], Yes),
            (1.5 / 1.14, [1.5, 3.0], Yes),
            (3.0 * 1.14, [1.5, 3.0], Yes),
            (1.2, [1.5, 3.0], Partly),
            (9.0, [1.5, 3.0], Partly),
            (1.04, [1.5, 3.0], No),
            (0.5, [1.5, 3.0], No),
            (0.5, [0.1, 0.2], Partly),
            (0.99, [0.1, 0.2], No),
            (0.91, [1.02, 1.2], No),
            (0.99, [1.02, 1.2], Partly),
            (1.01, [1.02, 1.2], Yes),
            (1.04, [0.8, 0.97], Partly),
            (1.1, [0.8, 0.97], No),
            (0.95, [0.92, 1.05], Yes),
        ] {
            assert_eq!(within(ratio, range), verdict, "{ratio} in {range:?}");
        }
    }

    #[test]
    fn one_sided_rules() {
        assert_eq!([2.0, 1.3, 1.0].map(|r| at_least(r, 2.0)), [Yes, Partly, No]);
        assert_eq!([1.0, 1.3, 2.0].map(|r| at_most(r, 1.05, 1.5)), [Yes, Partly, No]);
        assert_eq!(at_most(f64::NAN, 1.0, 2.0), No, "what is no number shows nothing");
        assert_eq!(as_good(0.007, 0.001, 2.0), Partly, "both errors are small");
        assert_eq!([0.0104, 0.015, 0.05].map(|e| as_good(e, 0.01, 2.0)), [Yes, Partly, No]);
        assert_eq!(as_good(f64::NAN, 0.001, 2.0), No);
        assert_eq!(at_least(f64::NAN, 1.0), No);
        assert_eq!([[0.001, 0.007], [0.001, 0.008]].map(|errors| if_large(No, &errors)), [Partly, No]);
        assert_eq!(if_large(Yes, &[0.001, 0.007]), Partly);
        assert_eq!(if_large(No, &[f64::NAN]), No);
    }

    #[test]
    fn series() {
        assert_eq!(rises(&[0.1, 0.1, 0.4], 0.1), Yes);
        assert_eq!(rises(&[0.1, 0.5, 0.4], 0.1), Partly);
        assert_eq!(rises(&[0.1, 0.1, 0.1], 0.0), No, "what stays does not rise");
        assert_eq!(rises(&[], 0.0), No);
        assert_eq!(falls(&[1.0, 0.6, 0.3], 0.1), Yes);
        assert_eq!(falls(&[0.3, 0.6], 0.1), No);
        assert_eq!(beside(&[0.7, 0.2, 0.2], &[0.6, 0.3, 0.2], 0.1), Yes);
        assert_eq!(beside(&[0.7, 0.2, 0.9], &[0.6, 0.3, 0.2], 0.1), Partly);
        assert_eq!(beside(&[0.7, 0.9, 0.9], &[0.6, 0.3, 0.2], 0.1), No);
        assert_eq!(beside(&[0.7], &[0.7, 0.7], 0.1), No);
    }

    #[test]
    fn several_cases() {
        assert_eq!(Holds::all([Yes, Yes]), Yes);
        assert_eq!(Holds::all([No, No]), No);
        assert_eq!(Holds::all([Yes, No]), Partly);
        assert_eq!(Holds::all([Partly, Partly]), Partly);
        assert_eq!(Holds::all([]), No);
        assert!(No < Partly && Partly < Yes);
    }

    #[test]
    fn planted_lines_and_powers_come_out() {
        let points = [1.0, 2.0, 4.0, 8.0].map(|x| (x, 3.0 + 0.5 * x));
        let fit = line(&points).unwrap();
        assert!((fit.start - 3.0).abs() < 1e-12 && (fit.slope - 0.5).abs() < 1e-12 && fit.residual < 1e-12);
        assert!((exponent(&points.map(|(x, _)| (x, 7.0 * x.powf(1.5)))).unwrap() - 1.5).abs() < 1e-12);
        assert!(line(&[(1.0, 2.0)]).is_none() && line(&[(1.0, 2.0), (1.0, 3.0)]).is_none());
        assert!(exponent(&[(1.0, 0.0), (2.0, 1.0)]).is_none());
        let bent = line(&[(0.0, 1.0), (1.0, 3.0), (2.0, 1.0)]).unwrap();
        // A level line at 5/3; distances 2/3, 4/3, 2/3: rms sqrt(8/9), of a mean of 5/3.
        assert!(
            bent.slope.abs() < 1e-12 && (bent.residual - (8.0_f64 / 9.0).sqrt() / (5.0 / 3.0)).abs() < 1e-12
        );
    }
}
