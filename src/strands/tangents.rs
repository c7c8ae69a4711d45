//! From strands to the directions in which they run: second moments of their tangents on the volume's grid.
//!
//! A segment of unit tangent `u`, length `L`, diameter `d` and transparency `t` adds `(1 - t) d L_inside u u^T / voxel volume`
//! to each voxel, with the `L_inside` of the extinction's own kernel: the trace of a voxel's moments is its extinction, 1/mm,
//! and interpolating both alike keeps that so in between. Directions are the world's.

use super::voxelise::spread;
use super::{Kernel, Segment, StrandGrid, Strands, VoxelisedStrands};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::DirectionMoments;
use std::sync::{Arc, Mutex, PoisonError};

/// Second moments of the directions of strands on a grid.
///
/// # Errors
/// The host has no memory for them.
pub fn tangents(strands: &Strands, grid: &StrandGrid, kernel: Kernel) -> Result<DirectionMoments> {
    tangents_with(strands, grid, kernel, &Loading::default())
}

/// As [`tangents`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn tangents_with(
    strands: &Strands,
    grid: &StrandGrid,
    kernel: Kernel,
    loading: &Loading,
) -> Result<DirectionMoments> {
    let values = spread(strands, grid, kernel, moments_mm2, loading)?;
    DirectionMoments::new(grid.dims, grid.world_from_index(), values)
}

/// `xx, yy, zz, xy, xz, yz` of `u u^T` times the segment's area, mm^2.
fn moments_mm2(segment: &Segment) -> [f64; 6] {
    let [a, b] = segment.ends;
    let u = (b - a).normalize_or_zero();
    let area = segment.area_mm2();
    [u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z].map(|m| area * m)
}

impl VoxelisedStrands {
    /// Strands that have become a volume on a grid.
    pub fn new(strands: Strands, grid: StrandGrid, kernel: Kernel) -> Self {
        Self { strands, grid, kernel, directions: Mutex::default() }
    }

    /// Which way the strands run, on the volume's grid: made when it is asked for, 24 bytes a voxel, and shared for as long as
    /// anyone holds it.
    ///
    /// # Errors
    /// The host has no memory for it.
    pub fn directions(&self) -> Result<Arc<DirectionMoments>> {
        // Who asks meanwhile waits for the same.
        let mut held = self.directions.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) = held.upgrade() {
            return Ok(made);
        }
        let made = Arc::new(tangents(&self.strands, &self.grid, self.kernel)?);
        *held = Arc::downgrade(&made);
        Ok(made)
    }
}
