//! Strands as a volume of extinction.

use super::{Conservation, Kernel, StrandGrid, Strands, voxelise_with};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::{DirectionMoments, Provenance, Scaling, Volume, Voxels};
use ndarray::Array3;
use std::sync::{Mutex, Weak};
use std::time::Instant;

/// Strands as a volume, and what became of them.
#[derive(Debug, Clone)]
pub struct StrandVolume {
    /// Values are extinction in 1/mm; its format is `strands`.
    pub volume: Volume,
    /// Where its voxels lie.
    pub grid: StrandGrid,
    /// How lengths were shared among voxels.
    pub kernel: Kernel,
    /// What was conserved.
    pub conservation: Conservation,
    /// Wall clock of spreading the segments, without reading and without the report.
    pub voxelise_ms: f64,
}

/// Strands, and how they became a volume.
#[derive(Debug)]
pub struct VoxelisedStrands {
    /// The strands themselves.
    pub strands: Strands,
    /// Where the volume's voxels lie.
    pub grid: StrandGrid,
    /// How lengths were shared among voxels.
    pub kernel: Kernel,
    /// Which way they run, while something holds it.
    pub(super) directions: Mutex<Weak<DirectionMoments>>,
}

/// `Provenance::format` of a volume made from strands: what says that its values are extinction.
pub const STRANDS_FORMAT: &str = "strands";

impl StrandVolume {
    /// Voxelises strands into the grid around them, with so many voxels along its longest side.
    ///
    /// # Errors
    /// There are no points, a resolution out of range, or no memory for the grid.
    pub fn of(strands: &Strands, resolution: usize, kernel: Kernel) -> Result<Self> {
        Self::of_with(strands, resolution, kernel, &Loading::default())
    }

    /// As [`Self::of`], watched and ended early through `loading`.
    ///
    /// # Errors
    /// As there, or it was cancelled.
    pub fn of_with(strands: &Strands, resolution: usize, kernel: Kernel, loading: &Loading) -> Result<Self> {
        let bounds = strands
            .bounds_mm()
            .ok_or_else(|| Error::input("cannot voxelise", strands.source(), "there are no points in it"))?;
        let grid = StrandGrid::around(bounds, resolution)?;
        let start = Instant::now();
        let values = voxelise_with(strands, &grid, kernel, loading)?;
        let voxelise_ms = start.elapsed().as_secs_f64() * 1e3;
        let conservation = Conservation::of_with(strands, &grid, &values, loading)?;
        let mut warnings = strands.warnings().to_vec();
        if conservation.area_mm2 == 0.0 {
            warnings.push("no segment has length, thickness and opacity: the volume is empty".into());
        } else if conservation.relative_error > 1e-6 {
            let error = conservation.relative_error;
            warnings.push(format!(
                "32-bit voxels lose {error:.1e} of the strands: their extinction is too small"
            ));
        }
        let [nx, ny, nz] = grid.dims;
        let broken = |e: ndarray::ShapeError| Error::runtime("cannot voxelise", strands.source(), e);
        let voxels = Voxels::F32(Array3::from_shape_vec((nz, ny, nx), values).map_err(broken)?);
        let mut provenance = Provenance::new(strands.source(), STRANDS_FORMAT, "float32");
        provenance.warnings = warnings;
        let volume =
            Volume::new_with(voxels, Scaling::IDENTITY, grid.world_from_index(), provenance, loading)?;
        Ok(Self { volume, grid, kernel, conservation, voxelise_ms })
    }
}
