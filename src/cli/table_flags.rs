//! Flags of the commands that write one table of results: `claims` and `stability`.

use super::console::{print_message, print_result};
use crate::error::{Error, Result};
use crate::files::output::{check_no_table, check_output_dir, prepare_output_dir, write_whole};
use crate::gpu::Gpu;
use crate::measure::facts::Facts;
use crate::render::Renderer;
use crate::report::verify::Recorder;
use crate::report::writers::{csv, json};
use clap::Args;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Flags for the output folder and the graphics device of the commands `claims` and `stability`.
#[derive(Debug, Args)]
pub struct TableFlags {
    /// Folder for the table of results as .csv and .md; created if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Use the graphics adapter whose name contains NAME [default: the fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Resume an interrupted run of the same settings in DIR
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Overwrite the table of an earlier run in DIR
    #[arg(long)]
    pub overwrite: bool,
    /// Print the rows of the table as JSON
    #[arg(long)]
    pub json: bool,
}

/// Table of an earlier run, with its Markdown page.
pub struct Earlier<R> {
    pub rows: Vec<R>,
    pub page: String,
}

/// Error of a table that `--resume` cannot continue.
pub fn cannot_resume(place: impl fmt::Display, why: impl fmt::Display) -> Error {
    Error::input("cannot resume", place, why).hint(
        "--resume needs the command line of the earlier run; --overwrite starts anew, or give another folder",
    )
}

/// Reads the table of a finished run from its folder, and compares its conditions with those here. They are a line of the
/// Markdown page; without it, the table counts as one of another adapter, and a note says so.
///
/// # Errors
/// The table or the page cannot be read.
pub fn archived<R: DeserializeOwned>(
    folder: &Path,
    name: &str,
    here: &Facts,
) -> Result<(Earlier<R>, Recorder)> {
    let table = folder.join(format!("{name}.csv"));
    let refuse = |e: csv::Error| Error::input("cannot verify", table.display(), e);
    let mut reader = csv::Reader::from_path(&table).map_err(refuse)?;
    let rows = reader.deserialize().collect::<Result<Vec<R>, _>>().map_err(refuse)?;
    let page = folder.join(format!("{name}.md"));
    let page = match std::fs::read_to_string(&page) {
        Err(e) if e.kind() == ErrorKind::NotFound => {
            let why = "is missing: the table counts as one of another adapter";
            print_message("note", &format_args!("{} {why}", page.display()));
            String::new()
        }
        text => text.map_err(|e| Error::input("cannot verify", page.display(), e))?,
    };
    let has = |text: &str| {
        let ends = |rest: &str| rest.starts_with([',', '.', ';']);
        page.lines().any(|line| line.strip_prefix(text).is_some_and(ends))
    };
    let by = match (has(&here.conditions()), has(&here.device())) {
        (true, _) => Recorder::Same,
        (_, true) => Recorder::OtherRevision,
        _ => Recorder::OtherAdapter,
    };
    Ok((Earlier { rows, page }, by))
}

impl TableFlags {
    /// Fails if the output folder cannot be used, or if it holds an earlier table of this name and neither `--overwrite`
    /// nor `--resume` is set.
    ///
    /// # Errors
    /// The folder cannot be used, or an earlier table is there.
    pub fn check(&self, name: &str) -> Result<()> {
        check_output_dir(&self.output)?;
        if self.overwrite || self.resume {
            return Ok(());
        }
        check_no_table(&self.output, &format!("{name}.csv"))
    }

    /// Reads the table of an earlier run for `--resume`; empty without that flag, or if the folder has no table.
    /// `conditions` is the line of the Markdown page with the conditions of this run.
    ///
    /// # Errors
    /// The table cannot be read, or it was measured under other conditions.
    pub fn earlier<R: DeserializeOwned>(&self, name: &str, conditions: &str) -> Result<Earlier<R>> {
        let [table, page] = ["csv", "md"].map(|ending| self.output.join(format!("{name}.{ending}")));
        if !self.resume || !table.exists() {
            return Ok(Earlier { rows: Vec::new(), page: String::new() });
        }
        let text = std::fs::read_to_string(&page).map_err(|e| cannot_resume(page.display(), e))?;
        if !text.lines().any(|line| line == conditions) {
            let found =
                text.lines().find(|line| line.starts_with("Adapter ")).unwrap_or("unknown conditions");
            return Err(cannot_resume(
                page.display(),
                format!("it was measured with: {found} Now: {conditions}"),
            ));
        }
        let refuse = |e: csv::Error| cannot_resume(table.display(), e);
        let mut reader = csv::Reader::from_path(&table).map_err(refuse)?;
        let rows = reader.deserialize().collect::<Result<Vec<R>, _>>().map_err(refuse)?;
        print_message("note", &format_args!("{} holds {} rows", table.display(), rows.len()));
        Ok(Earlier { rows, page: text })
    }

    /// Opens the graphics device, and only then creates the output folder. If the device cannot be opened, no empty
    /// folder is left behind.
    ///
    /// # Errors
    /// The device cannot be opened, or the folder cannot be created.
    pub fn open(&self) -> Result<Arc<Renderer>> {
        let renderer = Renderer::new(Gpu::open(self.adapter.as_deref())?);
        prepare_output_dir(&self.output)?;
        Ok(Arc::new(renderer))
    }

    /// Writes the table of results of `claims` or `stability` as CSV and as a Markdown page. Prints the rows as JSON,
    /// or `summary`.
    ///
    /// # Errors
    /// A file or stdout cannot be written.
    pub fn write(&self, name: &str, rows: &[impl Serialize], page: &str, summary: &str) -> Result<()> {
        // `--resume` reads the conditions of the page, which must not be those of an older table.
        for (ending, bytes) in [("md", page.as_bytes()), ("csv", &csv(rows)?[..])] {
            let path = self.output.join(format!("{name}.{ending}"));
            write_whole(&path, |file| file.write_all(bytes))?;
            print_message("table", &path.display());
        }
        if self.json { print_result(&json(rows)?) } else { print_result(&summary) }
    }
}
