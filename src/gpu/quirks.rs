//! Tuning for software adapters (llvmpipe), and limits that follow from their limits; `shaders/field/quirks.wgsl` is the part
//! of the shaders.
//!
//! llvmpipe ends the loops of an invocation after 65,536 iterations in all. The limits below apply on every adapter, so that
//! results do not depend on it. Everything else is switched by [`Gpu::is_software`].

use super::Gpu;

/// Definition of shaders for software adapters.
pub(super) const SOFTWARE_ADAPTER: &str = "SOFTWARE_ADAPTER";

/// Regular samples of a light ray, each of which takes up to 8 iterations.
pub const MAX_LIGHT_SAMPLES: u32 = 8192;
/// Steps of the regular lattices of all rays of a texel, each of which takes about 6 iterations.
pub const MAX_LATTICE_STEPS: u32 = 4096;
/// Steps of these lattices if each is marched cell by cell, which takes about 12 iterations more.
pub const MAX_LATTICE_MARCHES: u32 = 3000;

impl Gpu {
    /// Whether the adapter runs on the processor.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Returns a side of a texture with room for `side` texels. On software adapters it is no power of two, if textures may be
    /// that large: llvmpipe compiles a shader again, for half a second, when a side of a texture becomes a power of two or
    /// ceases to be one, as sides of shadow maps do while the camera moves.
    pub fn texture_side(&self, side: u32) -> u32 {
        let padded = if side.is_power_of_two() { (side + 1).max(3) } else { side };
        let fits = padded <= self.device.limits().max_texture_dimension_2d;
        if fits && self.is_software() { padded } else { side }
    }
}

/// Orders rows of workgroups for software adapters, which deal workgroups to their threads in contiguous shares although
/// neighbours cost alike: each share, of up to 16, is spread over all rows, as `workgroup_item` of the shaders does.
pub fn interleave_rows(rows: &mut [u32]) {
    rows.sort_by_key(|y| (*y as u8 & 15).reverse_bits());
}
