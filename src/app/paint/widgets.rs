//! Widgets painted with a shader of our own, for software adapters.
//!
//! egui's own shader filters its texture in one of two ways, by the sampler or texel by texel, as a uniform says. llvmpipe
//! takes both sides of a branch, and the second one more than doubles what a frame of the interface costs: 33 instead of
//! 19 ms for a window of 1220 x 950 on two cores. So [`Widgets`] turns what egui is about to paint into triangles itself
//! and hands them back as callbacks. Where it cannot (a texture that is not there yet) egui paints as ever.

use eframe::egui::emath::TSTransform;
use eframe::egui::{self, ClippedPrimitive, FullOutput, PaintCallbackInfo, Rect, Shape, TextureId};
use eframe::egui::{TextureFilter, epaint};
use eframe::egui_wgpu::{Callback, CallbackResources, CallbackTrait, RenderState, ScreenDescriptor};
use eframe::wgpu;
use epaint::{ClippedShape, Primitive};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;

const SHADER: &str = include_str!("../../../shaders/app/widgets.wgsl");

/// As egui blends: what is in the window stays as opaque as it was.
const BLEND: wgpu::BlendState = wgpu::BlendState {
    color: wgpu::BlendComponent::OVER,
    alpha: wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::OneMinusDstAlpha,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    },
};

/// A corner of a triangle: where in the window, 0 to 1, where in the texture, and its colour.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Corner {
    at: [f32; 2],
    uv: [f32; 2],
    color: [u8; 4],
}

/// All triangles of one frame.
#[derive(Default)]
struct Triangles {
    corners: Vec<Corner>,
    indices: Vec<u32>,
}

/// Some triangles of one texture inside one clip rectangle.
struct Part {
    frame: Arc<Triangles>,
    indices: Range<u32>,
    group: wgpu::BindGroup,
    pipeline: wgpu::RenderPipeline,
}

/// What stays in egui's renderer from frame to frame.
#[derive(Default)]
struct Uploaded {
    frame: Arc<Triangles>,
    corners: Option<wgpu::Buffer>,
    indices: Option<wgpu::Buffer>,
}

/// Paints egui's output; see the module's documentation.
pub struct Widgets {
    state: RenderState,
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    groups: HashMap<TextureId, (wgpu::Texture, wgpu::BindGroup)>,
    /// Textures that this frame, by its number, replaces: a frame may have several passes, and paints after the last.
    replaced: (u64, HashSet<TextureId>),
}

impl Widgets {
    /// For a software adapter, and a window whose colours are not encoded again; `None` elsewhere.
    pub fn for_software(state: &RenderState) -> Option<Self> {
        let software = state.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        (software && !state.target_format.is_srgb()).then(|| Self::new(state))
    }

