//! The renderer: pipelines (immutable, compiled when first needed) apart from what one volume, one transfer function,
//! one light and one picture need.

mod device_transfer;
mod device_volume;
mod display;
mod forced;
mod kept;
mod layouts;
mod plan;
mod session;

pub use device_transfer::{DeviceTransfer, FieldUniform, IntervalTable, MarchTable};
pub use device_volume::{DeviceVolume, TexelFormat};
pub use display::{BandUniform, DisplayTexture, Drawn, Pace};
pub use forced::{Forced, Optional};
pub use kept::{Change, INVALIDATES, Kept, Stage, Work};
pub use layouts::Layouts;
pub use plan::{Omission, Plan, needs_shadows};
pub use session::Session;

use crate::error::{Error, Result};
use crate::gpu::{
    Gpu, PassTimer, PipelineStore, ShaderVariant, Span, StorageBuffer, compose, read_back, uniform_buffer,
};
use crate::scene::{Light, Scene, Shading};
use crate::shadow::{BuildContext, Method, ShadowMap, TilePace};
use crate::transfer::TransferFunction;
use crate::volume::{Bricks, Volume};
use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// `Frame` of `shaders/raycast.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct FrameUniform {
    pub plane_center: [f32; 3],
    pub plane_distance_mm: f32,
    pub grid_forward: [f32; 3],
    pub step_mm: f32,
    pub grid_right: [f32; 3],
    pub ambient: f32,
    pub grid_up: [f32; 3],
    pub first_row: u32,
    pub background: [f32; 3],
    pub rows: u32,
    pub half_extent: [f32; 2],
    pub size: [u32; 2],
    pub world_x: [f32; 3],
    pub shading_weight: f32,
    pub world_y: [f32; 3],
    pub padding_b: f32,
    pub world_z: [f32; 3],
    pub padding_c: f32,
}

/// A volume with what the device holds of it.
pub struct LoadedVolume {
    pub volume: Arc<Volume>,
    pub bricks: Bricks,
    pub on_device: DeviceVolume,
}

/// A finished picture.
pub struct Picture {
    /// `height x width x 4`: linear RGB over the background, and opacity `1 - T_eye`.
    pub pixels: Array3<f32>,
    /// Time of the ray casting alone.
    pub span: Span,
    pub plan: Plan,
}

