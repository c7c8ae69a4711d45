//! Bind groups and their layouts, made from one list, so that neither can forget what the other has.

use super::Gpu;

/// What stands behind one `@binding`: the kind that the layout wants and the resource itself.
#[derive(Debug, Clone)]
pub struct Slot<'a> {
    ty: wgpu::BindingType,
    resource: wgpu::BindingResource<'a>,
}

fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

impl<'a> Slot<'a> {
    /// `var<uniform>`.
    pub fn uniform(uniform: &'a wgpu::Buffer) -> Self {
        let resource = uniform.as_entire_binding();
        Self { ty: buffer(wgpu::BufferBindingType::Uniform), resource }
    }

    /// `var<storage, read>`: a whole buffer or a part of one.
    pub fn read(resource: wgpu::BindingResource<'a>) -> Self {
        Self { ty: buffer(wgpu::BufferBindingType::Storage { read_only: true }), resource }
    }

    /// `var<storage, read_write>`: a whole buffer or a part of one.
    pub fn read_write(resource: wgpu::BindingResource<'a>) -> Self {
        Self { ty: buffer(wgpu::BufferBindingType::Storage { read_only: false }), resource }
    }

    /// `texture_2d` or `texture_3d` of `f32` (filterable or not) or `u32`.
    pub fn texture(
        view: &'a wgpu::TextureView,
        sample_type: wgpu::TextureSampleType,
        view_dimension: wgpu::TextureViewDimension,
    ) -> Self {
        let ty = wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
        Self { ty, resource: wgpu::BindingResource::TextureView(view) }
    }

    /// `texture_2d<u32>`.
    pub fn words(view: &'a wgpu::TextureView) -> Self {
        Self::texture(view, wgpu::TextureSampleType::Uint, wgpu::TextureViewDimension::D2)
    }

    /// `texture_2d<f32>`, loaded from and never filtered.
    pub fn floats(view: &'a wgpu::TextureView) -> Self {
        let sample_type = wgpu::TextureSampleType::Float { filterable: false };
        Self::texture(view, sample_type, wgpu::TextureViewDimension::D2)
    }

    /// `texture_storage_2d<format, write>`.
    pub fn store(view: &'a wgpu::TextureView, format: wgpu::TextureFormat) -> Self {
        Self::store_in(view, format, wgpu::TextureViewDimension::D2)
    }

    /// `texture_storage_2d<format, write>` or `texture_storage_3d<format, write>`.
    pub(super) fn store_in(
        view: &'a wgpu::TextureView,
        format: wgpu::TextureFormat,
        view_dimension: wgpu::TextureViewDimension,
    ) -> Self {
        let access = wgpu::StorageTextureAccess::WriteOnly;
        let ty = wgpu::BindingType::StorageTexture { access, format, view_dimension };
        Self { ty, resource: wgpu::BindingResource::TextureView(view) }
    }

    /// `sampler`; `filtering`: whether it is linear.
    pub fn sampler(sampler: &'a wgpu::Sampler, filtering: bool) -> Self {
        let ty = wgpu::BindingType::Sampler(match filtering {
            true => wgpu::SamplerBindingType::Filtering,
            false => wgpu::SamplerBindingType::NonFiltering,
        });
        Self { ty, resource: wgpu::BindingResource::Sampler(sampler) }
    }
}

/// A bind group with the layout that pipelines need to take it.
#[derive(Debug, Clone)]
pub struct Group {
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) group: wgpu::BindGroup,
    pub(super) kinds: Vec<wgpu::BindGroupLayoutEntry>,
}

impl Group {
    /// Of slots by their `@binding`. wgpu keeps equal layouts once, so that pipelines fit every group of one shape.
    pub fn new(gpu: &Gpu, label: &str, slots: &[(u32, Slot<'_>)]) -> Self {
        let kinds: Vec<_> = slots
            .iter()
            .map(|(binding, slot)| wgpu::BindGroupLayoutEntry {
                binding: *binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: slot.ty,
                count: None,
            })
            .collect();
        let entries: Vec<_> = slots
            .iter()
            .map(|(binding, slot)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: slot.resource.clone(),
            })
            .collect();
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(label),
            entries: &kinds,
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(label),
            layout: &layout,
            entries: &entries,
        });
        Self { layout, group, kinds }
    }
}
