//! A volume with what the device holds of it, and the space that both count in.

use super::{DeviceDirections, DeviceVolume, PoolSizes};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::strands::VoxelisedStrands;
use crate::volume::{Bricks, Volume};
use glam::{DAffine3, DVec3};
use std::sync::{Arc, OnceLock};

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
    /// Which way its strands run, once a picture has asked.
    directions: OnceLock<DeviceDirections>,
}

impl LoadedVolume {
    /// Uploads a volume and makes its bricks.
    ///
    /// # Errors
    /// A volume that the adapter cannot hold.
    pub fn new(gpu: &Gpu, volume: Arc<Volume>) -> Result<Self> {
        let on_device = DeviceVolume::upload(gpu, &volume)?;
        let (bricks, pool_sizes) = (Bricks::build(&volume), PoolSizes::default());
        Ok(Self { volume, strands: None, bricks, on_device, pool_sizes, directions: OnceLock::new() })
    }

    /// The same, knowing the strands that the volume was made from.
    #[must_use]
    pub fn with_strands(self, strands: Option<Arc<VoxelisedStrands>>) -> Self {
        Self { strands, directions: OnceLock::new(), ..self }
    }

    /// Which way the strands run that the volume was made from: made and uploaded when it is first asked for.
    ///
    /// # Errors
    /// The volume was not made from strands, or there is no memory for it on the host or on the device.
    pub fn directions(&self, gpu: &Gpu) -> Result<&DeviceDirections> {
        if let Some(made) = self.directions.get() {
            return Ok(made);
        }
        let source = &self.volume.provenance.source;
        let none = || Error::input("cannot shade strands", source, "it is not of strands");
        let moments = self.strands.as_ref().ok_or_else(none)?.directions()?;
        let made = DeviceDirections::upload(gpu, &moments, source)?;
        Ok(self.directions.get_or_init(|| made))
    }
}

/// Grid space is index space plus one, so that cell `c` interpolates the voxels `c - 1` and `c`.
pub fn grid_from_world(volume: &Volume) -> DAffine3 {
    DAffine3::from_translation(DVec3::ONE) * volume.index_from_world()
}
