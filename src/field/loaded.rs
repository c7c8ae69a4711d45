//! A volume with its data on the device, and the grid space of both.

use super::{DeviceDirections, DeviceVolume};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::strands::VoxelisedStrands;
use crate::volume::Volume;
use glam::{DAffine3, DVec3};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Volume with its data on the device.
pub struct LoadedVolume {
    /// The volume on the host.
    pub volume: Arc<Volume>,
    /// Strands that the volume was made from.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Voxels on the device.
    pub on_device: DeviceVolume,
    /// Pool sizes that builds of maps needed.
    pub pool_sizes: PoolSizes,
    /// Directions of the strands, once a picture has needed them.
    directions: OnceLock<DeviceDirections>,
}

impl LoadedVolume {
    /// Uploads a volume.
    ///
    /// # Errors
    /// The adapter cannot hold the volume.
    pub fn new(gpu: &Gpu, volume: Arc<Volume>) -> Result<Self> {
        let on_device = DeviceVolume::upload(gpu, &volume)?;
        let (pool_sizes, directions) = (PoolSizes::default(), OnceLock::new());
        Ok(Self { volume, strands: None, on_device, pool_sizes, directions })
    }

    /// Adds the strands that the volume was made from.
    #[must_use]
    pub fn with_strands(self, strands: Option<Arc<VoxelisedStrands>>) -> Self {
        Self { strands, directions: OnceLock::new(), ..self }
    }

    /// Directions of the strands on the device, uploaded at the first call.
    ///
    /// # Errors
    /// The volume was not made from strands, or the host or the device is out of memory.
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

/// Affine from world mm to grid space, which is index space plus one: cell `c` interpolates the voxels `c - 1` and `c`.
pub fn grid_from_world(volume: &Volume) -> DAffine3 {
    DAffine3::from_translation(DVec3::ONE) * volume.index_from_world()
}

/// Share of a pool that each method's last builds used, by the method's settings. A share fits maps that choose their own
/// size and so have pools of all sizes.
///
/// A pool as large as the previous build needed does not overflow while a light moves a little, and the build runs once.
/// Sizes that an edit of the transfer function made too large shrink over the next builds.
#[derive(Debug, Default)]
pub struct PoolSizes(Mutex<HashMap<String, f64>>);

impl PoolSizes {
    /// Share that the last builds with these settings used; `None` before the first build.
    pub fn last(&self, settings: &str) -> Option<f64> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(settings).copied()
    }

    /// Records the share that a build used. A larger earlier share shrinks slowly, so that a light that moves back and forth
    /// overflows its pool only once.
    pub fn learn(&self, settings: String, used: f64) {
        let mut sizes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let share = sizes.entry(settings).or_default();
        *share = used.max(0.875 * *share);
    }
}