    fn new(state: &RenderState) -> Self {
        let device = &state.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("widgets"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        let texture = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("widgets"),
            entries: &[
                entry(0, texture),
                entry(1, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
            ],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("widgets"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("widgets"),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<Corner>() as u64,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x2, 1 => Float32x2, 2 => Unorm8x4],
                })],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("shaded"),
                compilation_options: Default::default(),
                targets: &[Some(wgpu::ColorTargetState {
                    format: state.target_format,
                    blend: Some(BLEND),
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: None,
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("widgets"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Self {
            state: state.clone(),
            pipeline,
            layout,
            sampler,
            groups: HashMap::new(),
            replaced: Default::default(),
        }
    }

    /// Looks up the textures that are there and stay as they are in this frame.
    fn update_groups(&mut self, frame: u64, output: &FullOutput, primitives: &[ClippedPrimitive]) {
        // A new texture in place of the old comes only when this frame is painted.
        let whole =
            output.textures_delta.set.iter().filter(|(_, deltas)| deltas.iter().any(|d| d.pos.is_none()));
        if self.replaced.0 != frame {
            self.replaced = (frame, HashSet::new());
        }
        self.replaced.1.extend(whole.map(|(id, _)| *id));
        let renderer = self.state.renderer.read();
        self.groups.retain(|id, (texture, _)| {
            renderer.texture(id).is_some_and(|t| t.texture.as_ref() == Some(texture))
        });
        for primitive in primitives {
            let Primitive::Mesh(mesh) = &primitive.primitive else { continue };
            let id = mesh.texture_id;
            if self.replaced.1.contains(&id) {
                self.groups.remove(&id);
                continue;
            }
            if self.groups.contains_key(&id) {
                continue;
            }
            let Some(known) = renderer.texture(&id) else { continue };
            let linear = |o: &egui::TextureOptions| {
                (o.magnification, o.minification) == (TextureFilter::Linear, TextureFilter::Linear)
                    && o.wrap_mode == egui::TextureWrapMode::ClampToEdge
            };
            let (Some(texture), true) = (&known.texture, known.options.as_ref().is_some_and(linear)) else {
                continue;
            };
            let view = texture.create_view(&Default::default());
            let group = self.state.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("widgets"),
                layout: &self.layout,
                entries: &[
                    wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                    wgpu::BindGroupEntry {
                        binding: 1,
                        resource: wgpu::BindingResource::Sampler(&self.sampler),
                    },
                ],
            });
            self.groups.insert(id, (texture.clone(), group));
        }
    }

    /// The same picture by callbacks.
    fn replace(&mut self, output: &mut FullOutput, primitives: Vec<ClippedPrimitive>, window: Rect) {
        let mut triangles = Triangles::default();
        let mut parts = Vec::with_capacity(primitives.len());
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            let mesh = match primitive {
                Primitive::Callback(callback) => {
                    parts.push((clip_rect, Err(Shape::Callback(callback))));
                    continue;
                }
                Primitive::Mesh(mesh) => mesh,
            };
            let Some((_, group)) = self.groups.get(&mesh.texture_id) else {
                parts.push((clip_rect, Err(Shape::from(mesh))));
                continue;
            };
            let first = triangles.corners.len() as u32;
            let start = triangles.indices.len() as u32;
            triangles.corners.extend(mesh.vertices.iter().map(|v| {
                let at = (v.pos - window.min) / window.size();
                Corner { at: at.into(), uv: v.uv.into(), color: v.color.to_array() }
            }));
            triangles.indices.extend(mesh.indices.iter().map(|i| first + i));
            parts.push((clip_rect, Ok((start..triangles.indices.len() as u32, group.clone()))));
        }
        let frame = Arc::new(triangles);
        let shape = |(clip_rect, part): (Rect, Result<(Range<u32>, wgpu::BindGroup), Shape>)| {
            let shape = part.map_or_else(
                |shape| shape,
                |(indices, group)| {
                    let (frame, pipeline) = (Arc::clone(&frame), self.pipeline.clone());
                    let part = Part { frame, indices, group, pipeline };
                    Shape::Callback(Callback::new_paint_callback(window, part))
                },
            );
            ClippedShape { clip_rect, shape, transform_after_tessellation: TSTransform::IDENTITY }
        };
        output.shapes = parts.into_iter().map(shape).collect();
    }
}

impl egui::Plugin for Widgets {
    fn debug_name(&self) -> &'static str {
        "widgets on a software adapter"
    }

    fn output_hook(&mut self, context: &egui::Context, output: &mut FullOutput) {
        let window = context.content_rect();
        if !window.is_positive() {
            return;
        }
        let primitives = context.tessellate(std::mem::take(&mut output.shapes), output.pixels_per_point);
        self.update_groups(context.cumulative_frame_nr(), output, &primitives);
        self.replace(output, primitives, window);
    }
}

impl Uploaded {
    /// Puts the triangles into buffers that are large enough.
    fn upload(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, frame: &Arc<Triangles>) {
        let put = |buffer: &mut Option<wgpu::Buffer>, bytes: &[u8], usage| {
            let size = (bytes.len() as u64).max(4).next_power_of_two();
            let fits = buffer.take().filter(|b| b.size() >= size);
            let made = fits.unwrap_or_else(|| {
                device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("widgets"),
                    size,
                    usage: usage | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            });
            queue.write_buffer(&made, 0, bytes);
            *buffer = Some(made);
        };
        put(&mut self.corners, bytemuck::cast_slice(&frame.corners), wgpu::BufferUsages::VERTEX);
        put(&mut self.indices, bytemuck::cast_slice(&frame.indices), wgpu::BufferUsages::INDEX);
        self.frame = Arc::clone(frame);
    }
}