/// Rows of a picture that are finished, in the order of the picture.
pub(crate) struct Band<'a> {
    /// `rows x width x 4` floats: linear RGB and opacity.
    pub buffer: &'a wgpu::Buffer,
    pub first_row: u32,
    pub rows: u32,
    /// Time of this band's ray casting.
    pub span: Span,
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

    /// Renders one picture.
    ///
    /// # Errors
    /// A picture that the adapter cannot hold, or a lost device.
    pub fn render(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        scene: &Scene,
    ) -> Result<Picture> {
        let broken = || Error::runtime("cannot render", "picture", "it was left unfinished");
        self.render_with(loaded, transfer, shadow, scene, |_| u32::MAX, |_| true)?.ok_or_else(broken)
    }

    /// As [`Self::render`], in bands of about `band_ms`, so that others can draw in between; `go_on` hears the share that
    /// is done after each, and ends the work (`None`) by saying no.
    ///
    /// # Errors
    /// As there.
    pub fn render_in_bands(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        scene: &Scene,
        band_ms: f64,
        go_on: impl FnMut(f32) -> bool,
    ) -> Result<Option<Picture>> {
        let mut pace = Pace::new(band_ms);
        let rows_next = |last: Option<(Span, u32)>| {
            if let Some((span, rows)) = last {
                pace.learn(rows * scene.width, span);
            }
            pace.rows(scene.width)
        };
        self.render_with(loaded, transfer, shadow, scene, rows_next, go_on)
    }

    fn render_with(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        scene: &Scene,
        rows_next: impl FnMut(Option<(Span, u32)>) -> u32,
        mut go_on: impl FnMut(f32) -> bool,
    ) -> Result<Option<Picture>> {
        let (width, height) = (scene.width as usize, scene.height as usize);
        let mut pixels = Vec::with_capacity(width * height * 4);
        let mut complete = true;
        let (plan, span) = self.draw(loaded, transfer, shadow, scene, rows_next, |band| {
            pixels.extend(read_back::<f32>(&self.gpu, band.buffer, band.rows as usize * width * 4)?);
            complete = go_on((band.first_row + band.rows) as f32 / height as f32);
            Ok(complete)
        })?;
        if !complete {
            return Ok(None);
        }
        let broken = |why: String| Error::runtime("cannot render", "picture", why);
        let pixels = Array3::from_shape_vec((height, width, 4), pixels).map_err(|e| broken(e.to_string()))?;
        let span = span.ok_or_else(|| broken("it has no rows".into()))?;
        Ok(Some(Picture { pixels, span, plan }))
    }

    /// Casts the rays of a picture band by band: `rows_next` says how high the next band may be, given the last one's
    /// time and rows, and `finished` whether to go on after one.
    pub(crate) fn draw(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        scene: &Scene,
        mut rows_next: impl FnMut(Option<(Span, u32)>) -> u32,
        mut finished: impl FnMut(&Band<'_>) -> Result<bool>,
    ) -> Result<(Plan, Option<Span>)> {
        if shadow.lookup.as_ref().is_some_and(|l| l.marches) {
            self.march_table(transfer)?;
        }
        let plan = Plan::of(scene, loaded, transfer, shadow);
        let variant = plan.raycast_variant(transfer, shadow);
        let pipeline = self.pipeline(&variant, &self.layouts.frame)?;
        let (width, height) = (scene.width, scene.height);
        // Large pictures are drawn in bands that the adapter can bind.
        let row_bytes = u64::from(width) * 16;
        let limits = self.gpu.device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let highest = u32::try_from(most / row_bytes).unwrap_or(u32::MAX).clamp(1, height);
        let mut span: Option<Span> = None;
        let resumable = plan.resumable(shadow);
        let mut first_row = 0;
        let mut last = None;
        let mut made: Option<(wgpu::Buffer, u32)> = None;
        while first_row < height {
            let rows = rows_next(last).clamp(1, highest).min(height - first_row);
            let buffer = match &made {
                Some((buffer, rows_made)) if *rows_made >= rows => buffer.clone(),
                _ => {
                    let buffer = StorageBuffer::zeroed(&self.gpu, "picture", row_bytes * u64::from(rows))?;
                    made = Some((buffer.clone(), rows));
                    buffer
                }
            };
            let uniform =
                uniform_buffer(&self.gpu, "frame", &frame_uniform(&loaded.volume, scene, first_row, rows));
            // A count of unfinished pixels, then where each goes on.
            let pixels_here = if resumable { rows as usize * width as usize } else { 3 };
            let mut start = vec![f32::from_bits(0)];
            start.resize(pixels_here + 1, NOT_STARTED);
            let progress = StorageBuffer::from_slice(&self.gpu, "progress", &start)?;
            let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("frame"),
                layout: &self.layouts.frame,
                entries: &[
                    wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() },
                    wgpu::BindGroupEntry { binding: 1, resource: buffer.as_entire_binding() },
                    wgpu::BindGroupEntry { binding: 2, resource: progress.as_entire_binding() },
                ],
            });
            let mut band_span: Option<Span> = None;
            let took = loop {
                let took = self.timer.compute(&self.gpu, "ray cast", |pass| {
                    pass.set_pipeline(&pipeline);
                    pass.set_bind_group(0, transfer.bind_group(), &[]);
                    pass.set_bind_group(1, &shadow.bind_group, &[]);
                    pass.set_bind_group(2, &group, &[]);
                    pass.dispatch_workgroups(width.div_ceil(8), rows.div_ceil(8), 1);
                })?;
                let so_far = band_span.map_or(took, |s| s.plus(took));
                band_span = Some(so_far);
                if !resumable || read_back::<u32>(&self.gpu, &progress, 1)?[0] == 0 {
                    break so_far;
                }
                self.gpu.queue.write_buffer(&progress, 0, &0u32.to_le_bytes());
            };
            span = Some(span.map_or(took, |s| s.plus(took)));
            if !finished(&Band { buffer: &buffer, first_row, rows, span: took })? {
                break;
            }
            first_row += rows;
            last = Some((took, rows));
        }
        Ok((plan, span))
    }

    /// Transmittance from the light to world points, by the lookup that pictures use.
    ///
    /// # Errors
    /// A lost device.
    pub fn query(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        points_mm: &[DVec3],
    ) -> Result<Vec<f32>> {
        let Some(lookup) = shadow.lookup.as_ref().filter(|_| !transfer.empty) else {
            return Ok(vec![1.0; points_mm.len()]);
        };
        let mut modules = COMMON.to_vec();
        modules.extend(lookup.modules);
        let mut defs = lookup.defs.clone();
        if lookup.marches {
            self.march_table(transfer)?;
            defs.extend(transfer.march_defs());
        }
        let variant = ShaderVariant { entry: "query.wgsl", modules, defs };
        let pipeline = self.pipeline(&variant, &self.layouts.query)?;
        let grid_from_world = grid_from_world(&loaded.volume);
        let mut results = Vec::with_capacity(points_mm.len());
        // A million points at a time bounds the buffers.
        for chunk in points_mm.chunks(1 << 20) {
            let grid = chunk
                .iter()
                .map(|p| grid_from_world.transform_point3(*p).as_vec3().extend(0.0).to_array())
                .collect::<Vec<_>>();
            let points = StorageBuffer::from_slice(&self.gpu, "query points", &grid)?;
            let values = StorageBuffer::zeroed(&self.gpu, "query results", chunk.len() as u64 * 4)?;
            let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("query"),
                layout: &self.layouts.query,
                entries: &[
                    wgpu::BindGroupEntry { binding: 0, resource: points.as_entire_binding() },
                    wgpu::BindGroupEntry {
                        binding: 1,
                        resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                            buffer: &values,
                            offset: 0,
                            size: std::num::NonZeroU64::new(chunk.len() as u64 * 4),
                        }),
                    },
                ],
            });
            let groups = (chunk.len() as u32).div_ceil(64);
            let across = groups.clamp(1, 1024);
            self.timer.compute(&self.gpu, "query", |pass| {
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, transfer.bind_group(), &[]);
                pass.set_bind_group(1, &shadow.bind_group, &[]);
                pass.set_bind_group(2, &group, &[]);
                pass.dispatch_workgroups(across, groups.div_ceil(across), 1);
            })?;
            results.extend(read_back::<f32>(&self.gpu, &values, chunk.len())?);
        }
        Ok(results)
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

