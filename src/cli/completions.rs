//! `umbravox completions`: files that shells and `man` read.

use super::console::print_result;
use crate::error::{Error, Result};
use clap::Args;
use clap_complete::Shell;
use std::path::PathBuf;

/// Print the completions of a shell, or write man pages
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct CompletionsArgs {
    /// Shell whose completions are printed
    #[arg(value_name = "SHELL")]
    shell: Option<Shell>,
    /// Write the man pages of all commands into an existing folder
    #[arg(long, value_name = "FOLDER")]
    man: Option<PathBuf>,
}

/// Runs the `completions` command for the definition of the command line.
///
/// # Errors
/// The folder does not exist, or a file or stdout cannot be written.
pub fn run(args: &CompletionsArgs, mut command: clap::Command) -> Result<()> {
    if let Some(folder) = &args.man {
        if !folder.is_dir() {
            return Err(Error::input("cannot write man pages", folder.display(), "it is not a folder"));
        }
        let failed = |e| Error::runtime("cannot write man pages", folder.display(), e);
        return clap_mangen::generate_to(command, folder).map_err(failed);
    }
    let mut text = Vec::new();
    if let Some(shell) = args.shell {
        clap_complete::generate(shell, &mut command, "umbravox", &mut text);
    }
    print_result(&String::from_utf8_lossy(&text))
}
