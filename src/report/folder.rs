//! Output folder of a comparison table: refuses to overwrite an earlier table by accident or to mix two tables.

use super::names::RUN;
use super::run::{RowRecord, Run};
use crate::error::{Error, Result};
use crate::files::output::write_whole;
use crate::measure::journal::JOURNAL;
use std::path::{Component, Path};

/// Treatment of an earlier comparison table that the output folder already contains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Treats an existing table in the output folder as an error.
    New,
    /// Resumes the existing table in the output folder; scenes and settings must be equal.
    Resume,
    /// Removes the files of the existing table in the output folder, and no other files.
    Overwrite,
}

impl Run {
    /// Reads the run description `run.json` of a table's folder; returns `None` if the file does not exist.
    ///
    /// # Errors
    /// The file exists but cannot be read.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(RUN);
        let refuse = |why: String| {
            Error::input("cannot read the record of a table", path.display(), why)
                .hint("give another folder, or remove this file and those of its table")
        };
        match std::fs::read(&path) {
            Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|e| refuse(e.to_string())),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(refuse(e.to_string())),
        }
    }

    /// Writes the run description `run.json` into a table's folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(RUN);
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::runtime("cannot write file", path.display(), e))?;
        write_whole(&path, |file| writeln!(file, "{text}"))
    }

    /// Returns an error if writing this table into a folder would lose an earlier table or mix the two. Accepts a
    /// missing folder and a folder without a table; changes no file.
    ///
    /// # Errors
    /// Input error: the folder contains a table that must not be overwritten.
    pub fn check(&self, folder: &Path, start: Start) -> Result<()> {
        let place = folder.display();
        let earlier = Self::read(folder)?;
        let holds = |name: &str| std::fs::metadata(folder.join(name)).is_ok_and(|m| m.len() > 0);
        if !holds(JOURNAL) && !holds("compare.csv") {
            return Ok(());
        }
        let Some(earlier) = earlier else {
            let why = "it holds a table without run.json, which would say what belongs to it";
            return Err(Error::input("cannot write table", place, why)
                .hint("give another folder, or remove that table"));
        };
        match start {
            Start::Overwrite => Ok(()),
            Start::New => {
                let state = if earlier.finished { "a table" } else { "an unfinished table" };
                let why = format!("it holds {state} already");
                Err(Error::input("cannot write table", place, why)
                    .hint("--resume goes on with it; --overwrite removes all its files and starts anew"))
            }
            Start::Resume => match self.differs_from(&earlier) {
                None => Ok(()),
                Some(why) => Err(Error::input("cannot resume", place, why)
                    .hint("--overwrite removes all its files and starts anew, or give another folder")),
            },
        }
    }

    /// Reason why this run cannot resume the table of an earlier run, if any. The number of timing repeats may
    /// differ.
    fn differs_from(&self, earlier: &Self) -> Option<String> {
        if !earlier.merged.is_empty() {
            return Some("its table was merged from several".into());
        }
        if self.adapter != earlier.adapter {
            return Some(format!("it was measured on {}, not {}", earlier.adapter, self.adapter));
        }
        if self.shard != earlier.shard {
            let shard =
                |run: &Self| run.shard.as_ref().map_or("the whole table".into(), |s| format!("shard {s}"));
            return Some(format!("it is {}, not {}", shard(earlier), shard(self)));
        }
        if let Some(difference) = self.sweep_differs(earlier) {
            return Some(difference);
        }
        if let Some(budget) = earlier.budgets.iter().find(|b| !self.budgets.contains(b)) {
            return Some(format!(
                "its rows are tuned within {budget}, which is not among the requested budgets"
            ));
        }
        // Rows that a budget search added follow from the budgets.
        let lost = |row: &&RowRecord| {
            let requested = row.here && !row.chosen;
            requested && !self.rows.iter().any(|r| r.here && (r.scene, &r.slug) == (row.scene, &row.slug))
        };
        let row = earlier.rows.iter().find(lost)?;
        Some(format!("{} is among its rows and not among the requested ones", row.method))
    }

    /// Prepares the output folder of a comparison: removes files of an earlier run if requested, then writes
    /// `run.json`, the scene files and the transfer functions. `tf_texts` has the text of each scene's
    /// transfer-function file.
    ///
    /// # Errors
    /// A file cannot be removed or written.
    pub fn begin(&mut self, folder: &Path, start: Start, tf_texts: &[Option<String>]) -> Result<()> {
        let earlier = Self::read(folder)?;
        if let Some(earlier) = earlier.as_ref().filter(|_| start == Start::Overwrite) {
            earlier.remove_files(folder)?;
        }
        self.again = self.command_again(folder);
        self.files = self.file_names();
        // Rows that a budget search added are not planned, but their files exist.
        let earlier_files =
            earlier.filter(|_| start == Start::Resume).map_or_else(Vec::new, |earlier| earlier.files);
        let more: Vec<String> = earlier_files.into_iter().filter(|name| !self.files.contains(name)).collect();
        self.files.extend(more);
        self.finished = false;
        self.write(folder)?;
        for (scene, tf) in self.scenes.iter().zip(tf_texts) {
            if !scene.file.is_empty() {
                write_whole(&folder.join(&scene.file), |file| file.write_all(scene.settings.as_bytes()))?;
            }
            if let Some(text) = tf {
                write_whole(&folder.join(&scene.tf_file), |file| file.write_all(text.as_bytes()))?;
            }
        }
        Ok(())
    }

    /// Removes the result files of an earlier run from its folder, except the journal of measured rows, which is
    /// open, and `run.json`.
    fn remove_files(&self, folder: &Path) -> Result<()> {
        for name in self.files.iter().filter(|name| *name != JOURNAL && *name != RUN) {
            // Never removes files outside the folder, whatever `run.json` lists.
            let mut parts = Path::new(name).components();
            if !matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None)) {
                continue;
            }
            match std::fs::remove_file(folder.join(name)) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                    return Err(Error::runtime("cannot remove file", folder.join(name).display(), e));
                }
                _ => {}
            }
        }
        Ok(())
    }
}
