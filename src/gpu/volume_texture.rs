//! 3-D textures that passes or the host fill.

use super::{Gpu, Slot};
use crate::error::{Error, Result};
use bytemuck::Pod;
use std::ops::Range;

/// A 3-D texture that shaders read and the host writes, and besides is used so; its sides are not checked.
pub fn solid_texture(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    [width, height, depth_or_array_layers]: [u32; 3],
    besides: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST | besides,
        view_formats: &[],
    })
}

/// A 3-D texture: 32-bit floats are stored to by passes, fewer bits are copied to or written by the host.
pub struct VolumeTexture {
    view: wgpu::TextureView,
}

impl VolumeTexture {
    /// Of so many texels along each axis; 0 everywhere.
    ///
    /// # Errors
    /// More along an axis than the adapter holds, or a device out of memory.
    pub fn new(gpu: &Gpu, label: &str, format: wgpu::TextureFormat, sides: [u32; 3]) -> Result<Self> {
        let limit = gpu.device.limits().max_texture_dimension_3d;
        if let Some(side) = sides.iter().find(|side| **side > limit) {
            let why = format!("{side} texels along an axis, the adapter's 3-D textures end at {limit}");
            return Err(Error::runtime(format!("cannot allocate {label}"), &gpu.info.name, why));
        }
        let stored = match format {
            wgpu::TextureFormat::R32Float => wgpu::TextureUsages::STORAGE_BINDING,
            _ => wgpu::TextureUsages::empty(),
        };
        let texture = solid_texture(gpu, label, format, sides, stored);
        gpu.take_error()?;
        Ok(Self { view: texture.create_view(&Default::default()) })
    }

    /// `texture_storage_3d<format, write>`.
    pub fn store_slot(&self) -> Slot<'_> {
        Slot::store_in(&self.view, self.view.texture().format(), wgpu::TextureViewDimension::D3)
    }

    /// `texture_3d<f32>`, filtered by the hardware or loaded from alone.
    pub fn slot(&self, filterable: bool) -> Slot<'_> {
        let sample_type = wgpu::TextureSampleType::Float { filterable };
        Slot::texture(&self.view, sample_type, wgpu::TextureViewDimension::D3)
    }

    /// Copies layers from the beginning of a buffer, whose rows are `row_bytes` apart.
    pub fn copy_layers(&self, gpu: &Gpu, from: &wgpu::Buffer, row_bytes: u32, layers: Range<u32>) {
        let texture = self.view.texture();
        let rows_per_image = Some(texture.size().height);
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image };
        let to = wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d { x: 0, y: 0, z: layers.start },
            ..texture.as_image_copy()
        };
        let size = wgpu::Extent3d { depth_or_array_layers: layers.end - layers.start, ..texture.size() };
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let from = wgpu::TexelCopyBufferInfo { buffer: from, layout };
        encoder.copy_buffer_to_texture(from, to, size);
        gpu.submit([encoder.finish()]);
    }

    /// Writes a layer: a texel an entry, x fastest.
    pub fn write_layer<T: Pod>(&self, gpu: &Gpu, layer: u32, texels: &[T]) {
        let texture = self.view.texture();
        let size = wgpu::Extent3d { depth_or_array_layers: 1, ..texture.size() };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size.width * size_of::<T>() as u32),
            rows_per_image: None,
        };
        let origin = wgpu::Origin3d { x: 0, y: 0, z: layer };
        let to = wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() };
        gpu.queue.write_texture(to, bytemuck::cast_slice(texels), layout, size);
    }
}
