//! Renderer of one graphics device: loads volumes and transfer functions, builds shadow maps, and draws pictures.

use super::mesh::MeshCache;
use super::plan::needs_shadows;
use crate::error::Result;
use crate::field::{
    BuildPasses, BuildRecorder, DeferredResult, DeviceTransfer, DisabledOptimizations, LoadedVolume,
    RecordedBuild, TilePace, View, WorkShare,
};
use crate::gpu::{Gpu, Kernels};
use crate::scene::{AmbientOcclusion, Light, LightSource, Scene};
use crate::shadow::{
    BuildContext, MapShare, Method, NoShadows, ShadowMap, ambient_occlusion, mapped_lights, merged_map,
};
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::sync::Arc;
use std::time::Instant;

/// Renderer of one graphics device, with its compute pipelines and the intended duration of its submissions.
pub struct Renderer {
    pub(super) kernels: Kernels,
    tile_pace: TilePace,
    pub(super) mesh: MeshCache,
}

impl Renderer {
    /// Creates a renderer that does not limit the duration of submissions to the device.
    pub fn new(gpu: Gpu) -> Self {
        Self::over(Kernels::new(gpu, false), f64::INFINITY)
    }

    /// Creates a renderer for a window, which shares the device with other threads and often moves the light. It
    /// builds shadow maps in submissions of about `submission_ms`, and software adapters read uniforms as storage
    /// buffers (see [`Kernels::new`]).
    pub fn live(gpu: Gpu, submission_ms: f64) -> Self {
        Self::over(Kernels::new(gpu, true), submission_ms)
    }

    fn over(kernels: Kernels, submission_ms: f64) -> Self {
        Self { kernels, tile_pace: TilePace::new(submission_ms), mesh: MeshCache::default() }
    }

    /// Returns the graphics device of the renderer.
    pub fn gpu(&self) -> &Gpu {
        self.kernels.gpu()
    }

    /// Returns the compute pipelines of the renderer.
    pub fn kernels(&self) -> &Kernels {
        &self.kernels
    }

    /// Uploads a volume to the graphics device.
    ///
    /// # Errors
    /// The adapter cannot hold the volume.
    pub fn load(&self, volume: Arc<Volume>) -> Result<LoadedVolume> {
        LoadedVolume::new(self.gpu(), volume)
    }

