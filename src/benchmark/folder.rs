//! Folder of benchmark results: `run.json` says how the benchmark runs, and `cells` has a JSON file for each measured
//! cell. A run that was ended resumes with the cells that have no file.

use super::answer::CellResult;
use super::definition::Cell;
use crate::error::{Error, Result};
use crate::files::output::{prepare_output_dir, write_whole};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};

const WHAT: &str = "cannot use benchmark folder";
/// Name of the file that says how a benchmark runs.
const RUN: &str = "run.json";
const RUN_HINT: &str = "choose another folder with -o";
const CELL_HINT: &str = "remove the file to measure the cell again";

/// Conditions of a benchmark run, which all cells of a folder share.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Conditions {
    /// Version of the benchmark.
    pub version: u32,
    /// Number of visible points in each cell.
    pub points: usize,
    /// Names of the shadow methods.
    pub methods: Vec<String>,
    /// Budgets within which settings are searched, in the syntax of `--budget`.
    pub budgets: Vec<String>,
    /// Names and commands of external programs, `NAME=COMMAND`.
    pub externals: Vec<String>,
    /// Name of the graphics adapter.
    pub adapter: String,
    /// Driver of the graphics adapter.
    pub driver: String,
    /// Revision of the program.
    pub revision: String,
    /// Revision of the program that searched the settings, if they are those of an earlier run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settings_revision: Option<String>,
}

/// Folder of benchmark results.
pub struct Folder<'a>(&'a Path);

impl<'a> Folder<'a> {
    /// Opens a folder of results, and creates it where it is missing.
    ///
    /// # Errors
    /// The folder holds the results of other conditions, or cannot be written.
    pub fn open(path: &'a Path, conditions: &Conditions) -> Result<Self> {
        prepare_output_dir(path)?;
        let run = path.join(RUN);
        let known = if run.exists() { read_json(&run, RUN_HINT)? } else { conditions.clone() };
        if known != *conditions {
            let why = "it holds results of other methods, budgets or programs, another adapter or revision";
            return Err(Error::input(WHAT, path.display(), why).hint("choose another folder with -o"));
        }
        prepare_output_dir(&path.join("cells"))?;
        if !run.exists() {
            write_json(&run, conditions)?;
        }
        Ok(Self(path))
    }

    /// Opens a folder of results to read it. Returns `None` if it holds no results of the benchmark.
    ///
    /// # Errors
    /// `run.json` cannot be read.
    pub fn archived(path: &'a Path) -> Result<Option<(Self, Conditions)>> {
        let is_there = path.join("cells").is_dir() && path.join(RUN).is_file();
        is_there.then(|| Ok((Self(path), read_json(&path.join(RUN), RUN_HINT)?))).transpose()
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        self.0
    }

    /// Returns the recorded result of a cell; `None` if it was not measured.
    ///
    /// # Errors
    /// The file of the cell cannot be read.
    pub fn result(&self, cell: &Cell) -> Result<Option<CellResult>> {
        let path = self.file(cell);
        if path.exists() { read_json(&path, CELL_HINT).map(Some) } else { Ok(None) }
    }

    /// Records the result of a cell.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn record(&self, cell: &Cell, result: &CellResult) -> Result<()> {
        write_json(&self.file(cell), result)
    }

    fn file(&self, cell: &Cell) -> PathBuf {
        self.0.join("cells").join(format!("{}.json", cell.name))
    }
}

fn read_json<T: for<'de> Deserialize<'de>>(path: &Path, hint: &str) -> Result<T> {
    let bytes = fs::read(path).map_err(|e| Error::runtime(WHAT, path.display(), e))?;
    serde_json::from_slice(&bytes).map_err(|e| Error::input(WHAT, path.display(), e).hint(hint))
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::runtime(WHAT, path.display(), e))?;
    write_whole(path, |file| file.write_all(text.as_bytes()))
}
