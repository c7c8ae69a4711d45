//! Bind-group layouts that every pipeline shares: group 0 the field, group 1 the shadow structure, group 2 the stage.

use crate::gpu::Gpu;

/// Layouts and the one sampler; made once a device.
pub struct Layouts {
    /// Group 0: `shaders/common/{field,transfer}.wgsl`.
    pub field: wgpu::BindGroupLayout,
    /// Group 1: light space and two textures of words that the method reads.
    pub shadow: wgpu::BindGroupLayout,
    /// Group 2 of the ray caster: frame, the picture, and the progress of one made in several dispatches.
    pub frame: wgpu::BindGroupLayout,
    /// Group 2 of queries: points and results.
    pub query: wgpu::BindGroupLayout,
    /// Group 2 of what is shown: band, the picture's band, and the texture on screen.
    pub display: wgpu::BindGroupLayout,
    /// Group 2 of the deep shadow map's build: nodes, counters, tile list.
    pub build: wgpu::BindGroupLayout,
    pub linear_clamp: wgpu::Sampler,
}

fn buffer(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}

const UNIFORM: wgpu::BufferBindingType = wgpu::BufferBindingType::Uniform;
const READ: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: true };
const READ_WRITE: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: false };

impl Layouts {
    /// `filterable`: whether the volume's texture is sampled by the hardware; `live`: whether light and frame are read as
    /// storage, see [`Renderer::live`](super::Renderer::live).
    pub fn new(gpu: &Gpu, filterable: bool, live: bool) -> Self {
        let moving = if live { READ } else { UNIFORM };
        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            gpu.device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let texture = |binding, sample_type, view_dimension| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false },
            count: None,
        };
        let flat = |binding, sample_type| texture(binding, sample_type, wgpu::TextureViewDimension::D2);
        let solid = |binding, sample_type| texture(binding, sample_type, wgpu::TextureViewDimension::D3);
        let float = wgpu::TextureSampleType::Float { filterable: false };
        let words = wgpu::TextureSampleType::Uint;
        let store = |binding, format| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format,
                view_dimension: wgpu::TextureViewDimension::D2,
            },
            count: None,
        };
        let sampler = wgpu::BindGroupLayoutEntry {
            binding: 2,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Sampler(if filterable {
                wgpu::SamplerBindingType::Filtering
            } else {
                wgpu::SamplerBindingType::NonFiltering
            }),
            count: None,
        };
        let filter = if filterable { wgpu::FilterMode::Linear } else { wgpu::FilterMode::Nearest };
        Self {
            field: layout(
                "field",
                &[
                    buffer(0, UNIFORM),
                    solid(1, wgpu::TextureSampleType::Float { filterable }),
                    sampler,
                    solid(3, words),
                    buffer(4, UNIFORM),
                    flat(5, float),
                    flat(6, words),
                ],
            ),
            shadow: layout("shadow", &[buffer(0, moving), flat(1, words), flat(2, words)]),
            frame: layout("frame", &[buffer(0, moving), buffer(1, READ_WRITE), buffer(2, READ_WRITE)]),
            query: layout("query", &[buffer(0, READ), buffer(1, READ_WRITE)]),
            display: layout(
                "display",
                &[buffer(0, moving), buffer(1, READ), store(2, wgpu::TextureFormat::Rgba8Unorm)],
            ),
            build: layout(
                "build",
                &[store(0, wgpu::TextureFormat::Rgba32Uint), buffer(1, READ_WRITE), buffer(2, READ)],
            ),
            linear_clamp: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("linear clamp"),
                mag_filter: filter,
                min_filter: filter,
                ..Default::default()
            }),
        }
    }
}
