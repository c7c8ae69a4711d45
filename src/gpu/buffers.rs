//! Creates device buffers from plain data, and reads them back to the host.

use super::Gpu;
use crate::error::{Error, Result};
use bytemuck::Pod;
use wgpu::BufferUsages;
use wgpu::util::DeviceExt;

/// Creates a device buffer of zeros with at least 16 bytes, since an empty buffer cannot be bound.
pub(super) fn buffer(device: &wgpu::Device, label: &str, bytes: u64, usage: BufferUsages) -> wgpu::Buffer {
    let (label, size) = (Some(label), bytes.max(16));
    device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
}

/// Creates a small device buffer that holds one value and can be bound as a uniform or as storage.
pub fn uniform_buffer<T: Pod>(gpu: &Gpu, label: &str, value: &T) -> wgpu::Buffer {
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(label),
        contents: bytemuck::bytes_of(value),
        usage: BufferUsages::UNIFORM | STORAGE,
    })
}

/// Usage flags of storage buffers that shaders read and write.
pub(super) const STORAGE: BufferUsages =
    BufferUsages::STORAGE.union(BufferUsages::COPY_SRC).union(BufferUsages::COPY_DST);

/// Constructors of storage buffers on the device, which return an error if the adapter cannot bind a buffer of the
/// size.
pub struct StorageBuffer;

impl StorageBuffer {
    /// Creates a storage buffer that holds `data`; an empty slice becomes 16 zero bytes.
    ///
    /// # Errors
    /// The adapter cannot bind a buffer of this size.
    pub fn from_slice<T: Pod>(gpu: &Gpu, label: &str, data: &[T]) -> Result<wgpu::Buffer> {
        if data.is_empty() {
            return Self::zeroed(gpu, label, 0);
        }
        gpu.check_storage(label, size_of_val(data) as u64)?;
        Ok(gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents: bytemuck::cast_slice(data),
            usage: STORAGE,
        }))
    }

    /// Creates a storage buffer of zeros, with at least 16 bytes.
    ///
    /// # Errors
    /// The adapter cannot bind a buffer of this size.
    pub fn zeroed(gpu: &Gpu, label: &str, bytes: u64) -> Result<wgpu::Buffer> {
        gpu.check_storage(label, bytes)?;
        Ok(buffer(&gpu.device, label, bytes, STORAGE))
    }
}

/// Copies the first `count` elements of a device buffer to the host, and waits until the device is done.
///
/// # Errors
/// The device is lost.
pub fn read_back<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
    let bytes = (count * size_of::<T>()) as u64;
    let copy = |encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer| {
        encoder.copy_buffer_to_buffer(buffer, 0, staging, 0, bytes);
    };
    copied(gpu, count, copy)
}

/// Copies `count` elements into a staging buffer with `copy`, waits until the device is done, and returns them.
pub(super) fn copied<T: Pod>(
    gpu: &Gpu,
    count: usize,
    copy: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer),
) -> Result<Vec<T>> {
    let staging = staging_buffer(gpu, (count * size_of::<T>()) as u64);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    copy(&mut encoder, &staging);
    map_staging(gpu, [&staging].into_iter(), gpu.submit([encoder.finish()]))?;
    let mut all = read_mapped(gpu, &staging)?;
    all.truncate(count);
    Ok(all)
}

/// Creates a staging buffer: data that a submission copies into it can be read by the host.
pub(super) fn staging_buffer(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    buffer(&gpu.device, "read back", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)
}

/// Waits for a submission to the device, and maps the staging buffers into which it copied data.
pub(super) fn map_staging<'a>(
    gpu: &Gpu,
    stagings: impl Iterator<Item = &'a wgpu::Buffer>,
    submission: wgpu::SubmissionIndex,
) -> Result<()> {
    let (send, receive) = std::sync::mpsc::channel();
    for staging in stagings {
        let send = send.clone();
        staging.map_async(wgpu::MapMode::Read, .., move |r| {
            let _ = send.send(r);
        });
    }
    drop(send);
    gpu.wait_for(submission)?;
    receive.iter().collect::<std::result::Result<(), _>>().map_err(|e| cannot_read(gpu, e.to_string()))
}

/// Returns the contents of a mapped staging buffer.
pub(super) fn read_mapped<T: Pod>(gpu: &Gpu, staging: &wgpu::Buffer) -> Result<Vec<T>> {
    let view = staging.get_mapped_range(..).map_err(|e| cannot_read(gpu, e.to_string()))?;
    let whole = view.len() / size_of::<T>() * size_of::<T>();
    Ok(bytemuck::pod_collect_to_vec(&view[..whole]))
}

fn cannot_read(gpu: &Gpu, why: String) -> Error {
    Error::runtime("cannot read from the graphics device", &gpu.info.name, why)
}
