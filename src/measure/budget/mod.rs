//! Tuning within budgets: searches each shadow method's settings for the smallest error within a limit of memory or
//! time.
//!
//! A budget `bytes` limits the table column `bytes`. A budget `ms` limits `build_ms + frame_ms`, the time of a
//! picture after the light has moved, and a budget `frames` the column `frames`, the same time in frames without
//! shadows. For each budget, two errors are minimized in turn: `point_err_rms` and
//! `image_rmse` ([`ErrorMeasure`]). [`search`] shares the trials of a method among all budgets and both errors. A trial is a
//! table row with few columns; [`tune`](mod@tune) measures it on a device.

pub mod search;
pub(super) mod tune;

use super::table::Row;
use crate::error::{Error, Result};
use crate::shadow::{Method, NoShadows};
use bytesize::ByteSize;
use itertools::Itertools as _;
use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

const WHAT: &str = "bad budget";

/// Upper limit on the memory or the time of a shadow method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Budget {
    /// Upper limit on the memory of the shadow map, bytes.
    Bytes(u64),
    /// Upper limit on `build_ms + frame_ms`, the time of one picture after the light has moved, ms.
    Ms(f64),
    /// Upper limit on the same time, in frames of the picture without shadows.
    Frames(f64),
}

/// Formats a memory or time budget in the syntax of the option `--budget`.
impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Bytes(n) => {
                let units = [("GiB", 30), ("MiB", 20), ("KiB", 10), ("", 0)];
                let whole = units.into_iter().find(|(_, shift)| n > 0 && n % (1 << shift) == 0);
                let (unit, shift) = whole.unwrap_or(("", 0));
                write!(f, "bytes={}{unit}", n >> shift)
            }
            Self::Ms(ms) => write!(f, "ms={ms}"),
            Self::Frames(frames) => write!(f, "frames={frames}"),
        }
    }
}

impl FromStr for Budget {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut list = Self::parse_list(text)?;
        match (list.pop(), list.is_empty()) {
            (Some(only), true) => Ok(only),
            _ => Err(Error::input(WHAT, format!("`{text}`"), "one budget is meant here")),
        }
    }
}

impl Budget {
    /// Parses memory and time budgets such as `bytes=2MiB,8MiB`, `ms=50` and `frames=3`. A value without a key belongs to
    /// the key before it.
    ///
    /// # Errors
    /// A part of the text is not a valid budget; the error names that part.
    pub fn parse_list(text: &str) -> Result<Vec<Self>> {
        let mut budgets = Vec::new();
        let mut key = None;
        for part in text.split(',') {
            let value = match part.split_once('=') {
                Some((name, value)) => {
                    key = Some(name.trim());
                    value.trim()
                }
                None => part.trim(),
            };
            let refuse = |why: &str| Err(Error::input(WHAT, format!("`{}`", part.trim()), why));
            let budget = match key {
                Some("bytes") => value.parse().ok().map(|ByteSize(n)| n).filter(|n| *n > 0).map(Self::Bytes),
                Some("ms") => positive(value).map(Self::Ms),
                Some("frames") => positive(value).map(Self::Frames),
                _ => {
                    return refuse(
                        "expected bytes=SIZE[,SIZE...], ms=NUMBER[,NUMBER...] or frames=NUMBER[,...]",
                    );
                }
            };
            let Some(budget) = budget else {
                return refuse(
                    "expected a number above 0; of bytes with a unit such as kB, MB, KiB or MiB behind it",
                );
            };
            if !budgets.contains(&budget) {
                budgets.push(budget);
            }
        }
        Ok(budgets)
    }

