//! A volume with what the device holds of it, and the space that both count in.

use super::{DeviceVolume, PoolSizes};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::strands::VoxelisedStrands;
use crate::volume::{Bricks, Volume};
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// A volume with what the device holds of it.
pub struct LoadedVolume {
    /// The volume on the host.
    pub volume: Arc<Volume>,
    /// What it was made from, where that is strands.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// The range of values in each of its bricks.
    pub bricks: Bricks,
    /// Its voxels on the device.
    pub on_device: DeviceVolume,
    /// What builds of maps on it have needed.
    pub pool_sizes: PoolSizes,
}

impl LoadedVolume {
    /// Uploads a volume and makes its bricks.
    ///
    /// # Errors
    /// A volume that the adapter cannot hold.
    pub fn new(gpu: &Gpu, volume: Arc<Volume>) -> Result<Self> {
        let on_device = DeviceVolume::upload(gpu, &volume)?;
        let (bricks, pool_sizes) = (Bricks::build(&volume), PoolSizes::default());
        Ok(Self { volume, strands: None, bricks, on_device, pool_sizes })
    }

    /// The same, knowing the strands that the volume was made from.
    #[must_use]
    pub fn with_strands(self, strands: Option<Arc<VoxelisedStrands>>) -> Self {
        Self { strands, ..self }
    }
}

/// Grid space is index space plus one, so that cell `c` interpolates the voxels `c - 1` and `c`.
pub fn grid_from_world(volume: &Volume) -> DAffine3 {
    DAffine3::from_translation(DVec3::ONE) * volume.index_from_world()
}
