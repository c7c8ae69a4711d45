//! A CT-like chest in HU, in the patient's axes (RAS+, mm, centred): lungs with vessels and airways, a heart with
//! contrast, ribs, spine and sternum, on a scanner table. It is made for pictures, not for diagnosis.
//!
//! Large regions are implicit functions of position; bones and vessels are tubes and ellipsoids painted over them in
//! order. Every edge is a linear ramp about a voxel wide, as partial volumes make it.

mod anatomy;
mod noise;
mod regions;
mod shape;

use crate::files::loading::{Loading, ReadingStage};
use anatomy::shapes;
use glam::{Vec3, vec3};
use ndarray::Array3;
use noise::triangular;
use rayon::prelude::*;
use regions::{AIR, over, tissue};
use shape::Shape;

/// Voxels along x where no size is given: 1.41 mm in plane, slices of 2 mm.
pub const DEFAULT_SIZE: usize = 256;
/// Extent of the grid, mm.
const EXTENT_MM: Vec3 = vec3(360.0, 270.0, 256.0);
/// Half the spread of the noise, HU (triangular, so a standard deviation of about 10).
const NOISE_HU: f32 = 24.0;

/// Builds the chest with `size` voxels along x; returns the voxels in HU and the spacing in mm.
/// Unfinished once `loading` was cancelled.
pub fn build(size: usize, loading: &Loading) -> (Array3<i16>, [f64; 3]) {
    let dims = [size, (3 * size / 4).max(1), (size / 2).max(1)];
    let [nx, ny, nz] = dims;
    let spacing_mm: [f64; 3] = std::array::from_fn(|axis| f64::from(EXTENT_MM[axis]) / dims[axis] as f64);
    let spacing = Vec3::from_array(spacing_mm.map(|s| s as f32));
    let first = -0.5 * spacing * vec3(nx as f32 - 1.0, ny as f32 - 1.0, nz as f32 - 1.0);
    let edge_mm = spacing.x;
    let shapes = shapes();

    let mut voxels = Array3::default((nz, ny, nx));
    let planes = voxels.as_slice_mut().unwrap_or_default().par_chunks_mut(nx * ny);
    let pieces = loading.pieces(ReadingStage::Building, nz);
    planes.enumerate().for_each(|(k, plane)| {
        if pieces.is_cancelled() {
            return;
        }
        let z = first.z + k as f32 * spacing.z;
        let mut hu = vec![AIR; nx * ny];
        for (j, row) in hu.chunks_exact_mut(nx).enumerate() {
            // The largest slices take a tenth of a second.
            if pieces.is_cancelled() {
                return;
            }
            let y = first.y + j as f32 * spacing.y;
            for (i, hu) in row.iter_mut().enumerate() {
                *hu = tissue(vec3(first.x + i as f32 * spacing.x, y, z), edge_mm);
            }
        }
        for shape in &shapes {
            paint(shape, &mut hu, [nx, ny], first, spacing, z, edge_mm);
        }
        for (at, (voxel, hu)) in plane.iter_mut().zip(&hu).enumerate() {
            let noise = NOISE_HU * triangular((k * nx * ny + at) as u64);
            // Rounds to nearest: the sum is within +-4096, where a truncating cast is quicker than `round`.
            *voxel = ((hu + noise + 4096.5) as i32 - 4096).max(-1024) as i16;
        }
        pieces.done();
    });
    (voxels, spacing_mm)
}

/// Paints one shape into the slice at `z`.
fn paint(
    shape: &Shape,
    hu: &mut [f32],
    [nx, ny]: [usize; 2],
    first: Vec3,
    spacing: Vec3,
    z: f32,
    edge_mm: f32,
) {
    let (low, high) = (shape.low - edge_mm, shape.high + edge_mm);
    if z < low.z || z > high.z {
        return;
    }
    let from = ((low - first) / spacing).ceil().max(Vec3::ZERO);
    let to = ((high - first) / spacing).floor();
    // A float beyond the range of usize saturates, so a shape outside the grid gives an empty range.
    for j in from.y as usize..((to.y + 1.0) as usize).min(ny) {
        for i in from.x as usize..((to.x + 1.0) as usize).min(nx) {
            let p = vec3(first.x + i as f32 * spacing.x, first.y + j as f32 * spacing.y, z);
            let hu = &mut hu[j * nx + i];
            *hu = over(*hu, shape.hu, shape.distance(p), edge_mm);
        }
    }
}
