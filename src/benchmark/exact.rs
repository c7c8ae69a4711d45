//! Exact transmittances at the visible points of a cell, and the hashes that the benchmark expects.

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

/// Returns the hash of visible points (world mm) and their exact transmittances, each rounded to six decimals. The last
/// bits of the machine's exponential function thus rarely change it. Under a light with a size it has the points alone:
/// there the last bits of a point decide the random numbers of its mean.
pub fn fingerprint(points: &VisiblePoints) -> String {
    let mut text = String::new();
    for ((point, weight), exact) in points.points_mm().iter().zip(points.weights()).zip(points.exact()) {
        let exact = if points.is_soft() { 0.0 } else { *exact };
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

/// Whether the hash of a cell's points is the one that the benchmark expects.
pub fn is_expected(cell: &str, hash: &str) -> bool {
    EXPECTED.get(cell).is_some_and(|expected| *expected == hash)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::definition::Definition;

    #[test]
    fn every_cell_has_an_expected_hash() {
        let cells = Definition::frozen().unwrap().cells();
        assert_eq!(EXPECTED.len(), cells.len());
        for cell in cells {
            let hash = EXPECTED.get(&*cell.name).unwrap_or_else(|| panic!("{} has no hash", cell.name));
            assert!(hash.len() == DIGITS && is_expected(&cell.name, hash) && !is_expected(&cell.name, ""));
        }
    }
}
