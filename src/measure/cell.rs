//! The values of a table's columns, and their texts, which read back as the same values.

use super::timing::ClockSource;
use std::fmt;

/// One value of a row, as written.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Not measured, or nothing to say.
    Empty,
    Text(String),
    Integer(u64),
    Real(f64),
    /// `yes` or `no`.
    Flag(bool),
}

/// As written in CSV: reals in the fewest digits that read back as the same number.
impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Empty => Ok(()),
            Self::Text(text) => f.write_str(text),
            Self::Integer(n) => write!(f, "{n}"),
            Self::Real(x) => write!(f, "{x:?}"),
            Self::Flag(yes) => f.write_str(if *yes { "yes" } else { "no" }),
        }
    }
}

macro_rules! cell_from {
    ($($t:ty => $cell:expr),*) => { $(impl From<$t> for Cell { fn from(v: $t) -> Self { $cell(v) } })* };
}
cell_from!(
    String => Cell::Text, u64 => Cell::Integer, f64 => Cell::Real, bool => Cell::Flag,
    u32 => |n| Cell::Integer(u64::from(n)),
    ClockSource => |c: ClockSource| Cell::Text(c.name().to_string())
);

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Cell::Empty, Into::into)
    }
}

/// A column's value from the text that a [`Cell`] of it is written as; `None` where the text is no such value.
pub(super) trait FromText: Sized {
    fn from_text(text: &str) -> Option<Self>;
}

impl FromText for String {
    fn from_text(text: &str) -> Option<Self> {
        Some(text.into())
    }
}

macro_rules! parsed {
    ($($t:ty),*) => { $(impl FromText for $t {
        fn from_text(text: &str) -> Option<Self> { text.parse().ok() }
    })* };
}
parsed!(u32, u64, f64);

impl FromText for bool {
    fn from_text(text: &str) -> Option<Self> {
        [("yes", true), ("no", false)].into_iter().find_map(|(name, flag)| (name == text).then_some(flag))
    }
}

impl FromText for ClockSource {
    fn from_text(text: &str) -> Option<Self> {
        [Self::Gpu, Self::Wall].into_iter().find(|c| c.name() == text)
    }
}

impl<T: FromText> FromText for Option<T> {
    fn from_text(text: &str) -> Option<Self> {
        if text.is_empty() { Some(None) } else { T::from_text(text).map(Some) }
    }
}
