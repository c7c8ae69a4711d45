//! Counters that shaders write for the host: loops that reach their iteration limit, and the amount of work. Every
//! loop in WGSL has a limit that follows from the sizes of its data; a loop that reaches its limit is an error.

use crate::error::{Error, Result};
use wgpu::BufferUsages;

/// Device buffer with counters of shader loops at their limit and of work: `watched` of `shaders/field/watch.wgsl`.
#[derive(Debug)]
pub struct DeviceCounters {
    buffer: wgpu::Buffer,
}

/// Bytes of the counter of shader loops that reached their iteration limit.
pub(super) const LOOP_COUNTER_BYTES: u64 = 4;
/// Number of kinds of shader work that are counted, such as volume samples and texture reads.
pub const WORK_KINDS: u32 = 5;
/// Number of 32-bit words of the work counters: a low and a high word for each kind of work.
pub const WORK_WORDS: u32 = 2 * WORK_KINDS;

/// Amount of work of compute passes, counted by the shaders (`shaders/field/work.wgsl`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Number of filtered samples of the volume that shaders took.
    pub samples: u64,
    /// Number of queries for the transmittance from the light at a point.
    pub lookups: u64,
    /// Number of texture reads of all kinds in shaders.
    pub loads: u64,
    /// Number of volume cells through which light rays were marched.
    pub cells: u64,
    /// Number of pieces of light rays whose optical depth was integrated.
    pub pieces: u64,
}

impl DeviceCounters {
    /// Creates the device counters, all with value 0.
    pub(super) fn new(device: &wgpu::Device) -> Self {
        Self {
            buffer: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("counters of loops and work"),
                size: LOOP_COUNTER_BYTES + 4 * u64::from(WORK_WORDS),
                usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
        }
    }

    /// Returns the binding of the device counters, `watched` of `shaders/field/watch.wgsl`.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        self.buffer.as_entire_binding()
    }

    /// Copies the count of shader loops that reached their limit to a staging buffer.
    pub(super) fn copy_to(&self, encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer, offset: u64) {
        encoder.copy_buffer_to_buffer(&self.buffer, 0, staging, offset, LOOP_COUNTER_BYTES);
    }

    /// Returns the device buffer of all counters.
    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Decodes the counts of work from the words of all counters, and resets the work counters to 0.
    pub(super) fn take_work(&self, queue: &wgpu::Queue, counters: &[u32]) -> Work {
        queue.write_buffer(&self.buffer, LOOP_COUNTER_BYTES, &[0; 4 * WORK_WORDS as usize]);
        let sums = &counters[(LOOP_COUNTER_BYTES / 4) as usize..];
        let sum = |kind: usize| u64::from(sums[2 * kind]) | u64::from(sums[2 * kind + 1]) << 32;
        let [samples, lookups, loads, cells, pieces] = std::array::from_fn(sum);
        Work { samples, lookups, loads, cells, pieces }
    }

    /// Rejects the result of a compute pass if shader loops reached their iteration limit, and resets the counter of
    /// these loops to 0.
    ///
    /// # Errors
    /// Some loops reached their limit, by a fault of this program or of a driver with far too large rounding errors.
    pub(super) fn check(&self, queue: &wgpu::Queue, adapter: &str, label: &str, overruns: u32) -> Result<()> {
        if overruns == 0 {
            return Ok(());
        }
        queue.write_buffer(&self.buffer, 0, &0u32.to_ne_bytes());
        let why = format!("{overruns} loops on {adapter} reached their iteration limit");
        Err(Error::runtime("cannot use the graphics device's result", label, why)
            .hint("please report the scene and the adapter; `--adapter` picks another one"))
    }
}
