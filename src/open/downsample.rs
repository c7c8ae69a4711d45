//! Downsampling of a volume, by given factors, to a given number of bytes, or until it fits memory and the device's
//! textures.

use crate::error::{Error, Result};
use crate::field::holds_volume;
use crate::files::loading::{Loading, Reduced};
use crate::files::memory_budget::{MemoryBudget, free_bytes};
use crate::gpu::texture_side;
use crate::volume::{Downsample, Volume};

/// Largest side of a 3-D texture that every WebGPU device supports, used if no adapter is found.
const CORE_TEXTURE_SIDE: usize = 2048;
/// Largest number of bytes of a voxel on a graphics device that shares the machine's memory.
const DEVICE_BYTES: u64 = 4;

/// Converts the value of `--downsample` to limits on the size of the volume that is read. Free memory is known only
/// on Linux; the memory of a graphics card is unknown.
pub(super) fn room_for(fit: Downsample) -> MemoryBudget {
    let room = MemoryBudget {
        fixed: None,
        most_bytes: u64::MAX,
        bytes_beside: 0,
        texture_side: usize::MAX,
        fits_texture: holds_volume,
    };
    match fit {
        Downsample::Factors(factors) => MemoryBudget { fixed: Some(factors), ..room },
        Downsample::Bytes(bytes) => MemoryBudget { most_bytes: bytes, ..room },
        Downsample::Auto => MemoryBudget {
            // A quarter is left for everything else.
            most_bytes: free_bytes().map_or(u64::MAX, |free| free / 4 * 3),
            bytes_beside: DEVICE_BYTES,
            texture_side: texture_side().unwrap_or(CORE_TEXTURE_SIDE),
            ..room
        },
    }
}

/// Downsamples a volume to the given size limits, unless the volume's reader has already downsampled it.
pub(super) fn downsampled(volume: Volume, room: Option<MemoryBudget>, loading: &Loading) -> Result<Volume> {
    let Some(room) = room else { return Ok(volume) };
    if let Some(Reduced { from, factors }) = loading.take_reduced() {
        return Ok(if factors == [1; 3] { volume } else { volume.downsampled_from(factors, from) });
    }
    let factors = room.factors(volume.dims(), volume.element().memory_bytes());
    let factors = factors.map_err(|why| Error::input("cannot downsample volume", "--downsample", why))?;
    if factors == [1; 3] { Ok(volume) } else { volume.downsampled(factors, loading) }
}
