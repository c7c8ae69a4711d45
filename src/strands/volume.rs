//! Extinction volume made from strands.

use super::{Conservation, Kernel, StrandGrid, Strands, voxelise};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::{DirectionMoments, Provenance, Scaling, Volume, Voxels};
use ndarray::Array3;
use std::sync::{Mutex, Weak};
use std::time::Instant;

/// Extinction volume voxelised from strands, with the area lost by the voxelisation and its time.
#[derive(Debug, Clone)]
pub struct StrandVolume {
    /// Volume voxelised from strands; its values are extinction in 1/mm and its format is `strands`.
    pub volume: Volume,
    /// Voxel grid of the volume made from strands.
    pub grid: StrandGrid,
    /// Voxelisation kernel (box or tent) that distributed the strands over the voxels.
    pub kernel: Kernel,
    /// Total area of the strands before voxelisation and on the voxel grid after it, mm^2.
    pub conservation: Conservation,
    /// Wall-clock time of voxelising the strands, ms. It excludes reading the strand file and computing the lost
    /// area.
    pub voxelise_ms: f64,
}

/// Strands from which a volume was made, with the grid and kernel of the voxelisation.
#[derive(Debug)]
pub struct VoxelisedStrands {
    /// Strands from which the volume was voxelised.
    pub strands: Strands,
    /// Voxel grid of the volume made from these strands.
    pub grid: StrandGrid,
    /// Voxelisation kernel (box or tent) that distributed the strands over the voxels.
    pub kernel: Kernel,
    /// Cached strand directions on the volume's grid; freed when no caller uses them.
    pub(super) directions: Mutex<Weak<DirectionMoments>>,
}

/// Format name in the `Provenance` of a volume made from strands. It marks that the volume's values are extinction.
pub const STRANDS_FORMAT: &str = "strands";

impl StrandVolume {
    /// Voxelises strands into a grid around them with `resolution` voxels along its longest side; `loading` shows
    /// progress and can cancel it.
    ///
    /// # Errors
    /// There are no points, the resolution is out of range, the host has no memory, or the work was cancelled.
    pub fn of(strands: &Strands, resolution: usize, kernel: Kernel, loading: &Loading) -> Result<Self> {
        let bounds = strands
            .bounds_mm()
            .ok_or_else(|| Error::input("cannot voxelise", strands.source(), "there are no points in it"))?;
        let grid = StrandGrid::around(bounds, resolution)?;
        let start = Instant::now();
        let values = voxelise(strands, &grid, kernel, loading)?;
        let voxelise_ms = start.elapsed().as_secs_f64() * 1e3;
        let conservation = Conservation::of(strands, &grid, &values, loading)?;
        let mut warnings = strands.warnings().to_vec();
        if conservation.area_mm2 == 0.0 {
            warnings.push("no segment has length, thickness and opacity: the volume is empty".into());
        } else if conservation.relative_error > 1e-6 {
            let error = conservation.relative_error;
            let warning =
                format!("32-bit voxels lose {error:.1e} of the strands: their extinction is too small");
            warnings.push(warning);
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
