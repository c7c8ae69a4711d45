//! `umbravox convert`: converts a volume from any readable file format to any writable one.

use super::console::print_message;
use crate::error::Result;
use crate::files::output::check_output;
use crate::formats::{VOLUME_EXTENSIONS, write_volume};
use crate::open::{ReadFlags, VolumeSpec, load};
use clap::Args;
use std::path::PathBuf;

/// Convert a volume to another file format; voxel values and affine stay the same
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// Volume to convert: a file, a DICOM folder, strands, or a built-in volume phantom:NAME[:SIZE]
    #[arg(value_name = "VOLUME")]
    pub volume: String,
    #[command(flatten)]
    pub volume_flags: ReadFlags,
    /// Output file of the volume: .nii, .nii.gz, .nrrd, .mha, .vti, .npy or .raw; .npy and .raw get an extra .json with grid,
    /// scaling and affine
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// Runs the `convert` command: reads a volume and writes it in another file format.
///
/// # Errors
/// The volume cannot be read, or the file cannot be written.
pub fn run(args: &ConvertArgs) -> Result<()> {
    check_output(&args.output, VOLUME_EXTENSIONS)?;
    let volume = load(&VolumeSpec { source: args.volume.clone(), flags: args.volume_flags.clone() })?;
    volume.provenance.warnings.iter().for_each(|warning| print_message("warning", warning));
    write_volume(&volume, &args.output)
}
