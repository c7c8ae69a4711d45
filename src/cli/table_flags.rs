//! Flags of commands that measure one table: `claims` and `stability`.

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

/// Flags about the output and the device.
#[derive(Debug, Args)]
pub struct TableFlags {
    /// Folder for the table as .csv and .md; created if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Use the graphics adapter whose name contains NAME [default: the fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Overwrite a table in DIR
    #[arg(long)]
    pub overwrite: bool,
    /// Print the rows as JSON
    #[arg(long)]
    pub json: bool,
}

impl TableFlags {
    /// Refuses a folder that cannot hold the table of this name.
    ///
    /// # Errors
    /// A fault of the command line.
    pub fn check(&self, name: &str) -> Result<()> {
        check_output_dir(&self.output)?;
        if self.overwrite { Ok(()) } else { check_no_table(&self.output, &format!("{name}.csv")) }
    }

    /// Opens the device, then creates the folder, so that a refused input leaves no empty one.
    ///
    /// # Errors
    /// A device or a folder that is missing.
    pub fn open(&self) -> Result<Arc<Renderer>> {
        let renderer = Renderer::new(Gpu::open(self.adapter.as_deref())?);
        prepare_output_dir(&self.output)?;
        Ok(Arc::new(renderer))
    }

    /// Writes the table and its page; prints the rows as JSON, or a summary.
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
