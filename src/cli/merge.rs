//! `umbravox merge`: combines the tables of several jobs.

use super::compare::{LayoutFlags, list_files};
use super::console::{print_message, print_result};
use crate::error::{Error, Result};
use crate::files::output::{check_output_dir, prepare_output_dir};
use crate::report::Start;
use crate::report::merge::merge;
use crate::report::tables::summary;
use clap::Args;
use std::path::PathBuf;

/// Combine the tables of several folders of `compare`: shards of one sweep, or the same scenes on other adapters
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Folders of finished tables of the same program, scenes and effort
    #[arg(required = true, value_name = "DIR")]
    pub folders: Vec<PathBuf>,
    /// The folder for the merged table; made when it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Merge what is there although rows of the sweep are in none of the folders
    #[arg(long)]
    pub partial: bool,
    /// Remove all files of the table that the output folder holds, and no others
    #[arg(long)]
    pub overwrite: bool,
    /// Print the rows as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub layout: LayoutFlags,
}

/// Runs the command.
///
/// # Errors
/// Folders that do not belong together, or a file that cannot be read or written.
pub fn run(args: &MergeArgs) -> Result<()> {
    let layout = args.layout.layout()?;
    check_output_dir(&args.output)?;
    let place = |path: &PathBuf| path.canonicalize().ok();
    let output = place(&args.output);
    if let Some(same) = args.folders.iter().find(|f| output.is_some() && place(f) == output) {
        return Err(Error::input("cannot merge", same.display(), "it is the output folder too"));
    }
    let start = if args.overwrite { Start::Overwrite } else { Start::New };
    let merged = merge(&args.folders, args.partial)?;
    merged.check(&args.output, start).map_err(|e| Error {
        hint: Some("--overwrite removes all its files first, or give another folder".into()),
        ..e
    })?;
    prepare_output_dir(&args.output)?;
    let (rows, json) = (merged.rows(), args.json.then(|| merged.json()).transpose()?);
    let files = merged.write(&args.output, start, &layout)?;
    let failed = rows.iter().filter(|r| r.has_failed()).count();
    if failed > 0 {
        print_message("warning", &format_args!("{failed} of {} rows had failed", rows.len()));
    }
    match json {
        Some(json) => print_result(&json)?,
        None => print_result(&summary(&rows, &layout))?,
    }
    list_files(&files);
    Ok(())
}
