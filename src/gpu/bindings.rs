//! Bind groups of shader resources and their layouts, both made from one list of bindings.

use super::Gpu;

/// Shader resource for one `@binding`, with its type in the bind group layout.
#[derive(Debug, Clone)]
pub struct Slot<'a> {
    ty: wgpu::BindingType,
    resource: wgpu::BindingResource<'a>,
}

fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

impl<'a> Slot<'a> {
    /// Creates the binding of a `var<uniform>` buffer.
    pub fn uniform(uniform: &'a wgpu::Buffer) -> Self {
        let resource = uniform.as_entire_binding();
        Self { ty: buffer(wgpu::BufferBindingType::Uniform), resource }
    }

    /// Creates the binding of a `var<storage, read>` buffer: a whole buffer or a part of one.
    pub fn read(resource: wgpu::BindingResource<'a>) -> Self {
        Self { ty: buffer(wgpu::BufferBindingType::Storage { read_only: true }), resource }
    }

    /// Creates the binding of a `var<storage, read_write>` buffer: a whole buffer or a part of one.
    pub fn read_write(resource: wgpu::BindingResource<'a>) -> Self {
        Self { ty: buffer(wgpu::BufferBindingType::Storage { read_only: false }), resource }
    }

    /// Creates the binding of a `texture_2d` or `texture_3d` of `f32` (filterable or not) or `u32`.
    pub fn texture(
        view: &'a wgpu::TextureView,
        sample_type: wgpu::TextureSampleType,
        view_dimension: wgpu::TextureViewDimension,
    ) -> Self {
        let ty = wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
        Self { ty, resource: wgpu::BindingResource::TextureView(view) }
    }

    /// Creates the binding of a `texture_2d<u32>`.
    pub fn words(view: &'a wgpu::TextureView) -> Self {
        Self::texture(view, wgpu::TextureSampleType::Uint, wgpu::TextureViewDimension::D2)
    }

    /// Creates the binding of a `texture_2d<f32>` that shaders read without filtering.
    pub fn floats(view: &'a wgpu::TextureView) -> Self {
        let sample_type = wgpu::TextureSampleType::Float { filterable: false };
        Self::texture(view, sample_type, wgpu::TextureViewDimension::D2)
    }

    /// Creates the binding of a write-only `texture_storage_2d<format, write>`.
    pub fn store(view: &'a wgpu::TextureView, format: wgpu::TextureFormat) -> Self {
        Self::store_in(view, format, wgpu::TextureViewDimension::D2)
    }

    /// Creates the binding of a write-only `texture_storage_2d<format, write>` or `texture_storage_3d<format,
    /// write>`.
    pub(super) fn store_in(
        view: &'a wgpu::TextureView,
        format: wgpu::TextureFormat,
        view_dimension: wgpu::TextureViewDimension,
    ) -> Self {
        let access = wgpu::StorageTextureAccess::WriteOnly;
        let ty = wgpu::BindingType::StorageTexture { access, format, view_dimension };
        Self { ty, resource: wgpu::BindingResource::TextureView(view) }
    }

    /// Creates the binding of a texture `sampler`; `filtering` says whether it filters linearly.
    pub fn sampler(sampler: &'a wgpu::Sampler, filtering: bool) -> Self {
        let kind = match filtering {
            true => wgpu::SamplerBindingType::Filtering,
            false => wgpu::SamplerBindingType::NonFiltering,
        };
        Self { ty: wgpu::BindingType::Sampler(kind), resource: wgpu::BindingResource::Sampler(sampler) }
    }
}

/// Handle of a shader resource in a bind group. Handles of one resource compare equal.
#[derive(Debug, Clone, PartialEq)]
pub enum Resource {
    /// Bytes of a buffer, from an offset on.
    Buffer {
        /// Buffer on the device.
        buffer: wgpu::Buffer,
        /// First byte of the buffer that shaders access.
        offset: u64,
        /// Number of bytes that shaders access.
        size: u64,
    },
    /// Whole texture.
    Texture(wgpu::Texture),
    /// Texture sampler of [`clamp_sampler`](super::clamp_sampler).
    Sampler,
}

impl Resource {
    /// Returns the handle of a whole buffer.
    pub fn whole(buffer: &wgpu::Buffer) -> Self {
        Self::Buffer { buffer: buffer.clone(), offset: 0, size: buffer.size() }
    }

    /// Returns the handle of a bound resource. Texture arrays and other resources that no [`Slot`] creates are samplers
    /// here.
    fn of(bound: &wgpu::BindingResource<'_>) -> Self {
        match bound {
            wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size }) => {
                let size = size.map_or(buffer.size() - offset, u64::from);
                Self::Buffer { buffer: (*buffer).clone(), offset: *offset, size }
            }
            wgpu::BindingResource::TextureView(view) => Self::Texture(view.texture().clone()),
            _ => Self::Sampler,
        }
    }
}

/// Bind group of shader resources, together with its layout.
#[derive(Debug, Clone)]
pub struct Group {
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) group: wgpu::BindGroup,
    pub(super) kinds: Vec<wgpu::BindGroupLayoutEntry>,
    resources: Vec<Resource>,
}

impl Group {
    /// Creates a bind group of shader resources, each with its `@binding` number. Bind groups with equal layouts
    /// share one layout object in wgpu, so that a pipeline can use either of them.
    pub fn new(gpu: &Gpu, label: &str, slots: &[(u32, Slot<'_>)]) -> Self {
        let visibility = wgpu::ShaderStages::COMPUTE;
        let (kinds, entries): (Vec<_>, Vec<_>) = slots
            .iter()
            .map(|&(binding, Slot { ty, ref resource })| {
                let kind = wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
                (kind, wgpu::BindGroupEntry { binding, resource: resource.clone() })
            })
            .unzip();
        let label = Some(label);
        let descriptor = wgpu::BindGroupLayoutDescriptor { label, entries: &kinds };
        let layout = gpu.device.create_bind_group_layout(&descriptor);
        let descriptor = wgpu::BindGroupDescriptor { label, layout: &layout, entries: &entries };
        let group = gpu.device.create_bind_group(&descriptor);
        let resources = entries.iter().map(|entry| Resource::of(&entry.resource)).collect();
        Self { layout, group, kinds, resources }
    }

    /// Returns the resources of the bind group that shaders write.
    pub fn written(&self) -> impl Iterator<Item = &Resource> {
        use wgpu::{BindingType, BufferBindingType};
        let is_written = |entry: &wgpu::BindGroupLayoutEntry| match entry.ty {
            BindingType::Buffer { ty, .. } => ty == BufferBindingType::Storage { read_only: false },
            BindingType::StorageTexture { .. } => true,
            _ => false,
        };
        self.entries().filter(move |(entry, _)| is_written(entry)).map(|(_, resource)| resource)
    }

    /// Returns the resources of the bind group, each with its entry in the layout.
    pub fn entries(&self) -> impl ExactSizeIterator<Item = (&wgpu::BindGroupLayoutEntry, &Resource)> {
        self.kinds.iter().zip(&self.resources)
    }
}
