//! The renderer: pipelines (immutable, compiled when first needed) apart from what one volume, one transfer function,
//! one light and one picture need.

mod device_transfer;
mod device_volume;
mod display;
mod forced;
mod kept;
mod layouts;
mod picture;
mod plan;
mod query;
mod session;

pub use device_transfer::{DeviceTransfer, FieldUniform, IntervalTable, MarchTable};
pub use device_volume::{DeviceVolume, TexelFormat};
pub use display::{BandUniform, DisplayTexture, Drawn, Pace};
pub use forced::{Forced, Optional};
pub use kept::{Change, INVALIDATES, Kept, Stage, Work};
pub use layouts::Layouts;
pub use picture::{FrameUniform, Picture};
pub use plan::{Omission, Plan, needs_shadows};
pub use session::Session;

use crate::error::{Error, Result};
use crate::gpu::{Gpu, PassTimer, PipelineStore, ShaderVariant, compose};
use crate::scene::Light;
use crate::shadow::{BuildContext, Method, ShadowMap, TilePace};
use crate::transfer::TransferFunction;
use crate::volume::{Bricks, Volume};
use glam::{DAffine3, DVec3};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// A volume with what the device holds of it.
pub struct LoadedVolume {
    pub volume: Arc<Volume>,
    pub bricks: Bricks,
    pub on_device: DeviceVolume,
}

/// Pipelines and layouts of one device.
pub struct Renderer {
    gpu: Gpu,
    layouts: Layouts,
    timer: PassTimer,
    store: Option<PipelineStore>,
    /// Light and frame are read as storage.
    live: bool,
    tile_pace: TilePace,
    pipelines: Mutex<HashMap<ShaderVariant, Arc<wgpu::ComputePipeline>>>,
}

impl Renderer {
    /// For pictures that take as long as they take.
    pub fn new(gpu: Gpu) -> Self {
        Self::with(gpu, false, f64::INFINITY)
    }

    /// For a window whose light moves and whose own drawing goes through the same queue.
    ///
    /// Shadow maps are built in submissions of about `submission_ms`. Light, frame and band are read as storage: a software adapter (lavapipe) puts the values of uniforms into the code that it compiles, which makes a
    /// picture faster, and the first one under every other light slower by hundreds of milliseconds.
    pub fn live(gpu: Gpu, submission_ms: f64) -> Self {
        Self::with(gpu, true, submission_ms)
    }

    fn with(gpu: Gpu, live: bool, submission_ms: f64) -> Self {
        let layouts = Layouts::new(&gpu, gpu.filters_float32, live);
        let timer = PassTimer::new(&gpu);
        let store = PipelineStore::open(&gpu.device, &gpu.info);
        let tile_pace = TilePace::new(submission_ms);
        Self { gpu, layouts, timer, store, live, tile_pace, pipelines: Mutex::default() }
    }

    pub(crate) fn tile_pace(&self) -> &TilePace {
        &self.tile_pace
    }

    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub(crate) fn layouts(&self) -> &Layouts {
        &self.layouts
    }

    pub(crate) fn timer(&self) -> &PassTimer {
        &self.timer
    }

    /// Uploads a volume and makes its bricks.
    ///
    /// # Errors
    /// A volume that the adapter cannot hold.
    pub fn load(&self, volume: Arc<Volume>) -> Result<LoadedVolume> {
        let on_device = DeviceVolume::upload(&self.gpu, &volume)?;
        Ok(LoadedVolume { bricks: Bricks::build(&volume), volume, on_device })
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
        DeviceTransfer::new(&self.gpu, &self.layouts, loaded, tf, forced)
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
        transfer.recolored(&self.gpu, &self.layouts, loaded, tf)
    }

    /// The pre-compressed table of a transfer function, for pipelines that march cell by cell; made when first asked for.
    ///
    /// # Errors
    /// A device out of memory.
    pub(crate) fn march_table<'t>(&self, transfer: &'t DeviceTransfer) -> Result<&'t MarchTable> {
        transfer.make_march_table(&self.gpu, &self.layouts)
    }

    /// Builds a shadow structure.
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
        method.build(&BuildContext { renderer: self, volume: &loaded.volume, transfer, light })
    }

    /// The pipeline of a variant, compiled when first asked for; `stage` is the layout of group 2.
    pub(crate) fn pipeline(
        &self,
        variant: &ShaderVariant,
        stage: &wgpu::BindGroupLayout,
    ) -> Result<Arc<wgpu::ComputePipeline>> {
        let mut variant = variant.clone();
        if !self.gpu.filters_float32 {
            variant.defs.push("MANUAL_TRILINEAR");
        }
        if self.live {
            variant.defs.push("LIVE");
        }
        let poisoned =
            || Error::runtime("cannot compile shader", variant.entry, "an earlier compilation panicked");
        if let Some(found) = self.pipelines.lock().map_err(|_| poisoned())?.get(&variant) {
            return Ok(Arc::clone(found));
        }
        let module = self.gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(variant.entry),
            source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(compose(&variant)?)),
        });
        let layout = self.gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(variant.entry),
            bind_group_layouts: &[Some(&self.layouts.field), Some(&self.layouts.shadow), Some(stage)],
            immediate_size: 0,
        });
        let pipeline = Arc::new(self.gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(variant.entry),
            layout: Some(&layout),
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            cache: self.store.as_ref().map(|s| &s.cache),
        }));
        self.gpu.take_error()?;
        self.pipelines.lock().map_err(|_| poisoned())?.insert(variant, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    /// Group 1: the light space and the two textures that a method's lookup reads.
    pub(crate) fn shadow_bind_group(
        &self,
        light: &wgpu::Buffer,
        first: &wgpu::TextureView,
        second: &wgpu::TextureView,
    ) -> wgpu::BindGroup {
        self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shadow"),
            layout: &self.layouts.shadow,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: light.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::TextureView(first) },
                wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::TextureView(second) },
            ],
        })
    }
}

/// Modules that every pipeline with a lookup starts from.
pub(crate) const COMMON: [&str; 3] = ["common/field.wgsl", "common/transfer.wgsl", "common/light.wgsl"];

/// Grid space is index space plus one, so that cell `c` interpolates the voxels `c - 1` and `c`.
fn grid_from_world(volume: &Volume) -> DAffine3 {
    DAffine3::from_translation(DVec3::ONE) * volume.index_from_world()
}
