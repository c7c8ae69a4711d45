//! Command-line flags for strands, and loading of strands.

use super::layer::layer;
use super::values;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::strands::{
    DEFAULT_RESOLUTION, Kernel, StrandFormat, StrandSet, StrandVolume, Strands, read_strands,
};
use clap::Args;
use serde::Serialize;
use std::path::Path;

layer! {
/// Command-line flags for voxelising strands; a flag that is not given is `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Args, Serialize)]
pub struct StrandFlags {
    /// Voxels along the longest side of the strand grid, 4 to 1024 [default: 256]
    #[arg(long, value_name = "N", value_parser = values::resolution, allow_hyphen_values = true, help_heading = "Strands")]
    pub resolution: Option<usize>,
    /// Kernel that distributes the length of strands over voxels: box (the exact length in each voxel), or tent
    /// (trilinear weights) [default: box]
    #[arg(long, value_enum, value_name = "KERNEL", help_heading = "Strands", hide_possible_values = true)]
    pub kernel: Option<Kernel>,
    /// Diameter of every strand, mm; wins over the file's, and is needed if the file has none [default: the file's]
    #[arg(long, value_name = "MM", value_parser = values::thickness_mm, allow_hyphen_values = true, help_heading = "Strands")]
    pub thickness: Option<f64>,
}
}

impl StrandFlags {
    /// Voxelises strands with the resolution and kernel of these flags.
    ///
    /// # Errors
    /// See [`StrandVolume::of`].
    pub fn voxelise(&self, strands: &Strands, loading: &Loading) -> Result<StrandVolume> {
        let resolution = self.resolution.unwrap_or(DEFAULT_RESOLUTION);
        StrandVolume::of(strands, resolution, self.kernel.unwrap_or_default(), loading)
    }
}

/// Whether the source of a volume is strands: a strand file, or `phantom:hair-...`.
pub fn is_strand_source(source: &str) -> bool {
    match source.strip_prefix("phantom:") {
        Some(name) => name.starts_with("hair-"),
        None => StrandFormat::of_file(Path::new(source)).is_some(),
    }
}

/// Whether the source of a volume is a strand file whose format stores no thickness, so that `--thickness` is needed.
pub fn lacks_thickness(source: &str) -> bool {
    let format = || StrandFormat::of_file(Path::new(source));
    !source.starts_with("phantom:") && format().is_some_and(|format| !format.has_thickness)
}

/// Reads a strand file, or builds the set `phantom:hair-NAME[:SEGMENTS]`. A given diameter (mm) replaces those of the
/// file.
///
/// # Errors
/// The file cannot be read, the name is unknown, or neither file nor caller gives a diameter.
pub fn load_strands(source: &str, thickness_mm: Option<f64>, loading: &Loading) -> Result<Strands> {
    let strands = load_any_strands(source, thickness_mm, loading)?;
    if !strands.has_thickness() {
        return Err(Error::input("cannot use strands", source, "the file has no thickness")
            .hint("give a diameter with --thickness MM"));
    }
    Ok(strands)
}

/// Reads or builds strands as [`load_strands`] does, also from a file without thickness.
///
/// # Errors
/// The file cannot be read, the name is unknown, or the given diameter is out of range.
pub fn load_any_strands(source: &str, thickness_mm: Option<f64>, loading: &Loading) -> Result<Strands> {
    let strands = match source.strip_prefix("phantom:") {
        Some(name) => {
            let (set, segments) = StrandSet::parse(name)?;
            set.build_with(segments, loading)?
        }
        None => read_strands(Path::new(source), loading)?,
    };
    match thickness_mm {
        Some(mm) => strands.with_thickness(mm),
        None => Ok(strands),
    }
}
