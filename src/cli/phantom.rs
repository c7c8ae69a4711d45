//! `umbravox phantom`: a built-in volume as a file.

use crate::error::Result;
use crate::output::check_output;
use crate::volume::{NIFTI_EXTENSIONS, Phantom, write_nifti};
use clap::Args;
use std::path::{Path, PathBuf};

/// Write a built-in volume to a file
#[derive(Debug, Args)]
pub struct PhantomArgs {
    /// Which one, and its size in voxels along the longest side
    #[arg(value_name = "NAME[:SIZE]", long_help = names_help())]
    pub name: String,
    /// The file: .nii or .nii.gz
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

fn names_help() -> String {
    let mut help = String::from("Which one, and its size in voxels along the longest side:\n");
    for phantom in Phantom::ALL {
        let (name, size) = (phantom.name(), phantom.default_size());
        help += &format!("\n  {name:<8} {} [default size: {size}]", phantom.description());
    }
    help
}

/// Builds `NAME[:SIZE]` and writes it.
///
/// # Errors
/// No such phantom, or the file cannot be written.
pub fn run(name: &str, output: &Path) -> Result<()> {
    let (phantom, size) = Phantom::parse(name)?;
    check_output(output, NIFTI_EXTENSIONS)?;
    write_nifti(&phantom.build(size)?, output)
}
