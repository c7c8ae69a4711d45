//! What draws on one device.

use super::mesh::KeptMesh;
use crate::error::Result;
use crate::field::{DeviceTransfer, DisabledOptimizations, LoadedVolume, TilePace, View};
use crate::gpu::{Gpu, Kernels};
use crate::scene::{Light, LightSource, Scene};
use crate::shadow::{BuildContext, Method, ShadowMap};
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::sync::Arc;
use std::time::Instant;

/// Everything that draws on one device: its pipelines, and how long one submission may keep its queue.
pub struct Renderer {
    pub(super) kernels: Kernels,
    tile_pace: TilePace,
    pub(super) mesh: KeptMesh,
}

impl Renderer {
    /// For pictures that take as long as they take.
    pub fn new(gpu: Gpu) -> Self {
        Self {
            kernels: Kernels::new(gpu, false),
            tile_pace: TilePace::new(f64::INFINITY),
            mesh: KeptMesh::default(),
        }
    }

    /// For a window whose light moves and whose own drawing goes through the same queue: shadow maps are built in
    /// submissions of about `submission_ms`, and what moves is read as storage (see [`Kernels::new`]).
    pub fn live(gpu: Gpu, submission_ms: f64) -> Self {
        Self {
            kernels: Kernels::new(gpu, true),
            tile_pace: TilePace::new(submission_ms),
            mesh: KeptMesh::default(),
        }
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        self.kernels.gpu()
    }

    /// The device's pipelines.
    pub fn kernels(&self) -> &Kernels {
        &self.kernels
    }

    /// Uploads a volume and makes its bricks.
    ///
    /// # Errors
    /// A volume that the adapter cannot hold.
    pub fn load(&self, volume: Arc<Volume>) -> Result<LoadedVolume> {
        LoadedVolume::new(self.gpu(), volume)
    }

    /// Tables and brick classes of a transfer function on a volume.
    ///
    /// # Errors
    /// A device out of memory.
    pub fn transfer(
        &self,
        loaded: &LoadedVolume,
        tf: &TransferFunction,
        forced: DisabledOptimizations,
    ) -> Result<DeviceTransfer> {
        DeviceTransfer::new(self.gpu(), loaded, tf, forced)
    }

    /// The same tables with the colours of `tf`, whose extinction must be theirs at all values that occur.
    ///
    /// # Errors
    /// A device out of memory.
    pub fn recolor(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        tf: &TransferFunction,
    ) -> Result<DeviceTransfer> {
        transfer.recolored(self.gpu(), loaded, tf)
    }

    /// Builds a shadow structure; its report has all that this took, on the host and on the device.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold.
    pub fn shadow(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        light: Light,
    ) -> Result<ShadowMap> {
        self.shadow_in(loaded, transfer, method, light, None)
    }

    /// The same for the pictures of a view: points outside of it may be looked up wrongly. `None` is as [`Self::shadow`].
    ///
    /// # Errors
    /// As there.
    pub fn shadow_in(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        light: Light,
        view: Option<&View>,
    ) -> Result<ShadowMap> {
        let start = Instant::now();
        let made_before = transfer.march_table().is_some();
        let LoadedVolume { volume, strands, pool_sizes, .. } = loaded;
        let (kernels, pace, strands) = (&self.kernels, &self.tile_pace, strands.as_deref());
        let context = BuildContext { kernels, pace, pool_sizes, volume, transfer, strands, light, view };
        let mut map = method.build(&context)?;
        // Tables are made once for a transfer function, and have a time of their own.
        let table_ms = transfer.march_table().filter(|_| !made_before).map_or(0.0, |table| table.table_ms);
        map.report.set_host_ms(start.elapsed().as_secs_f64() * 1e3 - table_ms);
        Ok(map)
    }

    /// The same for each light of a scene that shines ([`Scene::shining`]), in their order.
    ///
    /// # Errors
    /// As there.
    pub fn shadows_in(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        scene: &Scene,
        view: Option<&View>,
    ) -> Result<Vec<ShadowMap>> {
        let build = |source: LightSource| self.shadow_in(loaded, transfer, method, source.light, view);
        scene.shining().into_iter().map(build).collect()
    }
}
