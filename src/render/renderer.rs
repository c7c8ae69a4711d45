//! Renderer: pipelines of one device.

use super::mesh::KeptMesh;
use super::plan::needs_shadows;
use crate::error::Result;
use crate::field::{DeviceTransfer, Forced, LoadedVolume, TilePace, View};
use crate::gpu::{Gpu, Kernels};
use crate::scene::{Light, LightSource, Scene};
use crate::shadow::{BuildContext, Method, NoShadows, ShadowMap};
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::sync::Arc;
use std::time::Instant;

/// Pipelines of one device and the target duration of a submission.
pub struct Renderer {
    pub(super) kernels: Kernels,
    tile_pace: TilePace,
    pub(super) mesh: KeptMesh,
}

impl Renderer {
    /// Creates a renderer without a limit on the duration of a submission.
    pub fn new(gpu: Gpu) -> Self {
        Self {
            kernels: Kernels::new(gpu, false),
            tile_pace: TilePace::new(f64::INFINITY),
            mesh: KeptMesh::default(),
        }
    }

    /// Creates a renderer for interactive use, whose queue the window shares. Shadow maps are built in submissions of
    /// about `submission_ms`, and changing data is read as storage (see [`Kernels::new`]).
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
        forced: Forced,
    ) -> Result<DeviceTransfer> {
        DeviceTransfer::new(self.gpu(), loaded, tf, forced)
    }

    /// Copies tables with the colours of `tf`. Its extinction must be equal at all values that occur.
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

    /// Builds a shadow structure that is valid at every point. Its report includes host and device times.
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
        self.build(loaded, transfer, method, light, None)
    }

    /// Method that a scene's picture needs: [`NoShadows`] where no light can be blocked ([`needs_shadows`]).
    pub fn effective_method<'m>(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &'m dyn Method,
        scene: &Scene,
    ) -> &'m dyn Method {
        if needs_shadows(scene, &loaded.volume, transfer).is_ok() { method } else { &NoShadows }
    }

    /// Builds the shadow structure of one light for the pictures of a scene, by its effective method. Lookups are valid in
    /// the view only; `None` means all points.
    ///
    /// # Errors
    /// As [`Self::shadow`].
    pub fn shadow_in(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        (scene, light): (&Scene, Light),
        view: Option<&View>,
    ) -> Result<ShadowMap> {
        let method = self.effective_method(loaded, transfer, method, scene);
        self.build(loaded, transfer, method, light, view)
    }

    fn build(
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
        // The table is made once per transfer function and is timed separately.
        let table_ms = transfer.march_table().filter(|_| !made_before).map_or(0.0, |table| table.table_ms);
        map.report.set_host_ms(start.elapsed().as_secs_f64() * 1e3 - table_ms);
        Ok(map)
    }

    /// Builds the shadow structure of each light that shines ([`Scene::shining`]), in their order.
    ///
    /// # Errors
    /// As [`Self::shadow`].
    pub fn shadows_in(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        scene: &Scene,
        view: Option<&View>,
    ) -> Result<Vec<ShadowMap>> {
        let build =
            |source: LightSource| self.shadow_in(loaded, transfer, method, (scene, source.light), view);
        scene.shining().into_iter().map(build).collect()
    }
}