    /// Computes the lookup tables of a transfer function on the device, and classifies the volume's bricks (blocks of
    /// voxel cells) as active or empty.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn transfer(
        &self,
        loaded: &LoadedVolume,
        tf: &TransferFunction,
        disabled: DisabledOptimizations,
    ) -> Result<DeviceTransfer> {
        DeviceTransfer::new(self.gpu(), loaded, tf, disabled)
    }

    /// Returns a copy of a transfer function's device data with the colours of `tf`, whose extinction must be the
    /// same at all values of the volume.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn recolor(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        tf: &TransferFunction,
    ) -> Result<DeviceTransfer> {
        transfer.recolored(self.gpu(), loaded, tf)
    }

    /// Builds the shadow map (or other shadow data structure) of one light, and measures the build times on the host
    /// and on the device.
    ///
    /// # Errors
    /// The adapter cannot hold the shadow map.
    pub fn shadow(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        light: impl Into<LightSource>,
    ) -> Result<ShadowMap> {
        self.build((loaded, transfer), method, &light.into(), None, BuildPasses::default())
    }

    /// Builds the shadow map of one light like [`Self::shadow`], and records the passes of the build. The map has all
    /// tiles, and more memory than it needs under this light.
    ///
    /// # Errors
    /// The adapter cannot hold the shadow map.
    pub fn recorded_shadow(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        light: Light,
    ) -> Result<(ShadowMap, RecordedBuild)> {
        // The first build finds the sizes of memory pools, so that the second runs each pass once.
        let light = LightSource::from(light);
        let none = BuildPasses::default();
        let context = self.build_context((loaded, transfer), &light, None, none, WorkShare::WHOLE);
        if transfer.stream().is_some() {
            return Err(context.not_by_blocks());
        }
        let record = |recorder: &BuildRecorder| {
            let passes = BuildPasses { recorder: Some(recorder), ..none };
            self.build((loaded, transfer), method, &light, None, passes)
        };
        record(&BuildRecorder::default())?;
        let recorder = BuildRecorder::default();
        let map = record(&recorder)?;
        Ok((map, recorder.into_build()))
    }

    /// Returns the shadow method for a picture of a scene: the given one, or [`NoShadows`] if no visible point can
    /// lie in shadow ([`needs_shadows`]).
    pub fn effective_method<'m>(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &'m dyn Method,
        scene: &Scene,
    ) -> &'m dyn Method {
        if needs_shadows(scene, &loaded.volume, transfer).is_ok() { method } else { &NoShadows }
    }

    /// Builds the shadow map of one light for pictures of a scene; without shadows, a map that is never queried. The
    /// map is valid in the camera view `view` only; `None`: at all points.
    ///
    /// # Errors
    /// See [`Self::shadow`].
    pub fn shadow_in(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        (scene, light): (&Scene, &LightSource),
        view: Option<&View>,
    ) -> Result<ShadowMap> {
        self.shadow_with((loaded, transfer), method, (scene, light), view, BuildPasses::default())
    }

    /// Builds a shadow map like [`Self::shadow_in`]. With `passes.deferred`, passes wait there for the submission of a
    /// picture ([`LightMaps::after`]), and [`Self::complete`] has to follow.
    ///
    /// # Errors
    /// See [`Self::shadow`]; or `passes.go_on` cancelled the build.
    ///
    /// [`LightMaps::after`]: super::LightMaps::after
    pub fn shadow_with(
        &self,
        field: (&LoadedVolume, &DeviceTransfer),
        method: &dyn Method,
        (scene, light): (&Scene, &LightSource),
        view: Option<&View>,
        passes: BuildPasses<'_>,
    ) -> Result<ShadowMap> {
        let method = self.effective_method(field.0, field.1, method, scene);
        self.build(field, method, light, view, passes)
    }

    /// Completes the report of a shadow map with the results of its deferred passes. Returns `false` if the map is
    /// incomplete and must be built again; the picture drawn with it is invalid.
    ///
    /// # Errors
    /// The device could not build the map.
    pub fn complete(
        &self,
        loaded: &LoadedVolume,
        method: &dyn Method,
        map: &mut ShadowMap,
        results: &[Option<DeferredResult>],
    ) -> Result<bool> {
        let Some(results) = results.iter().map(Option::as_ref).collect::<Option<Vec<_>>>() else {
            return Ok(false);
        };
        for result in &results {
            self.tile_pace.learn_deferred(result.label, result.count, result.span);
            map.report.device = Some(map.report.device.map_or(result.span, |span| span.plus(result.span)));
        }
        let words = results.iter().rev().find_map(|result| result.words.first());
        words.map_or(Ok(true), |words| method.complete(&mut map.report, words, &loaded.node_pools))
    }

    /// Returns maps whose queries are the mean transmittance of rays of ambient occlusion around a point, each with its
    /// share of the rays.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn occlusion(
        &self,
        field: (&LoadedVolume, &DeviceTransfer),
        occlusion: AmbientOcclusion,
    ) -> Result<Vec<(ShadowMap, f64)>> {
        let passes = BuildPasses::default();
        let source = LightSource::default();
        ambient_occlusion(&self.build_context(field, &source, None, passes, WorkShare::WHOLE), occlusion)
    }

    fn build_context<'a>(
        &'a self,
        (loaded, transfer): (&'a LoadedVolume, &'a DeviceTransfer),
        source: &'a LightSource,
        view: Option<&'a View>,
        passes: BuildPasses<'a>,
        share: WorkShare,
    ) -> BuildContext<'a> {
        let LoadedVolume { volume, strands, node_pools, .. } = loaded;
        BuildContext {
            kernels: &self.kernels,
            pace: &self.tile_pace,
            node_pools,
            volume,
            transfer,
            strands: strands.as_deref(),
            light: source.light,
            extent: &source.extent,
            view,
            share,
            // Rays that wait for pages need several submissions.
            passes: BuildPasses {
                deferred: passes.deferred.filter(|_| transfer.stream().is_none()),
                ..passes
            },
        }
    }

    fn build(
        &self,
        field: (&LoadedVolume, &DeviceTransfer),
        method: &dyn Method,
        source: &LightSource,
        view: Option<&View>,
        passes: BuildPasses<'_>,
    ) -> Result<ShadowMap> {
        let context = self.build_context(field, source, view, passes, WorkShare::WHOLE);
        self.build_in(&context, method, source)
    }

    fn build_in(
        &self,
        context: &BuildContext<'_>,
        method: &dyn Method,
        source: &LightSource,
    ) -> Result<ShadowMap> {
        let start = Instant::now();
        let transfer = context.transfer;
        let made_before = transfer.march_table().is_some();
        if transfer.stream().is_some() && method.lookup().is_some_and(|lookup| lookup.marches()) {
            return Err(context.not_by_blocks());
        }
        let mut map = method.build(context)?;
        map.report.more_samples = source.sample_count() - 1;
        // Bounds are derived for extinction that depends on the value alone.
        map.bound = map.bound.filter(|_| !transfer.has_gradient_opacity);
        // Tables are made once per transfer function, and their time is measured separately.
        let table_ms = transfer.march_table().filter(|_| !made_before).map_or(0.0, |table| table.table_ms);
        map.report.set_host_ms(start.elapsed().as_secs_f64() * 1e3 - table_ms);
        Ok(map)
    }

    /// Builds the share of a process in the shadow map of one light, for the picture of a scene. Other texels have no
    /// shadow.
    ///
    /// # Errors
    /// See [`Self::shadow`].
    pub fn shadow_share(
        &self,
        field: (&LoadedVolume, &DeviceTransfer),
        method: &dyn Method,
        source: &LightSource,
        view: Option<&View>,
        share: WorkShare,
    ) -> Result<ShadowMap> {
        let context = self.build_context(field, source, view, BuildPasses::default(), share);
        self.build_in(&context, method, source)
    }

    /// Forms the deep shadow map of one light from the shares of all processes.
    ///
    /// # Errors
    /// The method is not `dsm`, or the adapter cannot hold the map.
    pub fn merged_shadow(
        &self,
        field: (&LoadedVolume, &DeviceTransfer),
        method: &dyn Method,
        source: &LightSource,
        view: Option<&View>,
        shares: &[MapShare],
    ) -> Result<ShadowMap> {
        let context = self.build_context(field, source, view, BuildPasses::default(), WorkShare::WHOLE);
        merged_map(&context, method, shares)
    }

    /// Builds the shadow maps of all lights of a scene that are not black ([`mapped_lights`]), in the order of the
    /// lights.
    ///
    /// # Errors
    /// The adapter cannot hold a shadow map.
    pub fn shadows_in(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        method: &dyn Method,
        scene: &Scene,
        view: Option<&View>,
    ) -> Result<Vec<ShadowMap>> {
        let lights = mapped_lights(self.effective_method(loaded, transfer, method, scene), scene);
        let build = |light: LightSource| self.shadow_in(loaded, transfer, method, (scene, &light), view);
        lights.into_iter().map(build).collect()
    }
}
