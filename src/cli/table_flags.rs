//! Flags of the commands that write one table of results: `claims` and `stability`.

use super::console::{print_message, print_result};
use crate::error::Result;
use crate::files::output::{check_no_table, check_output_dir, prepare_output_dir, write_whole};
use crate::gpu::Gpu;
use crate::render::Renderer;
use crate::report::writers::{csv, json};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
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
    /// Overwrite the table of an earlier run in DIR
    #[arg(long)]
    pub overwrite: bool,
    /// Print the rows of the table as JSON
    #[arg(long)]
    pub json: bool,
}

impl TableFlags {
    /// Checks that the output folder can take the table of this name. Fails if an earlier table is there and
    /// `--overwrite` is not set.
    ///
    /// # Errors
    /// The folder cannot be used, or an earlier table is there.
    pub fn check(&self, name: &str) -> Result<()> {
        check_output_dir(&self.output)?;
        if self.overwrite { Ok(()) } else { check_no_table(&self.output, &format!("{name}.csv")) }
    }

    /// Opens the graphics device, then creates the output folder. A rejected input therefore leaves no empty folder.
    ///
    /// # Errors
    /// The device cannot be opened, or the folder cannot be created.
    pub fn open(&self) -> Result<Arc<Renderer>> {
        let renderer = Renderer::new(Gpu::open(self.adapter.as_deref())?);
        prepare_output_dir(&self.output)?;
        Ok(Arc::new(renderer))
    }

    /// Writes a table of results as CSV, with its Markdown page. Prints the rows as JSON, or a summary.
    ///
    /// # Errors
    /// A file or stdout cannot be written.
    pub fn write(&self, name: &str, rows: &[impl Serialize], page: &str, summary: &str) -> Result<()> {
        for (ending, bytes) in [("csv", &csv(rows)?[..]), ("md", page.as_bytes())] {
            let path = self.output.join(format!("{name}.{ending}"));
            write_whole(&path, |file| file.write_all(bytes))?;
            print_message("table", &path.display());
        }
        if self.json { print_result(&json(rows)?) } else { print_result(&summary) }
    }
}
