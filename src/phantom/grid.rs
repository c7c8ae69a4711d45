//! Grid of the phantoms: size, positions of voxels, and computation slice by slice.

use crate::files::loading::{Loading, ReadingStage};
use crate::volume::IndexBox;
use ndarray::Array3;
use rayon::prelude::*;

/// Edge length of the cube that the analytic phantoms fill, mm.
pub(super) const CUBE_MM: f64 = 64.0;
/// Voxel value inside the objects of the analytic phantoms.
pub(super) const INSIDE: f64 = 1000.0;

/// Returns the position of a voxel centre along an axis, in units of half the cube's edge.
pub(super) fn centred(i: usize, size: usize) -> f64 {
    (2.0 * i as f64 + 1.0) / size as f64 - 1.0
}

/// Computes the voxels of a box slice by slice, in parallel; they are incomplete if `loading` was cancelled.
pub(super) fn by_slices<T: Copy + Default + Send + Sync>(
    [xs, ys, zs]: &IndexBox,
    loading: &Loading,
    compute: impl Fn(usize, &mut [T]) + Sync,
) -> Array3<T> {
    let mut voxels = Array3::default((zs.len(), ys.len(), xs.len()));
    let slices = voxels.as_slice_mut().unwrap_or_default().par_chunks_mut((xs.len() * ys.len()).max(1));
    let pieces = loading.pieces(ReadingStage::Building, zs.len());
    zs.clone().into_par_iter().zip(slices).for_each(|(k, slice)| {
        if !pieces.is_cancelled() {
            compute(k, slice);
            pieces.done();
        }
    });
    voxels
}
