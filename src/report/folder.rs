//! Output folder of a comparison of shadow methods: a new table must neither overwrite an earlier one nor mix with
//! it.

use super::names::RUN;
use super::run::{RowRecord, Run};
use crate::error::{Error, Result};
use crate::files::output::write_whole;
use crate::measure::journal::JOURNAL;
use std::path::{Component, Path};

/// Action if the output folder already contains a comparison table: report an error, resume it or overwrite it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Reports an error if the output folder already contains a comparison table.
    New,
    /// Continues the comparison table in the output folder, which must have the same scenes and settings.
    Resume,
    /// Removes the files of the earlier comparison table from the output folder, and no other files.
    Overwrite,
}

impl Run {
    /// Reads `run.json`, the description of how a comparison was measured, from its result folder. Returns `None` if
    /// the file does not exist.
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

    /// Writes `run.json`, the description of how the comparison was measured, into its result folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(RUN);
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::runtime("cannot write file", path.display(), e))?;
        write_whole(&path, |file| writeln!(file, "{text}"))
    }

    /// Returns an error if writing this comparison into a folder would overwrite an earlier comparison table or mix
    /// the two. Accepts a missing folder and a folder without a table; changes no file.
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

    /// Returns the reason why this comparison cannot continue the earlier one in its output folder; `None` if it can.
    /// The number of timing repeats may differ.
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

    /// Prepares the output folder of a comparison: removes files of an earlier comparison if requested, then writes
    /// `run.json`, the scene files and the transfer functions. `tf_texts` contains the text of each scene's
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

    /// Removes the result files of an earlier comparison from its folder. It keeps `run.json` and the journal (file
    /// that records finished measurements), which is in use.
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
