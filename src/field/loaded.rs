//! Volume that is loaded onto the graphics device, and the coordinates in which shaders address its voxels (voxel
//! index plus one).

use super::{DeviceDirections, DeviceVolume, NodePools};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::strands::VoxelisedStrands;
use crate::volume::Volume;
use glam::{DAffine3, DVec3};
use std::sync::{Arc, OnceLock};

/// Volume on the host, together with its data on the graphics device.
pub struct LoadedVolume {
    /// Volume in host memory.
    pub volume: Arc<Volume>,
    /// Strands (hair or fibres) from which the volume was voxelised; `None` for other volumes.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Voxels of the volume on the graphics device.
    pub on_device: DeviceVolume,
    /// Memory pools for curve nodes of earlier builds of deep shadow maps for this volume, and their sizes.
    pub node_pools: NodePools,
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
        let (node_pools, directions) = (NodePools::default(), OnceLock::new());
        Ok(Self { volume, strands: None, on_device, node_pools, directions })
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
