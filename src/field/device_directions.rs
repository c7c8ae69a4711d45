//! Directions of strands (hair or fibres) in each voxel, on the graphics device: second moments as half floats, a
//! format that every adapter can filter.

use crate::error::{Error, Result};
use crate::gpu::{Gpu, Slot, VolumeTexture, clamp_sampler};
use crate::volume::DirectionMoments;
use half::f16;

/// Bytes per voxel for the second moments of strand directions. One texture holds the moments `xx, yy, zz, xy`, and
/// another one `xz, yz`.
const VOXEL_BYTES: usize = 12;

/// Binary exponent to which the second moments of strand directions are scaled: the largest trace of a moment tensor
/// then lies between `2^13` and `2^14`. Moments as small as `2^-14` keep all digits of a half float, and sums of
/// filtered texels do not overflow.
const LARGEST_EXPONENT: f64 = 13.0;

/// Second moments of the strand directions in each voxel, as textures on the device. All moments are scaled by one
/// power of 2, since shading needs only their ratios.
pub struct DeviceDirections {
    moments: VolumeTexture,
    more_moments: VolumeTexture,
    sampler: wgpu::Sampler,
    /// Bytes of the textures that hold the strand directions.
    pub bytes: u64,
}

impl DeviceDirections {
    /// Returns the number of bytes that the directions of strands (hair or fibres) take on the device for a volume of
    /// `dims` voxels.
    pub fn bytes_of(dims: [usize; 3]) -> u64 {
        dims.iter().product::<usize>() as u64 * VOXEL_BYTES as u64
    }

    /// Uploads the second moments of strand directions as textures; `source` names the volume in error messages.
    ///
    /// # Errors
    /// The volume is larger than the adapter's 3-D textures, or the device is out of memory.
    pub fn upload(gpu: &Gpu, directions: &DirectionMoments, source: &str) -> Result<Self> {
        let dims = directions.dims();
        let sides = dims.map(|n| n as u32);
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let texture = |label, format| VolumeTexture::new(gpu, label, format, sides);
        let moments = texture("directions of strands", wgpu::TextureFormat::Rgba16Float)?;
        let more_moments = texture("more directions of strands", wgpu::TextureFormat::Rg16Float)?;
        let scale = scale(directions.largest_trace());
        let half = |moment: f32| f16::from_f64(f64::from(moment) * scale);
        let layer_voxels = dims[0] * dims[1];
        for (layer, values) in (0..).zip(directions.values().chunks(layer_voxels)) {
            let first: Vec<_> =
                values.iter().map(|[xx, yy, zz, xy, ..]| [*xx, *yy, *zz, *xy].map(half)).collect();
            let second: Vec<_> = values.iter().map(|[.., xz, yz]| [*xz, *yz].map(half)).collect();
            moments.write_layer(gpu, layer, &first);
            more_moments.write_layer(gpu, layer, &second);
            // Limits the memory of pending copies.
            if layer % 64 == 63 {
                gpu.submit([]);
            }
        }
        gpu.wait_for(gpu.submit([]))?;
        let bytes = Self::bytes_of(dims);
        if pollster::block_on(scope.pop()).is_some() {
            let why = format!("the device has no {bytes} bytes left for them");
            return Err(Error::runtime("cannot upload directions of strands", source, why));
        }
        Ok(Self { moments, more_moments, sampler: clamp_sampler(gpu, wgpu::FilterMode::Linear), bytes })
    }

    /// Returns the bindings of the strand-direction textures and their sampler, in the order of
    /// `shaders/render/strand.wgsl`.
    pub fn slots(&self) -> [Slot<'_>; 3] {
        [self.moments.slot(true), self.more_moments.slot(true), Slot::sampler(&self.sampler, true)]
    }
}

/// Returns the power of 2 by which the second moments of strand directions are scaled, from the largest trace of a
/// moment tensor.
fn scale(largest_trace: f64) -> f64 {
    match largest_trace > 0.0 {
        true => (LARGEST_EXPONENT - largest_trace.log2().floor()).exp2(),
        false => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_hold_any_extinction() {
        for largest in [1e-45, 3e-9, 0.7, 1.0, 1023.9, 1e9, 3e38] {
            let scaled = largest * scale(largest);
            assert!((8192.0..16384.0).contains(&scaled), "{largest}: {scaled}");
            assert!(f16::from_f64(scaled).is_finite());
        }
        assert_eq!(scale(0.0), 1.0);
    }
}