    /// Checks that the methods to compare contain `none` where a budget is in frames without shadows.
    ///
    /// # Errors
    /// They do not.
    pub fn check_methods(budgets: &[Self], methods: &[Box<dyn Method>]) -> Result<()> {
        let in_frames = budgets.iter().any(|budget| matches!(budget, Self::Frames(_)));
        if in_frames && methods.iter().all(|method| method.name() != NoShadows.name()) {
            let why = "a budget in frames without shadows needs the method none";
            return Err(Error::input("cannot tune", "none", why));
        }
        Ok(())
    }

    /// Returns the measured memory (bytes) or time (ms or frames) of a comparison table row, whichever this budget
    /// limits; `None` where not measured. A method that stores nothing has no memory to limit.
    pub fn need(&self, row: &Row) -> Option<f64> {
        match self {
            Self::Bytes(_) => row.bytes.filter(|n| *n > 0).map(|n| n as f64),
            Self::Ms(_) => row.moving_ms(),
            Self::Frames(_) => row.frames,
        }
    }

    /// Whether the budget limits memory, and the method of a comparison table row stores nothing.
    pub fn stores_nothing(&self, row: &Row) -> bool {
        matches!(self, Self::Bytes(_)) && row.bytes == Some(0)
    }

    /// Largest memory in bytes, or time in milliseconds or frames, that the budget allows.
    pub fn amount(&self) -> f64 {
        match *self {
            Self::Bytes(n) => n as f64,
            Self::Ms(n) | Self::Frames(n) => n,
        }
    }

    /// Whether the budget limits time.
    pub fn is_of_time(&self) -> bool {
        !matches!(self, Self::Bytes(_))
    }

    /// Orders budgets by kind, then by amount: searches within smaller budgets start those within larger ones.
    pub fn order(&self, other: &Self) -> Ordering {
        let kind = |budget: &Self| match budget {
            Self::Bytes(_) => 0,
            Self::Ms(_) => 1,
            Self::Frames(_) => 2,
        };
        kind(self).cmp(&kind(other)).then(self.amount().total_cmp(&other.amount()))
    }

    /// Whether the measured memory or time in a comparison table row is known to lie within the budget.
    pub fn holds(&self, row: &Row) -> bool {
        self.need(row).is_some_and(|need| need <= self.amount())
    }
}

fn positive(text: &str) -> Option<f64> {
    text.parse().ok().filter(|n: &f64| n.is_finite() && *n > 0.0)
}

/// Error measure (of shadows or of pictures) that a search for a method's settings minimizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ErrorMeasure {
    /// Minimizes the column `point_err_rms`, the rms transmittance error at visible points.
    Points,
    /// Minimizes the column `image_rmse`, the rms difference from the exact picture.
    Picture,
}

impl ErrorMeasure {
    /// Both error measures that a search for method settings can minimize: error at visible points and error of the
    /// picture.
    pub const ALL: [Self; 2] = [Self::Points, Self::Picture];

    /// Name of the comparison table column that holds this error measure of the shadow method.
    pub fn column(self) -> &'static str {
        match self {
            Self::Points => "point_err_rms",
            Self::Picture => "image_rmse",
        }
    }

    /// Returns the error of a comparison table row in this error measure; `None` where the table cell is empty or
    /// NaN.
    pub fn error(self, row: &Row) -> Option<f64> {
        let error = match self {
            Self::Points => row.point_err_rms,
            Self::Picture => row.image_rmse,
        };
        error.filter(|e| !e.is_nan())
    }
}

/// Memory or time budgets for which a search chose the same method settings, each with the minimized error measure.
pub type Uses = Vec<(Budget, ErrorMeasure)>;

/// Text for the comparison table column `tuned_for`: the budgets and error measures for which a search chose a row's
/// method settings.
pub fn tuned_for(uses: &[(Budget, ErrorMeasure)]) -> String {
    uses.iter().map(|(budget, by)| format!("{budget} {}", by.column())).collect::<Vec<_>>().join("; ")
}