impl CallbackTrait for Part {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _screen: &ScreenDescriptor,
        _encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        let uploaded = resources.entry::<Uploaded>().or_insert_with(Uploaded::default);
        if !Arc::ptr_eq(&uploaded.frame, &self.frame) {
            uploaded.upload(device, queue, &self.frame);
        }
        Vec::new()
    }

    fn paint(
        &self,
        _info: PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        resources: &CallbackResources,
    ) {
        let Some(uploaded) = resources.get::<Uploaded>() else { return };
        let (Some(corners), Some(indices)) = (&uploaded.corners, &uploaded.indices) else { return };
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_vertex_buffer(0, corners.slice(..));
        pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(self.indices.clone(), 0, 0..1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{Gpu, read_back};
    use eframe::egui::{Color32, Context, RawInput, pos2, vec2};
    use eframe::egui_wgpu::{RendererOptions, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};

    const SIDE: u32 = 256;

    /// What the window shows in the end, and how many of its shapes are callbacks. As long as four frames of egui by hand
    /// take: they are one script.
    fn picture(state: &RenderState, with: Option<Widgets>) -> (Vec<u8>, usize, usize) {
        let context = Context::default();
        with.into_iter().for_each(|widgets| context.add_plugin(widgets));
        let (device, queue) = (&state.device, &state.queue);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: state.target_format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&Default::default());
        let screen = ScreenDescriptor { size_in_pixels: [SIDE, SIDE], pixels_per_point: 1.0 };
        let mut text = "a text that is typed".to_owned();
        let mut counts = (0, 0);
        // The texture of glyphs is there from the second frame on; new glyphs come in the third.
        for frame in 0..4 {
            let input = RawInput {
                screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), vec2(SIDE as f32, SIDE as f32))),
                ..Default::default()
            };
            let mut output = context.run_ui(input, |ui| {
                ui.label(if frame < 2 { "Shadows" } else { "Transmittance ≤ 1, ½ × 37 °" });
                ui.add(egui::ProgressBar::new(0.4).text("loading"));
                ui.text_edit_singleline(&mut text);
                egui::ScrollArea::vertical().max_height(60.0).show(ui, |ui| {
                    (0..9).for_each(|i| _ = ui.button(format!("button {i}")));
                });
                ui.painter().circle_filled(
                    pos2(200.0, 180.0),
                    30.0,
                    Color32::from_rgba_unmultiplied(200, 80, 20, 90),
                );
            });
            let callbacks = |s: &&ClippedShape| matches!(s.shape, Shape::Callback(_));
            counts = (output.shapes.iter().filter(callbacks).count(), output.shapes.len());
            let mut renderer = state.renderer.write();
            for (id, deltas) in &output.textures_delta.set {
                deltas.iter().for_each(|delta| renderer.update_texture(device, queue, *id, delta));
            }
            output.textures_delta.clear();
            let jobs = context.tessellate(output.shapes, output.pixels_per_point);
            let mut encoder = device.create_command_encoder(&Default::default());
            renderer.update_buffers(device, queue, &mut encoder, &jobs, &screen);
            let attachment = wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            };
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(attachment)],
                ..Default::default()
            });
            renderer.render(&mut pass.forget_lifetime(), &jobs, &screen);
            queue.submit([encoder.finish()]);
        }
        let gpu = Gpu::from_parts(&state.adapter, device.clone(), queue.clone());
        let bytes = u64::from(SIDE * SIDE * 4);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes,
            usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(SIDE * 4),
                    rows_per_image: None,
                },
            },
            texture.size(),
        );
        queue.submit([encoder.finish()]);
        (read_back::<u8>(&gpu, &buffer, bytes as usize).unwrap(), counts.0, counts.1)
    }

    #[test]
    fn widgets_look_as_egui_paints_them() {
        let setup = WgpuSetupCreateNew {
            device_descriptor: Arc::new(Gpu::device_descriptor),
            ..WgpuSetupCreateNew::without_display_handle()
        };
        let config = WgpuConfiguration { wgpu_setup: WgpuSetup::CreateNew(setup), ..Default::default() };
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let state =
            || pollster::block_on(RenderState::create(&config, &instance, None, RendererOptions::default()));
        if !crate::common::has_adapter() {
            return;
        }
        let (one, other) = (state().unwrap(), state().unwrap());
        let (theirs, callbacks, _) = picture(&one, None);
        assert_eq!(callbacks, 0);
        let (ours, callbacks, shapes) = picture(&other, Some(Widgets::new(&other)));
        assert!(callbacks > 3 && callbacks == shapes, "all is painted here: {callbacks} of {shapes}");
        let off = ours.iter().zip(&theirs).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        // Sampling may round differently, once in each of the layers that are blended here.
        assert!(off <= 2, "{off} codes");
        let lit = theirs.chunks(4).filter(|p| p[..3] != [0, 0, 0]).count();
        assert!(lit > 3000, "there is something to see: {lit} pixels");
    }
}
