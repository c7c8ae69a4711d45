//! Device textures that the host writes or that compute passes store to.

use super::{Gpu, Slot};
use crate::error::Result;
use bytemuck::Pod;
use std::ops::Range;
use wgpu::{TextureDimension, TextureFormat, TextureUsages};

/// Creates a texture without mip levels, from which shaders and the host read and to which the host writes. `usage` adds
/// further texture usages. The size is not compared with the adapter's limits.
pub fn texture(
    gpu: &Gpu,
    label: &str,
    format: TextureFormat,
    dimension: TextureDimension,
    [width, height, depth_or_array_layers]: [u32; 3],
    usage: TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension,
        format,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST | TextureUsages::COPY_SRC | usage,
        view_formats: &[],
    })
}

/// Writes a box of texels into a texture, x fastest.
pub fn write_texels<T: Pod>(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    [x, y, z]: [u32; 3],
    [width, height, depth_or_array_layers]: [u32; 3],
    texels: &[T],
) {
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: texture.format().block_copy_size(None).map(|bytes| bytes * width),
        rows_per_image: Some(height),
    };
    let to = wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x, y, z }, ..texture.as_image_copy() };
    let size = wgpu::Extent3d { width, height, depth_or_array_layers };
    gpu.queue.write_texture(to, bytemuck::cast_slice(texels), layout, size);
}

/// Creates a 2-D texture that holds `texels` (row by row), from which shaders load.
///
/// # Errors
/// A side exceeds the adapter's limit on textures.
pub fn table_texture<T: Pod>(
    gpu: &Gpu,
    label: &str,
    format: TextureFormat,
    [width, height]: [u32; 2],
    texels: &[T],
) -> Result<wgpu::TextureView> {
    gpu.check_texture(label, [width, height])?;
    let sides = [gpu.texture_side(width), gpu.texture_side(height), 1];
    let table = texture(gpu, label, format, TextureDimension::D2, sides, TextureUsages::empty());
    write_texels(gpu, &table, [0; 3], [width, height, 1], texels);
    Ok(table.create_view(&Default::default()))
}

/// Creates a 2-D texture that one compute pass stores to and others load from. Texels to which nothing is stored are
/// 0.
///
/// # Errors
/// A side exceeds the adapter's limit on textures, or the device is out of memory.
pub fn store_texture(
    gpu: &Gpu,
    label: &str,
    format: TextureFormat,
    [width, height]: [u32; 2],
) -> Result<wgpu::TextureView> {
    gpu.check_texture(label, [width, height])?;
    let sides = [width, gpu.texture_side(height), 1];
    let stored = texture(gpu, label, format, TextureDimension::D2, sides, TextureUsages::STORAGE_BINDING);
    gpu.take_error()?;
    Ok(stored.create_view(&Default::default()))
}

/// Copies the first rows of a texture made by [`store_texture`] into another one of the same width, and waits for the
/// copy.
///
/// # Errors
/// The device is lost.
pub fn copy_rows(gpu: &Gpu, from: &wgpu::TextureView, to: &wgpu::TextureView, rows: u32) -> Result<()> {
    let size = wgpu::Extent3d { height: rows, ..from.texture().size() };
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_texture(from.texture().as_image_copy(), to.texture().as_image_copy(), size);
    gpu.wait_for(gpu.submit([encoder.finish()]))
}

/// Creates a texture sampler that clamps coordinates to the edge.
pub fn clamp_sampler(gpu: &Gpu, filter: wgpu::FilterMode) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("clamp"),
        mag_filter: filter,
        min_filter: filter,
        ..Default::default()
    })
}

/// Creates a 3-D texture from which shaders read and to which the host writes. The size is not compared with the
/// adapter's limits.
pub fn solid_texture(gpu: &Gpu, label: &str, format: TextureFormat, sides: [u32; 3]) -> wgpu::Texture {
    texture(gpu, label, format, TextureDimension::D3, sides, TextureUsages::empty())
}

/// 3-D texture on the device. Compute passes can store to it if its format is one 32-bit float; to textures of other
/// formats, the host writes or copies.
pub struct VolumeTexture {
    view: wgpu::TextureView,
}

impl VolumeTexture {
    /// Creates a 3-D texture of zeros.
    ///
    /// # Errors
    /// A side exceeds the adapter's limit on textures, or the device is out of memory.
    pub fn new(gpu: &Gpu, label: &str, format: TextureFormat, sides: [u32; 3]) -> Result<Self> {
        let limit = gpu.device.limits().max_texture_dimension_3d;
        if let Some(side) = sides.iter().find(|side| **side > limit) {
            let why = format!("{side} texels along an axis, the adapter's 3-D textures end at {limit}");
            return Err(gpu.cannot_allocate(label, why));
        }
        let usage = match format {
            TextureFormat::R32Float => TextureUsages::STORAGE_BINDING,
            _ => TextureUsages::empty(),
        };
        let texture = texture(gpu, label, format, TextureDimension::D3, sides, usage);
        gpu.take_error()?;
        Ok(Self { view: texture.create_view(&Default::default()) })
    }

    /// Returns the binding through which shaders write the 3-D texture, a `texture_storage_3d<format, write>`.
    pub fn store_slot(&self) -> Slot<'_> {
        Slot::store_in(&self.view, self.view.texture().format(), wgpu::TextureViewDimension::D3)
    }

    /// Returns the binding through which shaders read the 3-D texture, a `texture_3d<f32>` with or without hardware
    /// filtering.
    pub fn slot(&self, filterable: bool) -> Slot<'_> {
        let sample_type = wgpu::TextureSampleType::Float { filterable };
        Slot::texture(&self.view, sample_type, wgpu::TextureViewDimension::D3)
    }

    /// Copies data from the start of a buffer into layers of the 3-D texture. Rows in the buffer are `row_bytes`
    /// apart.
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
        encoder.copy_buffer_to_texture(wgpu::TexelCopyBufferInfo { buffer: from, layout }, to, size);
        gpu.submit([encoder.finish()]);
    }

    /// Writes one layer of the 3-D texture from host memory, x fastest.
    pub fn write_layer<T: Pod>(&self, gpu: &Gpu, layer: u32, texels: &[T]) {
        let texture = self.view.texture();
        write_texels(gpu, texture, [0, 0, layer], [texture.width(), texture.height(), 1], texels);
    }
}
