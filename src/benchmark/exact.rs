//! Exact transmittances at the visible points of a cell, and the hashes that the benchmark expects.

use crate::error::{Error, Result};
use crate::files::hash::sha256;
use crate::measure::errors::VisiblePoints;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::sync::LazyLock;

/// Number of hexadecimal digits of a hash.
const DIGITS: usize = 16;

/// Expected hash of each cell, from `exact.tsv`.
static EXPECTED: LazyLock<HashMap<&str, &str>> =
    LazyLock::new(|| include_str!("exact.tsv").lines().filter_map(|line| line.split_once('\t')).collect());

/// Returns the hash of visible points (world mm) and their exact transmittances, each rounded to six decimals. Rounding
/// makes the hash independent of the last bits of the machine's exponential function.
pub fn fingerprint(points: &VisiblePoints) -> String {
    let mut text = String::new();
    for ((point, weight), exact) in points.points_mm().iter().zip(points.weights()).zip(points.exact()) {
        // Writing to a string cannot fail. Adding 0 turns -0 into 0.
        let _ = writeln!(
            text,
            "{:.6} {:.6} {:.6} {weight:.6} {exact:.6}",
            point.x + 0.0,
            point.y + 0.0,
            point.z + 0.0
        );
    }
    let mut hash = sha256(text.as_bytes());
    hash.truncate(DIGITS);
    hash
}

/// Checks the hash of a cell's points against the expected one.
///
/// # Errors
/// The hash differs, or the benchmark has none for the cell.
pub fn check(cell: &str, hash: &str) -> Result<()> {
    let refuse = |why: String| Err(Error::runtime("cannot use benchmark cell", cell, why));
    match EXPECTED.get(cell) {
        Some(expected) if *expected == hash => Ok(()),
        Some(expected) => refuse(format!("its exact transmittances have the hash {hash}, not {expected}")),
        None => refuse("the benchmark has no hash for it".into()),
    }
}
