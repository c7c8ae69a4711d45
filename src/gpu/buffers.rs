//! Buffers from plain data, and reading them back.

use super::Gpu;
use crate::error::{Error, Result};
use bytemuck::Pod;
use wgpu::util::DeviceExt;

/// A small buffer holding `value`, bound as uniform or read as storage.
pub fn uniform_buffer<T: Pod>(gpu: &Gpu, label: &str, value: &T) -> wgpu::Buffer {
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(label),
        contents: bytemuck::bytes_of(value),
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
    })
}

/// A 2-D texture of `texels` (row by row) that shaders load from.
///
/// # Errors
/// A side that the adapter cannot hold.
pub fn table_texture<T: Pod>(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    [width, height]: [u32; 2],
    texels: &[T],
) -> Result<wgpu::TextureView> {
    gpu.check_texture(label, [width, height])?;
    let [padded_width, padded_height] = [width, height].map(|side| gpu.texture_side(side));
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width: padded_width, height: padded_height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let row_bytes = width * size_of::<T>() as u32;
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: None };
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    gpu.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(texels), layout, size);
    Ok(texture.create_view(&Default::default()))
}

/// A 2-D texture that one pass stores to and others load from; cleared, and so 0 where nothing is stored.
///
/// # Errors
/// A side that the adapter cannot hold, or a device out of memory.
pub fn store_texture(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    [width, height]: [u32; 2],
) -> Result<wgpu::TextureView> {
    gpu.check_texture(label, [width, height])?;
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height: gpu.texture_side(height), depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    gpu.take_error()?;
    Ok(texture.create_view(&Default::default()))
}

/// Copies the first rows of a [`store_texture`] into another that is as wide, and waits for it.
///
/// # Errors
/// A lost device.
pub fn copy_rows(gpu: &Gpu, from: &wgpu::TextureView, to: &wgpu::TextureView, rows: u32) -> Result<()> {
    let size = wgpu::Extent3d { height: rows, ..from.texture().size() };
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_texture(from.texture().as_image_copy(), to.texture().as_image_copy(), size);
    gpu.wait_for(gpu.submit([encoder.finish()]))
}

/// A sampler that goes on at the edges.
pub fn clamp_sampler(gpu: &Gpu, filter: wgpu::FilterMode) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("clamp"),
        mag_filter: filter,
        min_filter: filter,
        ..Default::default()
    })
}

/// Storage buffers, refused where the adapter cannot bind them.
pub struct StorageBuffer;

impl StorageBuffer {
    /// Holding `data`; an empty slice becomes 16 zero bytes, since nothing empty can be bound.
    ///
    /// # Errors
    /// More bytes than the adapter can bind.
    pub fn from_slice<T: Pod>(gpu: &Gpu, label: &str, data: &[T]) -> Result<wgpu::Buffer> {
        gpu.check_storage(label, size_of_val(data) as u64)?;
        let bytes: &[u8] = bytemuck::cast_slice(data);
        Ok(gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents: if bytes.is_empty() { &[0; 16] } else { bytes },
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        }))
    }

    /// Zeroed, of `bytes` (at least 16).
    ///
    /// # Errors
    /// More bytes than the adapter can bind.
    pub fn zeroed(gpu: &Gpu, label: &str, bytes: u64) -> Result<wgpu::Buffer> {
        gpu.check_storage(label, bytes)?;
        Ok(gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.max(16),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }))
    }
}

/// Copies the first `count` elements of a buffer to the host; waits for the device.
///
/// # Errors
/// A lost device.
pub fn read_back<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
    let bytes = (count * size_of::<T>()) as u64;
    let staging = staging_buffer(gpu, bytes);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
    read_staging(gpu, &staging, gpu.submit([encoder.finish()]), bytes)
}

/// What a submission copies into so that the host can read it.
pub(super) fn staging_buffer(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: bytes.max(16),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Waits for a submission and reads what it has copied to a staging buffer.
pub(super) fn read_staging<T: Pod>(
    gpu: &Gpu,
    staging: &wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    bytes: u64,
) -> Result<Vec<T>> {
    let (send, receive) = std::sync::mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |r| {
        let _ = send.send(r);
    });
    gpu.wait_for(submission)?;
    let failed = |why: String| Error::runtime("cannot read from the graphics device", &gpu.info.name, why);
    receive.recv().map_err(|e| failed(e.to_string()))?.map_err(|e| failed(e.to_string()))?;
    let view = staging.get_mapped_range(..bytes).map_err(|e| failed(e.to_string()))?;
    Ok(bytemuck::pod_collect_to_vec(&view))
}
