//! `umbravox phantom`: writes a built-in volume (phantom) or set of strands to a file.

use crate::error::Result;
use crate::files::output::check_output;
use crate::formats::{NIFTI_EXTENSIONS, write_nifti};
use crate::phantom::Phantom;
use crate::strands::{HAIR_EXTENSIONS, StrandSet, write_hair};
use clap::Args;
use std::path::{Path, PathBuf};

/// Write a built-in volume (phantom) or set of strands to a file
#[derive(Debug, Args)]
pub struct PhantomArgs {
    /// Name of the built-in volume, with its size in voxels along the longest side; or of the strands, with their
    /// number of segments
    #[arg(value_name = "NAME[:SIZE]", long_help = names_help())]
    pub name: String,
    /// Output file: .nii or .nii.gz for a volume, .hair for strands
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

fn names_help() -> String {
    let mut help = String::from("Name, with the size in voxels along the longest side:\n");
    for phantom in Phantom::ALL {
        let (name, size) = (phantom.name(), phantom.default_size());
        help += &format!("\n  {name:<8} {} [default size: {size}]", phantom.description());
    }
    help += "\n\nStrands, and their number of segments:\n";
    for set in StrandSet::ALL {
        let (name, segments) = (set.name(), StrandSet::DEFAULT_SEGMENTS);
        help += &format!("\n  {name:<14} {} [default segments: {segments}]", set.description());
    }
    help
}

/// Builds the phantom or set of strands `NAME[:SIZE]` and writes it to a file.
///
/// # Errors
/// No such phantom or strand set, or the file cannot be written.
pub fn run(name: &str, output: &Path) -> Result<()> {
    if name.starts_with("hair-") {
        let (set, segments) = StrandSet::parse(name)?;
        check_output(output, HAIR_EXTENSIONS).map_err(|e| {
            let as_volume = check_output(output, NIFTI_EXTENSIONS).is_ok();
            if as_volume { e.hint("voxelise writes strands as a volume") } else { e }
        })?;
        return write_hair(&set.build(segments)?, output);
    }
    let (phantom, size) = Phantom::parse(name, &StrandSet::ALL.map(StrandSet::name))?;
    check_output(output, NIFTI_EXTENSIONS)?;
    write_nifti(&phantom.build(size)?, output)
}
