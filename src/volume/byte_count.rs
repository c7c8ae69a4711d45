//! Amount of memory, as users write it: `2GiB`, `500MB`.

use std::fmt;
use std::str::FromStr;

/// Number of bytes, at least 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ByteCount(pub u64);

const UNITS: [(&str, u64); 7] = [
    ("KiB", 1 << 10),
    ("MiB", 1 << 20),
    ("GiB", 1 << 30),
    ("kB", 1000),
    ("MB", 1_000_000),
    ("GB", 1_000_000_000),
    ("B", 1),
];

impl FromStr for ByteCount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refuse = || format!("`{text}` is not an amount of memory like 2GiB or 500MB");
        let suffix = |(unit, size): &(&str, u64)| Some((text.strip_suffix(unit)?, *size));
        let (number, unit) = UNITS.iter().find_map(suffix).ok_or_else(refuse)?;
        let number: f64 = number.trim().parse().map_err(|_| refuse())?;
        let bytes = (number * unit as f64).floor();
        (1.0..2f64.powi(53)).contains(&bytes).then_some(Self(bytes as u64)).ok_or_else(refuse)
    }
}

impl fmt::Display for ByteCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}B", self.0)
    }
}

impl serde::Serialize for ByteCount {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_have_units() {
        assert_eq!("2GiB".parse(), Ok(ByteCount(1 << 31)));
        assert_eq!("1.5kB".parse(), Ok(ByteCount(1500)));
        assert_eq!(ByteCount(1 << 31).to_string().parse(), Ok(ByteCount(1 << 31)));
        for bad in ["", "2", "GiB", "-1GiB", "0kB", "nanMiB", "1e30GiB"] {
            assert!(bad.parse::<ByteCount>().is_err(), "{bad}");
        }
    }
}