/// Returns the distinct memory and time budgets for which a search chose the method settings of comparison table
/// rows, in order of appearance.
pub fn budgets_of(rows: &[Row]) -> Vec<Budget> {
    let texts = rows.iter().flat_map(|row| row.tuned_for.split("; "));
    let budgets = texts.filter_map(|text| text.split(' ').next()?.parse().ok());
    budgets.unique_by(Budget::to_string).collect()
}

/// Whether a recorded trial of method settings can be reused for a search within these budgets. It must have failed,
/// or have known memory and time, and a known error if any budget holds.
pub(super) fn answers(trial: &Row, budgets: &[Budget]) -> bool {
    let known = budgets.iter().all(|b| b.need(trial).is_some() || b.stores_nothing(trial));
    let allowed = budgets.iter().any(|b| b.holds(trial));
    !trial.note.is_empty()
        || known && (!allowed || ErrorMeasure::ALL.iter().any(|by| by.error(trial).is_some()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_read_back() {
        let text = "bytes=2MiB,8MiB,ms=50,0.5";
        let list = Budget::parse_list(text).unwrap();
        let said: Vec<_> = list.iter().map(Budget::to_string).collect();
        assert_eq!(said, ["bytes=2MiB", "bytes=8MiB", "ms=50", "ms=0.5"]);
        for (text, n) in
            [("4096", 4096), ("1.5 MB", 1_500_000), ("3B", 3), ("0.5KiB", 512), ("1GiB", 1 << 30)]
        {
            let budget: Budget = format!("bytes={text}").parse().unwrap();
            assert_eq!(budget, Budget::Bytes(n));
            assert_eq!(budget.to_string().parse::<Budget>().unwrap(), budget);
        }
        assert_eq!(Budget::parse_list("ms=5,5.0,ms=5").unwrap(), [Budget::Ms(5.0)]);
        let mixed = Budget::parse_list("frames=3,ms=9,frames=1.5,bytes=1MiB").unwrap();
        let sorted = mixed.iter().sorted_by(|a, b| a.order(b)).map(Budget::to_string);
        assert!(sorted.eq(["bytes=1MiB", "ms=9", "frames=1.5", "frames=3"]));
    }

    #[test]
    fn slips_are_refused_by_name() {
        for text in [
            "",
            "2MiB",
            "byte=2",
            "bytes=",
            "bytes=0",
            "bytes=-1",
            "bytes=2 MiX",
            "bytes=0.5",
            "ms=inf",
            "ms=nan",
            "ms=50ms",
            "bytes=2MiB,,ms=3",
            "bytes=1e30GiB",
            "ms",
            "ms=50;bytes=2MiB",
            "frames=0",
        ] {
            let e = Budget::parse_list(text).expect_err(text);
            assert!(e.exit_status() == 2 && e.what == WHAT, "{text}: {e}");
        }
    }

    #[test]
    fn rows_say_their_budgets() {
        let chosen =
            [(Budget::Bytes(2 << 20), ErrorMeasure::Points), (Budget::Ms(12.5), ErrorMeasure::Picture)];
        let row = Row { tuned_for: tuned_for(&chosen), ..Row::default() };
        assert_eq!(row.tuned_for, "bytes=2MiB point_err_rms; ms=12.5 image_rmse");
        let rows = [Row::default(), row.clone(), row];
        assert_eq!(budgets_of(&rows), [Budget::Bytes(2 << 20), Budget::Ms(12.5)]);
        let row = Row { bytes: Some(7), build_ms: Some(2.0), frame_ms: Some(3.0), ..Row::default() };
        assert!(Budget::Bytes(7).holds(&row) && !Budget::Bytes(6).holds(&row));
        assert!(
            Budget::Ms(5.0).holds(&row)
                && !Budget::Ms(4.9).holds(&row)
                && !Budget::Ms(9.0).holds(&Row::default())
        );
        let row = Row { frames: Some(2.5), ..row };
        assert!(Budget::Frames(2.5).holds(&row) && !Budget::Frames(2.4).holds(&row));
    }
}
