//! Rendering session, which commands use to draw pictures and to query shadow maps: a volume and its transfer
//! function on a graphics device.

use super::{
    DeviceTransfer, DisabledOptimizations, LightMaps, LoadedVolume, Picture, Renderer, needs_shadows,
};
use crate::error::Result;
use crate::field::View;
use crate::gpu::Gpu;
use crate::scene::{Light, LightSource, Scene};
use crate::shadow::{Method, NodeMap, ShadowMap, node_depths, node_map};
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use glam::DVec3;
use std::sync::Arc;

/// Rendering session: a volume and its transfer function on one graphics device, with methods that draw pictures and
/// query shadow maps.
pub struct Session {
    /// Renderer with the graphics device and its compute pipelines; several sessions may share it.
    pub renderer: Arc<Renderer>,
    /// Volume of the session, on the host and on the graphics device.
    pub loaded: LoadedVolume,
    /// Transfer function of the session on the graphics device.
    pub transfer: DeviceTransfer,
}

impl Session {
    /// Opens a rendering session: opens the graphics adapter (`--adapter`), uploads a volume, and computes the lookup
    /// tables of its transfer function. `forced` holds the optimizations that are disabled (`--no-skip`).
    ///
    /// # Errors
    /// There is no adapter, or it cannot hold the volume.
    pub fn open(
        adapter: Option<&str>,
        volume: Arc<Volume>,
        tf: &TransferFunction,
        forced: DisabledOptimizations,
    ) -> Result<Self> {
        Self::on(&Arc::new(Renderer::new(Gpu::open(adapter)?)), volume, tf, forced)
    }

    /// Opens a rendering session with an existing renderer: uploads a volume, and computes the lookup tables of its
    /// transfer function.
    ///
    /// # Errors
    /// The adapter cannot hold the volume.
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

    /// Adds the strands (hair or fibres) from which the session's volume was voxelised.
    #[must_use]
    pub fn with_strands(self, strands: Option<Arc<VoxelisedStrands>>) -> Self {
        Self { loaded: self.loaded.with_strands(strands), ..self }
    }

    /// Makes the device data of another transfer function for the session's volume: computes its lookup tables, and
    /// classifies the bricks (blocks of voxel cells) as active or empty.
    ///
    /// # Errors
    /// See [`Renderer::transfer`].
    pub fn fresh_transfer(&self, tf: &TransferFunction) -> Result<DeviceTransfer> {
        self.renderer.transfer(&self.loaded, tf, self.transfer.disabled)
    }

    /// Decides whether a picture of a scene needs a shadow map.
    ///
    /// # Errors
    /// Returns the reason why the scene needs no shadow map.
    pub fn needs_shadows(&self, scene: &Scene) -> std::result::Result<(), &'static str> {
        needs_shadows(scene, &self.loaded.volume, &self.transfer)
    }

    /// Builds the shadow map of one light, which can be queried at every point of the volume.
    ///
    /// # Errors
    /// See [`Renderer::shadow`].
    pub fn shadow(&self, method: &dyn Method, light: impl Into<LightSource>) -> Result<ShadowMap> {
        self.renderer.shadow(&self.loaded, &self.transfer, method, light)
    }

    /// Builds the shadow map of one light for the picture of a scene.
    ///
    /// # Errors
    /// See [`Renderer::shadow`].
    pub fn shadow_of(&self, method: &dyn Method, scene: &Scene, light: Light) -> Result<ShadowMap> {
        let view = View::of_shadows(scene);
        self.renderer.shadow_in(&self.loaded, &self.transfer, method, (scene, &light.into()), view.as_ref())
    }

    /// Builds the shadow maps of all lights that are not black, for the picture of a scene, in the order of the
    /// lights.
    ///
    /// # Errors
    /// See [`Renderer::shadow`].
    pub fn shadows_of(&self, method: &dyn Method, scene: &Scene) -> Result<Vec<ShadowMap>> {
        let view = View::of_shadows(scene);
        self.renderer.shadows_in(&self.loaded, &self.transfer, method, scene, view.as_ref())
    }

    /// Renders a picture of a scene with the given shadow maps.
    ///
    /// # Errors
    /// See [`Renderer::render`].
    pub fn render<'a>(&self, shadows: impl Into<LightMaps<'a>>, scene: &Scene) -> Result<Picture> {
        self.renderer.render(&self.loaded, &self.transfer, shadows, scene)
    }

    /// Returns the transmittance from the light to world points (mm), queried from a shadow map.
    ///
    /// # Errors
    /// See [`Renderer::query`].
    pub fn query(&self, shadow: &ShadowMap, points_mm: &[DVec3]) -> Result<Vec<f32>> {
        self.renderer.query(&self.loaded, &self.transfer, shadow, points_mm)
    }

    /// Returns the number of curve nodes in each texel of a deep shadow map; `None` for other shadow methods.
    ///
    /// # Errors
    /// See [`node_map`].
    pub fn node_map(&self, shadow: &ShadowMap) -> Result<Option<NodeMap>> {
        node_map(self.renderer.kernels(), &self.transfer, shadow)
    }

    /// Returns the depths (mm) of the curve nodes in the given texels of a deep shadow map; `None` for other shadow
    /// methods.
    ///
    /// # Errors
    /// See [`node_depths`].
    pub fn node_depths(&self, shadow: &ShadowMap, texels: &[[u32; 2]]) -> Result<Option<Vec<Vec<f64>>>> {
        node_depths(self.renderer.kernels(), &self.transfer, shadow, texels)
    }
}
