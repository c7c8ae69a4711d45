//! `umbravox merge`: combines the comparison tables of several runs of `umbravox compare`.

use super::compare::{LayoutFlags, list_files};
use super::console::{print_message, print_result};
use crate::error::{Error, Result};
use crate::files::output::{check_output_dir, prepare_output_dir};
use crate::report::Start;
use crate::report::merge::merge;
use crate::report::tables::summary;
use clap::Args;
use std::path::PathBuf;

/// Combine the comparison tables in several folders of `compare`: shards of one table, or the same scenes on other
/// adapters
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Folders with finished comparison tables, made by the same program with the same scenes and sample counts
    #[arg(required = true, value_name = "DIR")]
    pub folders: Vec<PathBuf>,
    /// Folder for the merged comparison table; created if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Merge the rows that are available, even if some rows of the table are in none of the folders
    #[arg(long)]
    pub partial: bool,
    /// Remove all files of an earlier table from the output folder, and no others
    #[arg(long)]
    pub overwrite: bool,
    /// Print the rows of the merged table as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub layout: LayoutFlags,
}

/// Runs the `merge` command: combines comparison tables and writes the merged table.
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
