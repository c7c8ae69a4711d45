//! Cell values of the measured comparison table, with formatting and parsing that preserve every value.

use super::timing::clock_name;
use crate::gpu::Clock;
use serde::Serialize;
use std::fmt;

/// Value of one cell of the comparison table.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// Empty cell of the comparison table: not measured or not applicable.
    Empty,
    /// Cell of the comparison table with text.
    Text(String),
    /// Cell of the comparison table with a nonnegative integer, such as a count.
    Integer(u64),
    /// Cell of the comparison table with a real number.
    Real(f64),
    /// Cell of the comparison table with a Boolean, written as `true` or `false`.
    Flag(bool),
}

/// Formats a cell of the comparison table for CSV. Real numbers have the fewest digits that parse to the same number.
impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Empty => Ok(()),
            Self::Text(text) => f.write_str(text),
            Self::Integer(n) => write!(f, "{n}"),
            Self::Real(x) => write!(f, "{x:?}"),
            Self::Flag(yes) => write!(f, "{yes}"),
        }
    }
}

macro_rules! cell_from {
    ($($t:ty => $cell:expr),*) => { $(impl From<$t> for Cell { fn from(v: $t) -> Self { $cell(v) } })* };
}
cell_from!(
    String => Cell::Text, u64 => Cell::Integer, f64 => Cell::Real, bool => Cell::Flag,
    u32 => |n| Cell::Integer(u64::from(n)),
    Clock => |clock| Cell::Text(clock_name(clock).into())
);

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Cell::Empty, Into::into)
    }
}

/// Parses the value of a comparison table column from a cell's text; `None` where the text is not valid for the
/// column.
pub(super) trait FromText: Sized {
    fn from_text(text: &str) -> Option<Self>;
}

macro_rules! parsed {
    ($($t:ty),*) => { $(impl FromText for $t {
        fn from_text(text: &str) -> Option<Self> { text.parse().ok() }
    })* };
}
parsed!(String, u32, u64, f64, bool);

impl FromText for Clock {
    fn from_text(text: &str) -> Option<Self> {
        [Self::GpuTimestamps, Self::Wall].into_iter().find(|c| clock_name(*c) == text)
    }
}

impl<T: FromText> FromText for Option<T> {
    fn from_text(text: &str) -> Option<Self> {
        if text.is_empty() { Some(None) } else { T::from_text(text).map(Some) }
    }
}

/// Parses the text of a comparison table cell as the first type that fits: integer, real, Boolean, empty, text.
impl FromText for Cell {
    fn from_text(text: &str) -> Option<Self> {
        let integer = || text.parse().ok().map(Self::Integer);
        let real = || text.parse().ok().map(Self::Real);
        let flag = || text.parse().ok().map(Self::Flag);
        Some(integer().or_else(real).or_else(flag).unwrap_or_else(|| match text {
            "" => Self::Empty,
            _ => Self::Text(text.into()),
        }))
    }
}
