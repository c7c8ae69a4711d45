//! Voxel grid around strands, into which they are voxelised.

use crate::error::{Error, Result};
use glam::{DAffine3, DMat3, DVec3};
use std::ops::RangeInclusive;

/// Default number of voxels along the longest side of the grid that strands are voxelised into.
pub const DEFAULT_RESOLUTION: usize = 256;

/// Allowed number of voxels along the longest side of the grid that strands are voxelised into. A cube of the largest
/// size takes 4 GiB of 32-bit floats.
pub const RESOLUTIONS: RangeInclusive<usize> = 4..=1024;

/// Number of empty voxels between the strands' bounding box and each face of their voxel grid.
const MARGIN: f64 = 1.0;

/// Smallest voxel spacing of a strand grid relative to the largest coordinate (or 1 mm), for the precision of 32-bit
/// floats.
const MIN_SPACING: f64 = 1e-6;

/// Grid of cubic voxels, parallel to the world axes, into which strands are voxelised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrandGrid {
    /// Number of voxels of the strand grid along x, y and z.
    pub dims: [usize; 3],
    /// Voxel spacing of the strand grid, mm.
    pub spacing_mm: f64,
    /// Centre of voxel (0, 0, 0) of the strand grid, world mm.
    pub origin_mm: DVec3,
}

impl StrandGrid {
    /// Creates the voxel grid around a bounding box of strands (world mm). It has `resolution` voxels along the
    /// longest side, at least three along each side, and a margin of one voxel. Spacing and origin are 32-bit floats,
    /// so that a NIfTI file stores them without loss.
    ///
    /// # Errors
    /// The resolution is outside [`RESOLUTIONS`].
    pub fn around([low, high]: [DVec3; 2], resolution: usize) -> Result<Self> {
        if !RESOLUTIONS.contains(&resolution) {
            let (least, most) = (RESOLUTIONS.start(), RESOLUTIONS.end());
            let why = format!("{resolution} is not from {least} to {most} voxels");
            return Err(Error::input("cannot use resolution", "--resolution", why));
        }
        let size = high - low;
        let farthest = low.abs().max(high.abs()).max_element().max(1.0);
        let spacing = (size.max_element() / (resolution as f64 - 2.0 * MARGIN)).max(MIN_SPACING * farthest);
        // Rounded up, so that the strands stay inside the grid.
        let rounded = spacing as f32;
        let spacing_mm = f64::from(if f64::from(rounded) < spacing { rounded.next_up() } else { rounded });
        let dims = size
            .to_array()
            .map(|mm| ((mm / spacing_mm).ceil() + 2.0 * MARGIN).clamp(3.0, resolution as f64) as usize);
        let middle = DVec3::from_array(dims.map(|n| 0.5 * (n as f64 - 1.0)));
        let origin_mm = (0.5 * (low + high) - spacing_mm * middle).as_vec3().as_dvec3();
        Ok(Self { dims, spacing_mm, origin_mm })
    }

    /// Transform from voxel indices of the strand grid to world mm.
    pub fn world_from_index(&self) -> DAffine3 {
        DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(self.spacing_mm)), self.origin_mm)
    }

    /// Converts a world point (mm) to index coordinates of the strand grid; voxel centres have integer coordinates.
    #[inline]
    pub fn index_from_world(&self, p: DVec3) -> DVec3 {
        (p - self.origin_mm) * (1.0 / self.spacing_mm)
    }

    /// Volume of one voxel of the strand grid, mm^3.
    pub fn voxel_mm3(&self) -> f64 {
        self.spacing_mm.powi(3)
    }

    /// Number of voxels of the strand grid.
    pub fn voxels(&self) -> usize {
        self.dims.iter().product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_box_has_a_margin() {
        for (low, high) in [
            ([0.0; 3], [100.0, 50.0, 3.0]),
            ([-7.3, 1e5, 2.0], [-7.3, 1e5 + 0.1, 2.0]),
            ([5.0; 3], [5.0; 3]),
            ([-1e9; 3], [1e9; 3]),
            ([1e9; 3], [1e9; 3]),
        ] {
            let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
            for resolution in [4, 5, 256, 1024] {
                let grid = StrandGrid::around([low, high], resolution).unwrap();
                assert!(grid.spacing_mm > 0.0 && grid.dims.iter().all(|n| (3..=resolution).contains(n)));
                let last = DVec3::from_array(grid.dims.map(|n| n as f64 - 1.0));
                let (a, b) = (grid.index_from_world(low), grid.index_from_world(high));
                assert!(a.min_element() >= 0.4 && (last - b).min_element() >= 0.4, "{grid:?}: {a} {b}");
                assert_eq!(grid.spacing_mm, f64::from(grid.spacing_mm as f32));
                assert_eq!(grid.origin_mm, grid.origin_mm.as_vec3().as_dvec3());
            }
        }
        let grid = StrandGrid::around([DVec3::ZERO, DVec3::new(100.0, 50.0, 0.0)], 102).unwrap();
        assert_eq!((grid.dims, grid.spacing_mm), ([102, 52, 3], 1.0));
        for bad in [0, 3, 1025, usize::MAX] {
            assert!(StrandGrid::around([DVec3::ZERO, DVec3::ONE], bad).is_err());
        }
    }
}
