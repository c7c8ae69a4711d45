//! Verdicts from figures, each by a rule that can be said in a sentence.

use serde::Serialize;

/// Whether a claim holds, worst first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Holds {
    /// The claim does not hold.
    No,
    /// The claim holds in part: the direction is right but not the figure, or it holds in some of several cases.
    Partly,
    /// The claim holds.
    Yes,
    /// The claim was not tried.
    #[default]
    #[serde(rename = "")]
    Untried,
}

/// Factor by which times of a busy machine may miss a range.
pub const TIME_SLACK: f64 = 1.15;
/// Largest factor between figures that count as equal.
pub const EQUAL: f64 = 1.05;

impl Holds {
    /// Spelling of the verdict in tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::No => "no",
            Self::Partly => "partly",
            Self::Yes => "yes",
            Self::Untried => "",
        }
    }

    /// Yes where `yes`, else partly where `partly`.
    pub fn of(yes: bool, partly: bool) -> Self {
        match (yes, partly) {
            (true, _) => Self::Yes,
            (_, true) => Self::Partly,
            _ => Self::No,
        }
    }

    /// Combines the verdicts of several cases: `Yes` or `No` where they agree, else `Partly`; `No` for none.
    pub fn all(cases: impl IntoIterator<Item = Self>) -> Self {
        let mut cases = cases.into_iter();
        let Some(first) = cases.next() else { return Self::No };
        cases.fold(first, |all, case| if all == case { all } else { Self::Partly })
    }
}

/// A ratio that a paper gives as a range: yes within it, widened by [`TIME_SLACK`] at both ends but not beyond 1, where the
/// range is on one side of that; partly where it is outside and yet on the range's side of 1 by more than [`EQUAL`], or
/// where the widened range holds it and it is [`EQUAL`] to 1.
pub fn within(ratio: f64, [low, high]: [f64; 2]) -> Holds {
    let side = if low + high > 2.0 { ratio >= EQUAL } else { ratio <= 1.0 / EQUAL };
    let opposite = (low > 1.0 && ratio <= 1.0) || (high < 1.0 && ratio >= 1.0);
    let near = low / TIME_SLACK <= ratio && ratio <= high * TIME_SLACK;
    let equal = (1.0 / EQUAL..=EQUAL).contains(&ratio);
    Holds::of(near && !opposite, side || near && equal)
}

/// A ratio said to be large: yes from `wanted` on, partly above [`EQUAL`].
pub fn at_least(ratio: f64, wanted: f64) -> Holds {
    Holds::of(ratio >= wanted, ratio >= EQUAL)
}

/// A ratio said to be small: yes up to `limit`, partly up to `most`.
pub fn at_most(ratio: f64, limit: f64, most: f64) -> Holds {
    Holds::of(ratio <= limit, ratio <= most)
}

/// A series said to rise: yes where no step falls and the whole rises by more than `least`; partly where only the whole
/// does.
pub fn rises(series: &[f64], least: f64) -> Holds {
    let (Some(first), Some(last)) = (series.first(), series.last()) else { return Holds::No };
    let whole = last - first > least;
    Holds::of(whole && series.windows(2).all(|w| w[1] >= w[0]), whole)
}

/// A series said to fall: the mirror image of [`rises`].
pub fn falls(series: &[f64], least: f64) -> Holds {
    rises(&series.iter().map(|x| -x).collect::<Vec<_>>(), least)
}

/// Figures beside those of a paper: yes where each is within `near`, partly where at least half of them are; a figure
/// that is missing on either side decides no.
pub fn beside(measured: &[f64], claimed: &[f64], near: f64) -> Holds {
    if measured.len() != claimed.len() || measured.is_empty() {
        return Holds::No;
    }
    let hits = measured.iter().zip(claimed).filter(|(m, c)| (*m - *c).abs() <= near + 1e-9).count();
    Holds::of(hits == measured.len(), 2 * hits >= measured.len())
}

/// A straight line through points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Value at 0.
    pub start: f64,
    /// Slope of the line.
    pub slope: f64,
    /// Root mean square distance of the points from it, as a share of their mean.
    pub residual: f64,
}

/// The line of least squares; `None` for fewer than two different places.
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

/// The exponent `p` of `y = c x^p` by least squares of logarithms; `None` where there is none.
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
        assert_eq!(at_least(f64::NAN, 1.0), No);
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
