//! From what the command line says to strands, and on to a volume.

use super::hair::read_hair_with;
use super::{
    Conservation, DEFAULT_RESOLUTION, HAIR_EXTENSIONS, Kernel, StrandGrid, StrandSet, Strands, voxelise_with,
};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::{AffineSource, Provenance, Scaling, Volume, Voxels};
use clap::Args;
use ndarray::Array3;
use std::path::Path;
use std::time::Instant;

/// How strands become a volume; absent ones are `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Args)]
pub struct StrandFlags {
    /// Voxels along the longest side of the grid for strands, 4 to 1024 [default: 256]
    #[arg(long, value_name = "N", value_parser = parse_resolution, allow_hyphen_values = true, help_heading = "Strands")]
    pub resolution: Option<usize>,
    /// How a strand's length is shared among voxels [default: box]
    #[arg(long, value_enum, value_name = "KERNEL", help_heading = "Strands")]
    pub kernel: Option<Kernel>,
    /// Diameter of every strand, mm; wins over the file's [default: the file's]
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
}

/// Voxels along the longest side.
///
/// # Errors
/// Why it is none, in one line.
pub fn parse_resolution(text: &str) -> Result<usize, String> {
    let known = super::RESOLUTIONS;
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
        .filter(|d| *d > 0.0 && *d <= f64::from(super::MAX_MM))
        .ok_or_else(|| "expected a diameter above 0 and at most 1e9 mm".into())
}

/// Strands as a volume, and what became of them.
#[derive(Debug, Clone)]
pub struct StrandVolume {
    /// Values are extinction in 1/mm; its format is `strands`.
    pub volume: Volume,
    pub grid: StrandGrid,
    pub kernel: Kernel,
    pub conservation: Conservation,
    /// Wall clock of spreading the segments, without reading and without the report.
    pub voxelise_ms: f64,
}

/// `Provenance::format` of a volume made from strands: what says that its values are extinction.
pub const STRANDS_FORMAT: &str = "strands";

/// Whether a VOLUME is one of strands: a `.hair` path or `phantom:hair-...`.
pub fn is_strand_source(source: &str) -> bool {
    let path = Path::new(source);
    let hair = path.extension().is_some_and(|e| HAIR_EXTENSIONS.iter().any(|h| e.eq_ignore_ascii_case(h)));
    match source.strip_prefix("phantom:") {
        Some(name) => name.starts_with("hair-"),
        None => hair,
    }
}

/// Reads a file of strands, or builds `phantom:hair-NAME[:SEGMENTS]`, with the diameter that was asked for.
///
/// # Errors
/// The file cannot be read, the name is unknown, or nothing says how thick the strands are.
pub fn load_strands(source: &str, thickness_mm: Option<f64>) -> Result<Strands> {
    load_strands_with(source, thickness_mm, &Loading::default())
}

/// As [`load_strands`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn load_strands_with(source: &str, thickness_mm: Option<f64>, loading: &Loading) -> Result<Strands> {
    let strands = match source.strip_prefix("phantom:") {
        Some(name) => {
            let (set, segments) = StrandSet::parse(name)?;
            set.build_with(segments, loading)?
        }
        None => read_hair_with(Path::new(source), loading)?,
    };
    match thickness_mm {
        Some(mm) => strands.with_thickness(mm),
        None if strands.has_thickness() => Ok(strands),
        None => Err(Error::input("cannot use strands", source, "the file says nothing of their thickness")
            .hint("give a diameter with --thickness MM")),
    }
}

/// Voxelises strands into the grid around them.
///
/// # Errors
/// There are no points, a resolution out of range, or no memory for the grid.
pub fn load_volume(strands: &Strands, flags: &StrandFlags) -> Result<StrandVolume> {
    load_volume_with(strands, flags, &Loading::default())
}

/// As [`load_volume`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn load_volume_with(strands: &Strands, flags: &StrandFlags, loading: &Loading) -> Result<StrandVolume> {
    let bounds = strands
        .bounds_mm()
        .ok_or_else(|| Error::input("cannot voxelise", strands.source(), "there are no points in it"))?;
    let grid = StrandGrid::around(bounds, flags.resolution.unwrap_or(DEFAULT_RESOLUTION))?;
    let kernel = flags.kernel.unwrap_or_default();
    let start = Instant::now();
    let values = voxelise_with(strands, &grid, kernel, loading)?;
    let voxelise_ms = start.elapsed().as_secs_f64() * 1e3;
    let conservation = Conservation::of_with(strands, &grid, &values, loading)?;
    let mut warnings = Vec::new();
    if conservation.area_mm2 == 0.0 {
        warnings.push("no segment has length, thickness and opacity: the volume is empty".into());
    } else if conservation.relative_error > 1e-6 {
        let error = conservation.relative_error;
        warnings
            .push(format!("32-bit voxels lose {error:.1e} of the strands: their extinction is too small"));
    }
    let [nx, ny, nz] = grid.dims;
    let broken = |e: ndarray::ShapeError| Error::runtime("cannot voxelise", strands.source(), e);
    let voxels = Voxels::F32(Array3::from_shape_vec((nz, ny, nx), values).map_err(broken)?);
    let provenance = Provenance {
        source: strands.source().into(),
        format: STRANDS_FORMAT.into(),
        stored_type: "float32".into(),
        affine_source: AffineSource::Spacing,
        frames: 1,
        frame: 0,
        non_finite: 0,
        warnings,
    };
    let volume = Volume::new_with(voxels, Scaling::IDENTITY, grid.world_from_index(), provenance, loading)?;
    Ok(StrandVolume { volume, grid, kernel, conservation, voxelise_ms })
}
