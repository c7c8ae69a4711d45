//! What a volume is to fit into, by what can be known of this machine and its adapter, and making it fit.

use crate::error::{Error, Result};
use crate::field::Fold;
use crate::files::loading::{Loading, Reduced};
use crate::files::memory_budget::{MemoryBudget, free_bytes};
use crate::gpu::texture_side;
use crate::volume::{Downsample, Volume};
use crate::with_voxels;

/// Voxels along an axis of a 3-D texture that every adapter of WebGPU holds, where none can be asked.
const CORE_TEXTURE_SIDE: usize = 2048;
/// Bytes a voxel that a picture needs on a device that shares the machine's memory, at the most.
const DEVICE_BYTES: u64 = 4;

/// What `--fit` asks for. What memory a graphics card has cannot be asked; the machine's free memory is known on Linux.
pub(super) fn room_for(fit: Downsample) -> MemoryBudget {
    let room = MemoryBudget {
        fixed: None,
        most_bytes: u64::MAX,
        bytes_beside: 0,
        texture_side: usize::MAX,
        fits_texture: |dims, side| Fold::with_bricks(dims, side).is_some(),
    };
    match fit {
        Downsample::Factors(factors) => MemoryBudget { fixed: Some(factors), ..room },
        Downsample::Bytes(bytes) => MemoryBudget { most_bytes: bytes, ..room },
        Downsample::Auto => MemoryBudget {
            // A quarter is left for all else.
            most_bytes: free_bytes().map_or(u64::MAX, |free| free / 4 * 3),
            bytes_beside: DEVICE_BYTES,
            texture_side: texture_side().unwrap_or(CORE_TEXTURE_SIDE),
            ..room
        },
    }
}

/// Reduces a volume to fit, unless its reader has done so.
///
/// # Errors
/// Nothing makes it fit, or it was cancelled.
pub(super) fn fitted(volume: Volume, room: Option<MemoryBudget>, loading: &Loading) -> Result<Volume> {
    let Some(room) = room else { return Ok(volume) };
    if let Some(Reduced { from, factors }) = loading.take_reduced() {
        return Ok(if factors == [1; 3] { volume } else { volume.downsampled_from(factors, from) });
    }
    fn bytes_each<T>(_: &ndarray::Array3<T>) -> u64 {
        size_of::<T>() as u64
    }
    let voxel_bytes = with_voxels!(volume.voxels(), a => bytes_each(a));
    let factors = room.factors(volume.dims(), voxel_bytes);
    let factors = factors.map_err(|why| Error::input("cannot fit volume", "--fit", why))?;
    volume.downsampled(factors, loading)
}
