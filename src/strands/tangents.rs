//! Strand directions on the volume's grid: second moments of the strands' tangents in each voxel.
//!
//! A segment of unit tangent `u`, length `L`, diameter `d` and transparency `t` adds `(1 - t) d L_inside u u^T /
//! voxel volume` to each voxel. `L_inside` is the part of its length that the voxelisation kernel assigns to the
//! voxel. The trace of a voxel's moments is therefore its extinction, 1/mm. This also holds between voxels, since
//! both are interpolated in the same way. Directions are in world coordinates.

use super::voxelise::spread;
use super::{Kernel, Segment, StrandGrid, Strands, VoxelisedStrands};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::DirectionMoments;
use std::sync::{Arc, Mutex, PoisonError};

/// Computes the second moments of the strands' directions in each voxel of a grid.
///
/// # Errors
/// The host has no memory for them.
pub fn tangents(strands: &Strands, grid: &StrandGrid, kernel: Kernel) -> Result<DirectionMoments> {
    let values = spread(strands, grid, kernel, moments_mm2, &Loading::default())?;
    DirectionMoments::new(grid.dims, grid.world_from_index(), values)
}

/// Elements `xx, yy, zz, xy, xz, yz` of `u u^T` times the area of a strand segment (mm^2), where `u` is the segment's
/// unit tangent.
fn moments_mm2(segment: &Segment) -> [f64; 6] {
    let [a, b] = segment.ends;
    let u = (b - a).normalize_or_zero();
    let area = segment.area_mm2();
    [u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z].map(|m| area * m)
}

impl VoxelisedStrands {
    /// Stores strands with the grid and kernel of their voxelisation.
    pub fn new(strands: Strands, grid: StrandGrid, kernel: Kernel) -> Self {
        Self { strands, grid, kernel, directions: Mutex::default() }
    }

    /// Returns the strand directions on the volume's grid (24 bytes for each voxel). They are computed on the first
    /// call and shared while any caller still uses them.
    ///
    /// # Errors
    /// The host has no memory for them.
    pub fn directions(&self) -> Result<Arc<DirectionMoments>> {
        // Concurrent callers wait for the same result.
        let mut shared = self.directions.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) = shared.upgrade() {
            return Ok(made);
        }
        let made = Arc::new(tangents(&self.strands, &self.grid, self.kernel)?);
        *shared = Arc::downgrade(&made);
        Ok(made)
    }
}
