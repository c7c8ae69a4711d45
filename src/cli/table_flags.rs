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
    /// Fails if the output folder cannot be used, or if it holds an earlier table of this name and `--overwrite` is
    /// not set.
    ///
    /// # Errors
    /// The folder cannot be used, or an earlier table is there.
    pub fn check(&self, name: &str) -> Result<()> {
        check_output_dir(&self.output)?;
        if self.overwrite { Ok(()) } else { check_no_table(&self.output, &format!("{name}.csv")) }
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
        for (ending, bytes) in [("csv", &csv(rows)?[..]), ("md", page.as_bytes())] {
            let path = self.output.join(format!("{name}.{ending}"));
            write_whole(&path, |file| file.write_all(bytes))?;
            print_message("table", &path.display());
        }
        if self.json { print_result(&json(rows)?) } else { print_result(&summary) }
    }
}
