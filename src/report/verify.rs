//! Verification of an archived comparison: compares its recorded errors and sizes with those of a new measurement.

use super::run::{RowRecord, Run};
use crate::error::{Error, Result};
use crate::measure::table::{COLUMNS, Row};
use std::collections::BTreeMap;
use std::path::Path;

/// Beginnings of the names of columns that depend on program, scene and adapter alone: errors, bounds, sizes and counts.
const VERIFIED: [&str; 13] = [
    "map",
    "bytes",
    "nodes_",
    "point_",
    "ray_err",
    "image_",
    "shadow_",
    "flip",
    "bound",
    "strand_err",
    "flicker",
    "enclosure_",
    "certified_",
];

/// Difference between the program that recorded a value and this one, which decides how well they must agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recorder {
    /// Nothing: adapter, driver and revision are the same.
    Same,
    /// The revision of the program: compilers round sums in another order.
    OtherRevision,
    /// The adapter or its driver.
    OtherAdapter,
}

impl Recorder {
    /// Compares the adapter, the driver and the revision of a recorded value with those of this program.
    pub fn of(recorded: [&str; 3], here: [&str; 3]) -> Self {
        match recorded == here {
            true => Self::Same,
            false if recorded[..2] == here[..2] => Self::OtherRevision,
            false => Self::OtherAdapter,
        }
    }

    /// Relative and absolute tolerance of numbers.
    fn tolerance(self) -> [f64; 2] {
        match self {
            Self::Same => [0.0; 2],
            Self::OtherRevision => [1e-5, 1e-8],
            Self::OtherAdapter => [0.02, 1e-4],
        }
    }
}

/// Recorded value that differs from a new measurement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Row of the table, or cell, budget and method of the benchmark.
    pub row: String,
    /// Name of the column.
    pub column: String,
    /// Recorded value.
    pub recorded: String,
    /// Value of the new measurement.
    pub measured: String,
}

/// Result of a verification: number of compared values, and those that differ.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Verified {
    /// Number of compared values.
    pub values: usize,
    /// Recorded values that differ from the new measurement.
    pub differences: Vec<Difference>,
    /// Number of recorded values that another revision or adapter need not reproduce, and of verdicts and figures that
    /// depend on times. Columns of times are not counted.
    pub not_compared: usize,
}

impl Verified {
    /// Adds the result on another table.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.values += other.values;
        self.differences.extend(other.differences);
        self.not_compared += other.not_compared;
        self
    }

    /// Compares a recorded value with a measured one, as texts. If `by` is [`Recorder::Same`] they must be equal, else
    /// numbers may differ a little.
    pub fn compare(&mut self, row: &str, column: &str, [recorded, measured]: [&str; 2], by: Recorder) {
        self.values += 1;
        if recorded == measured || is_close([recorded, measured], by) {
            return;
        }
        let [row, column, recorded, measured] = [row, column, recorded, measured].map(str::to_owned);
        self.differences.push(Difference { row, column, recorded, measured });
    }
}

fn is_close([recorded, measured]: [&str; 2], by: Recorder) -> bool {
    let [relative, absolute] = by.tolerance();
    match (recorded.parse::<f64>(), measured.parse::<f64>()) {
        (Ok(a), Ok(b)) => a.is_finite() && (a - b).abs() <= absolute + relative * a.abs(),
        _ => false,
    }
}

/// Archived comparison of a result folder: how it was measured, and the texts of its table.
pub struct Archive {
    /// Description of how the comparison was measured.
    pub run: Run,
    rows: Vec<BTreeMap<String, String>>,
}

impl Archive {
    /// Reads `run.json` and `compare.csv` of a result folder.
    ///
    /// # Errors
    /// A file is missing or cannot be read, or the two do not belong together.
    pub fn read(folder: &Path) -> Result<Self> {
        let refuse = |why: &str| Error::input("cannot verify", folder.display(), why);
        let run = Run::read(folder)?.ok_or_else(|| refuse("it has no run.json"))?;
        let rows = read_texts(&folder.join("compare.csv"))?;
        if !run.finished || !run.merged.is_empty() {
            return Err(refuse("its table is unfinished or merged from others"));
        }
        let archive = Self { run, rows };
        if archive.records().count() != archive.rows.len() {
            return Err(refuse("compare.csv has another number of rows than run.json"));
        }
        Ok(archive)
    }

    /// Records of the rows of the table, in order.
    pub fn records(&self) -> impl Iterator<Item = &RowRecord> {
        self.run.rows.iter().filter(|row| row.here)
    }

    /// Compares the recorded rows with measured ones in the same order.
    pub fn compare(&self, measured: &[Row]) -> Verified {
        let mut verified = Verified::default();
        let names = COLUMNS.iter().map(|column| column.name);
        let names: Vec<_> =
            names.filter(|name| VERIFIED.iter().any(|start| name.starts_with(start))).collect();
        for (recorded, row) in self.rows.iter().zip(measured) {
            let facts = ["adapter", "driver", "revision"];
            let before = facts.map(|name| recorded.get(name).map_or("", String::as_str));
            let here = facts.map(|name| row.cell(name).to_string());
            let by = Recorder::of(before, here.each_ref().map(String::as_str));
            let title = format!("{}: {}", row.scene, row.spec());
            for name in &names {
                // Columns that a later version added are not compared.
                let Some(text) = recorded.get(*name) else { continue };
                // Random numbers depend on the last bits of positions.
                if row.point_variance.is_some() && by != Recorder::Same && !["map", "bytes"].contains(name) {
                    verified.not_compared += 1;
                    continue;
                }
                verified.compare(&title, name, [text, &row.cell(name).to_string()], by);
            }
        }
        verified
    }
}

/// Reads the rows of an archived table, each as texts by column.
///
/// # Errors
/// The file is missing or is no table.
pub fn read_texts(path: &Path) -> Result<Vec<BTreeMap<String, String>>> {
    let unreadable = |e: csv::Error| Error::input("cannot verify", path.display(), e);
    let mut reader = csv::Reader::from_path(path).map_err(unreadable)?;
    reader.deserialize().collect::<csv::Result<_>>().map_err(unreadable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerance_depends_on_what_differs() {
        use Recorder::{OtherAdapter, OtherRevision, Same};
        let by = |driver, revision| Recorder::of(["a", "d", "r"], ["a", driver, revision]);
        assert_eq!([by("d", "r"), by("d", "s"), by("e", "r")], [Same, OtherRevision, OtherAdapter]);
        let mut verified = Verified::default();
        for (values, by) in [
            (["0.0123", "0.0123"], Same),
            (["0.0123", "0.0123000001"], OtherRevision),
            (["0.0123", "0.0124"], OtherAdapter),
            (["", ""], OtherAdapter),
            (["12", "12"], Same),
        ] {
            verified.compare("r", "c", values, by);
        }
        assert_eq!((verified.values, &verified.differences[..]), (5, &[][..]));
        for (values, by) in [
            (["0.0123", "0.0123000001"], Same),
            (["0.0123", "0.0124"], OtherRevision),
            (["0.0123", "0.02"], OtherAdapter),
            (["", "0.1"], OtherAdapter),
            (["inf", "0.1"], OtherRevision),
        ] {
            verified.compare("r", "c", values, by);
        }
        assert_eq!(verified.differences.len(), 5);
        assert_eq!(verified.differences[0].recorded, "0.0123");
    }
}
