//! Pictures: rays cast band by band, into host memory here and into a window's textures in [`super::display`].

use super::display::Pace;
use super::{DeviceTransfer, LoadedVolume, Plan, Renderer, grid_from_world};
use crate::error::{Error, Result};
use crate::gpu::{Span, StorageBuffer, read_back, uniform_buffer};
use crate::scene::{Scene, Shading};
use crate::shadow::ShadowMap;
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use ndarray::Array3;

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

/// `-FAR` of `shaders/common/field.wgsl`: a pixel that no dispatch has worked on.
const NOT_STARTED: f32 = -1e30;

impl Renderer {
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
