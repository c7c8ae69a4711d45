//! Volume and transfer function on a device, for the commands.

use super::{
    DeviceTransfer, DisabledOptimizations, LightMaps, LoadedVolume, Picture, Renderer, needs_shadows,
};
use crate::error::Result;
use crate::field::View;
use crate::gpu::Gpu;
use crate::scene::{Light, Scene};
use crate::shadow::{Method, NodeMap, ShadowMap, node_depths, node_map};
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use glam::DVec3;
use std::sync::Arc;

/// Volume and transfer function on one device.
pub struct Session {
    /// Device and pipelines; sessions may share them.
    pub renderer: Arc<Renderer>,
    /// Volume, on the host and on the device.
    pub loaded: LoadedVolume,
    /// Transfer function on the device.
    pub transfer: DeviceTransfer,
}

impl Session {
    /// Opens the adapter (`--adapter`), uploads the volume and makes the tables; `forced` is what is done although the
    /// scene does not need it (`--no-skip`).
    ///
    /// # Errors
    /// No adapter, or a volume that it cannot hold.
    pub fn open(
        adapter: Option<&str>,
        volume: Arc<Volume>,
        tf: &TransferFunction,
        forced: DisabledOptimizations,
    ) -> Result<Self> {
        Self::on(&Arc::new(Renderer::new(Gpu::open(adapter)?)), volume, tf, forced)
    }

    /// Uploads the volume and makes the tables on an open renderer.
    ///
    /// # Errors
    /// A volume that it cannot hold.
    pub fn on(
        renderer: &Arc<Renderer>,
        volume: Arc<Volume>,
        tf: &TransferFunction,
        forced: DisabledOptimizations,
    ) -> Result<Self> {
        let loaded = renderer.load(volume)?;
        let transfer = renderer.transfer(&loaded, tf, forced)?;
        Ok(Self { renderer: Arc::clone(renderer), loaded, transfer })
    }

    /// Adds the strands that the volume was made from.
    #[must_use]
    pub fn with_strands(self, strands: Option<Arc<VoxelisedStrands>>) -> Self {
        Self { loaded: self.loaded.with_strands(strands), ..self }
    }

    /// Makes the tables and classifies the bricks again.
    ///
    /// # Errors
    /// See [`Renderer::transfer`].
    pub fn fresh_transfer(&self, tf: &TransferFunction) -> Result<DeviceTransfer> {
        self.renderer.transfer(&self.loaded, tf, self.transfer.disabled)
    }

    /// Whether a scene needs a shadow structure, or why not.
    ///
    /// # Errors
    /// The reason why not.
    pub fn needs_shadows(&self, scene: &Scene) -> std::result::Result<(), &'static str> {
        needs_shadows(scene, &self.loaded.volume, &self.transfer)
    }

    /// Builds a shadow structure that is valid at every point.
    ///
    /// # Errors
    /// See [`Renderer::shadow`].
    pub fn shadow(&self, method: &dyn Method, light: Light) -> Result<ShadowMap> {
        self.renderer.shadow(&self.loaded, &self.transfer, method, light)
    }

    /// Builds the shadow structure of one light for the picture of a scene.
    ///
    /// # Errors
    /// See [`Renderer::shadow`].
    pub fn shadow_of(&self, method: &dyn Method, scene: &Scene, light: Light) -> Result<ShadowMap> {
        let view = View::of_shadows(scene);
        self.renderer.shadow_in(&self.loaded, &self.transfer, method, (scene, light), view.as_ref())
    }

    /// Builds the shadow structure of each light that shines for the picture of a scene, in their order.
    ///
    /// # Errors
    /// See [`Renderer::shadow`].
    pub fn shadows_of(&self, method: &dyn Method, scene: &Scene) -> Result<Vec<ShadowMap>> {
        let view = View::of_shadows(scene);
        self.renderer.shadows_in(&self.loaded, &self.transfer, method, scene, view.as_ref())
    }

    /// Renders a picture.
    ///
    /// # Errors
    /// See [`Renderer::render`].
    pub fn render<'a>(&self, shadows: impl Into<LightMaps<'a>>, scene: &Scene) -> Result<Picture> {
        self.renderer.render(&self.loaded, &self.transfer, shadows, scene)
    }

    /// Transmittance from the light to world points (mm).
    ///
    /// # Errors
    /// See [`Renderer::query`].
    pub fn query(&self, shadow: &ShadowMap, points_mm: &[DVec3]) -> Result<Vec<f32>> {
        self.renderer.query(&self.loaded, &self.transfer, shadow, points_mm)
    }

    /// Nodes per texel of a deep shadow map.
    ///
    /// # Errors
    /// See [`node_map`].
    pub fn node_map(&self, shadow: &ShadowMap) -> Result<Option<NodeMap>> {
        node_map(self.renderer.kernels(), &self.transfer, shadow)
    }

    /// Depths of the nodes of texels of a deep shadow map.
    ///
    /// # Errors
    /// See [`node_depths`].
    pub fn node_depths(&self, shadow: &ShadowMap, texels: &[[u32; 2]]) -> Result<Option<Vec<Vec<f64>>>> {
        node_depths(self.renderer.kernels(), &self.transfer, shadow, texels)
    }
}
