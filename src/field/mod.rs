//! The scalar field on a device: volume, transfer function, bricks, light space, the march along light rays and the
//! tiles that it fills. Group 0 of every pipeline is made here, and binding 0 of group 1, the light space.

mod active_bricks;
mod context;
mod device_transfer;
mod device_volume;
mod light_space;
mod omittable;
mod shader;
mod tile_march;
mod tile_pace;

pub use active_bricks::{ActiveBricks, extinction_intervals};
pub use context::BuildContext;
pub use device_transfer::{DeviceTransfer, MarchTable};
pub use device_volume::{DeviceVolume, TexelFormat};
pub use light_space::{LightSpace, Projection, TILE};
pub use omittable::{Forced, Omittable};
pub use shader::{FAR, LINE_THREADS, field_shader, line_of_workgroups, marching};
pub use tile_march::{NO_TILE, TILE_TEXELS, TileMarch};
pub use tile_pace::TilePace;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::volume::{Bricks, Volume};
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// A volume with what the device holds of it.
pub struct LoadedVolume {
    /// The volume on the host.
    pub volume: Arc<Volume>,
    /// The range of values in each of its bricks.
    pub bricks: Bricks,
    /// Its voxels on the device.
    pub on_device: DeviceVolume,
}

impl LoadedVolume {
    /// Uploads a volume and makes its bricks.
    ///
    /// # Errors
    /// A volume that the adapter cannot hold.
    pub fn new(gpu: &Gpu, volume: Arc<Volume>) -> Result<Self> {
        let on_device = DeviceVolume::upload(gpu, &volume)?;
        Ok(Self { bricks: Bricks::build(&volume), volume, on_device })
    }
}

/// Grid space is index space plus one, so that cell `c` interpolates the voxels `c - 1` and `c`.
pub fn grid_from_world(volume: &Volume) -> DAffine3 {
    DAffine3::from_translation(DVec3::ONE) * volume.index_from_world()
}
