//! Volume that is loaded onto the graphics device, and the coordinates in which shaders address its voxels (voxel
//! index plus one).

use super::{DeviceDirections, DeviceVolume};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::strands::VoxelisedStrands;
use crate::volume::Volume;
use glam::{DAffine3, DVec3};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Volume on the host, together with its data on the graphics device.
pub struct LoadedVolume {
    /// Volume in host memory.
    pub volume: Arc<Volume>,
    /// Strands (hair or fibres) from which the volume was voxelised; `None` for other volumes.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Voxels of the volume on the graphics device.
    pub on_device: DeviceVolume,
    /// Sizes of the memory pool for curve nodes in earlier builds of deep shadow maps for this volume.
    pub pool_sizes: PoolSizes,
    /// Directions of the strands (hair or fibres) in each voxel, on the device; uploaded once a picture needs them.
    directions: OnceLock<DeviceDirections>,
}

impl LoadedVolume {
    /// Uploads a volume to the graphics device.
    ///
    /// # Errors
    /// The adapter cannot hold the volume.
    pub fn new(gpu: &Gpu, volume: Arc<Volume>) -> Result<Self> {
        let on_device = DeviceVolume::upload(gpu, &volume)?;
        let (pool_sizes, directions) = (PoolSizes::default(), OnceLock::new());
        Ok(Self { volume, strands: None, on_device, pool_sizes, directions })
    }

    /// Adds the strands (hair or fibres) from which the volume was voxelised.
    #[must_use]
    pub fn with_strands(self, strands: Option<Arc<VoxelisedStrands>>) -> Self {
        Self { strands, directions: OnceLock::new(), ..self }
    }

    /// Returns the directions of the strands (hair or fibres) in each voxel, on the graphics device. The first call
    /// uploads them.
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

/// Returns the affine transform from world coordinates (mm) to grid space, which is voxel index space plus one. Cell
/// `c` along an axis lies between the voxels `c - 1` and `c`.
pub fn grid_from_world(volume: &Volume) -> DAffine3 {
    DAffine3::from_translation(DVec3::ONE) * volume.index_from_world()
}

/// Sizes of the memory pool for curve nodes in the last builds of deep shadow maps, for each text of the method's
/// settings. A size is relative to the size of the shadow map, so that it can be used for other map sizes.
///
/// A pool as large as in the previous build does not overflow while a light moves a little, and the build runs once.
/// A size that is too large after an edit of the transfer function shrinks over the next builds.
#[derive(Debug, Default)]
pub struct PoolSizes(Mutex<HashMap<String, f64>>);

impl PoolSizes {
    /// Returns the size of the curve-node pool in the last builds of a deep shadow map with these settings, relative
    /// to the map's size. `None` before the first build.
    pub fn last(&self, settings: &str) -> Option<f64> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(settings).copied()
    }

    /// Records the size of the curve-node pool that a deep shadow map needed, relative to the map's size. A larger
    /// earlier size shrinks slowly, so that a light that moves back and forth overflows the pool only once.
    pub fn learn(&self, settings: String, used: f64) {
        let mut sizes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let share = sizes.entry(settings).or_default();
        *share = used.max(0.875 * *share);
    }
}
