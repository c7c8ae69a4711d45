//! What the command line says of strands.

use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::strands::{
    DEFAULT_RESOLUTION, Kernel, MAX_MM, RESOLUTIONS, StrandFormat, StrandSet, StrandVolume, Strands,
    read_strands,
};
use clap::Args;
use serde::Serialize;
use std::path::Path;

/// How strands become a volume; absent ones are `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Args, Serialize)]
pub struct StrandFlags {
    /// Voxels along the longest side of the grid for strands, 4 to 1024 [default: 256]
    #[arg(long, value_name = "N", value_parser = parse_resolution, allow_hyphen_values = true, help_heading = "Strands")]
    pub resolution: Option<usize>,
    /// How a strand's length is shared among voxels [default: box]
    #[arg(long, value_enum, value_name = "KERNEL", help_heading = "Strands")]
    pub kernel: Option<Kernel>,
    /// Diameter of every strand, mm; wins over the file's, and needed where that has none [default: the file's]
    #[arg(long, value_name = "MM", value_parser = parse_thickness_mm, allow_hyphen_values = true, help_heading = "Strands")]
    pub thickness: Option<f64>,
}

impl StrandFlags {
    /// These where given, `other`'s otherwise.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            resolution: self.resolution.or(other.resolution),
            kernel: self.kernel.or(other.kernel),
            thickness: self.thickness.or(other.thickness),
        }
    }

    /// The strands as a volume.
    ///
    /// # Errors
    /// See [`StrandVolume::of`].
    pub fn voxelise(&self, strands: &Strands, loading: &Loading) -> Result<StrandVolume> {
        let resolution = self.resolution.unwrap_or(DEFAULT_RESOLUTION);
        StrandVolume::of(strands, resolution, self.kernel.unwrap_or_default(), loading)
    }
}

/// Voxels along the longest side.
///
/// # Errors
/// Why it is none, in one line.
pub fn parse_resolution(text: &str) -> Result<usize, String> {
    let known = RESOLUTIONS;
    text.parse()
        .ok()
        .filter(|n| known.contains(n))
        .ok_or_else(|| format!("expected a whole number from {} to {}", known.start(), known.end()))
}

/// A strand's diameter, mm.
///
/// # Errors
/// Why it is none, in one line.
pub fn parse_thickness_mm(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|d| *d > 0.0 && *d <= f64::from(MAX_MM))
        .ok_or_else(|| "expected a diameter above 0 and at most 1e9 mm".into())
}

/// Whether a VOLUME is one of strands: a file of one of their formats, or `phantom:hair-...`.
pub fn is_strand_source(source: &str) -> bool {
    match source.strip_prefix("phantom:") {
        Some(name) => name.starts_with("hair-"),
        None => StrandFormat::of_file(Path::new(source)).is_some(),
    }
}

/// Whether a VOLUME is a file of strands whose format has no thickness: a diameter has to be given.
pub fn lacks_thickness(source: &str) -> bool {
    let format = || StrandFormat::of_file(Path::new(source));
    !source.starts_with("phantom:") && format().is_some_and(|format| !format.has_thickness)
}

/// Reads a file of strands, or builds `phantom:hair-NAME[:SEGMENTS]`, with the diameter that was asked for.
///
/// # Errors
/// The file cannot be read, the name is unknown, or nothing says how thick the strands are.
pub fn load_strands(source: &str, thickness_mm: Option<f64>, loading: &Loading) -> Result<Strands> {
    let strands = match source.strip_prefix("phantom:") {
        Some(name) => {
            let (set, segments) = StrandSet::parse(name)?;
            set.build_with(segments, loading)?
        }
        None => read_strands(Path::new(source), loading)?,
    };
    match thickness_mm {
        Some(mm) => strands.with_thickness(mm),
        None if strands.has_thickness() => Ok(strands),
        None => Err(Error::input("cannot use strands", source, "the file says nothing of their thickness")
            .hint("give a diameter with --thickness MM")),
    }
}
