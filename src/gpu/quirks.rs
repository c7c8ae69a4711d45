//! Tuning for software adapters (llvmpipe), and limits on shader loops that these adapters require.
//! `shaders/field/quirks.wgsl` is the counterpart in the shaders.
//!
//! llvmpipe ends the loops of a shader invocation after 65,536 iterations in all, without an error. The limits below
//! apply on every adapter, so that pictures do not depend on the adapter. All other tuning applies only where
//! [`Gpu::is_software`] is true.

use super::Gpu;

/// Name of the shader definition (`#ifdef`) that is set on software adapters.
pub(super) const SOFTWARE_ADAPTER: &str = "SOFTWARE_ADAPTER";

/// Largest number of regular samples along a light ray. A sample takes up to 8 loop iterations.
pub const MAX_LIGHT_SAMPLES: u32 = 8192;
/// Largest number of equal depth steps, summed over all light rays through one texel of a deep shadow map. A step
/// takes about 6 loop iterations.
pub const MAX_LATTICE_STEPS: u32 = 4096;
/// Largest number of equal depth steps, summed over all light rays through one texel of a deep shadow map, if each
/// step is marched cell by cell. This takes about 12 further loop iterations per step.
pub const MAX_LATTICE_MARCHES: u32 = 3000;

impl Gpu {
    /// Whether the graphics adapter is a software adapter, which runs on the processor.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Returns the texture side to allocate for `side` texels. On software adapters it avoids powers of two, if
    /// textures may be that large. llvmpipe recompiles a shader, for half a second, when a side becomes a power of
    /// two or ceases to be one. Sides of shadow maps change while the camera moves.
    pub fn texture_side(&self, side: u32) -> u32 {
        let padded = if side.is_power_of_two() { (side + 1).max(3) } else { side };
        let fits = padded <= self.device.limits().max_texture_dimension_2d;
        if fits && self.is_software() { padded } else { side }
    }
}

/// Reorders rows of workgroups to balance the load of software adapters. These give each thread a contiguous range of
/// workgroups, but neighbouring rows often cost alike. The new order gives each of up to 16 threads rows from all
/// parts of the picture, like `workgroup_item` in the shaders.
pub fn interleave_rows(rows: &mut [u32]) {
    rows.sort_by_key(|y| (*y as u8 & 15).reverse_bits());
}