/// `-FAR` of `shaders/common/field.wgsl`: a pixel that no dispatch has worked on.
const NOT_STARTED: f32 = -1e30;

/// Modules that every pipeline with a lookup starts from.
pub(crate) const COMMON: [&str; 3] = ["common/field.wgsl", "common/transfer.wgsl", "common/light.wgsl"];

/// Grid space is index space plus one, so that cell `c` interpolates the voxels `c - 1` and `c`.
fn grid_from_world(volume: &Volume) -> DAffine3 {
    DAffine3::from_translation(DVec3::ONE) * volume.index_from_world()
}

fn frame_uniform(volume: &Volume, scene: &Scene, first_row: u32, rows: u32) -> FrameUniform {
    let grid_from_world = grid_from_world(volume);
    let world_from_grid = grid_from_world.inverse().matrix3;
    let frame = scene.camera.frame();
    let corners = volume.corners_mm();
    let center = corners.iter().sum::<DVec3>() / 8.0;
    let spacing = volume.min_spacing_mm();
    // Rays start on a plane through the volume's centre: far eyes then cost no precision.
    let distance = (center - scene.camera.eye).dot(frame.forward).max(spacing);
    let plane_center = scene.camera.eye + distance * frame.forward;
    let f32s = |v: DVec3| v.as_vec3().to_array();
    let grid = |v: DVec3| f32s(grid_from_world.transform_vector3(v));
    let tan = (0.5 * scene.camera.fov_deg.to_radians()).tan();
    let aspect = f64::from(scene.width) / f64::from(scene.height);
    FrameUniform {
        plane_center: f32s(grid_from_world.transform_point3(plane_center)),
        plane_distance_mm: distance as f32,
        grid_forward: grid(frame.forward),
        step_mm: (scene.step * spacing) as f32,
        grid_right: grid(frame.right),
        ambient: scene.ambient as f32,
        grid_up: grid(frame.up),
        first_row,
        background: scene.background.map(|c| c as f32),
        rows,
        half_extent: [(aspect * tan) as f32, tan as f32],
        size: [scene.width, scene.height],
        world_x: f32s(world_from_grid.x_axis),
        shading_weight: if scene.shading == Shading::None { 0.0 } else { 1.0 },
        world_y: f32s(world_from_grid.y_axis),
        world_z: f32s(world_from_grid.z_axis),
        ..Zeroable::zeroed()
    }
}

/// Definitions of a shading.
fn shading_defs(shading: Shading) -> &'static [&'static str] {
    match shading {
        Shading::None => &[],
        Shading::Lambert => &["SHADING"],
        Shading::BlinnPhong => &["SHADING", "BLINN_PHONG"],
    }
}
