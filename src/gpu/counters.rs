//! Counters that shaders write for the host: loops that reach their iteration limit, and work. Every loop in WGSL has a
//! limit that follows from sizes, and a loop that reaches it is an error.

use crate::error::{Error, Result};
use wgpu::BufferUsages;

/// Counters of a device: `watched` of `shaders/field/watch.wgsl`.
#[derive(Debug)]
pub struct DeviceCounters {
    buffer: wgpu::Buffer,
}

/// Bytes of the counter of loops that reached their limit.
pub(super) const LOOP_COUNTER_BYTES: u64 = 4;
/// Number of kinds of work.
pub const WORK_KINDS: u32 = 5;
/// Words of the sums of work: low and high word of each kind.
pub const WORK_WORDS: u32 = 2 * WORK_KINDS;

/// Work of a pass as counts: `shaders/field/work.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Samples of the volume.
    pub samples: u64,
    /// Lookups of the light at a point.
    pub lookups: u64,
    /// Texture loads of all kinds.
    pub loads: u64,
    /// Cells that light rays pass through.
    pub cells: u64,
    /// Pieces of light rays with an integrated optical depth.
    pub pieces: u64,
}

impl DeviceCounters {
    /// Counters at 0.
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

    /// Binding of `watched` of `shaders/field/watch.wgsl`.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        self.buffer.as_entire_binding()
    }

    /// Copies the counter of loops to a staging buffer.
    pub(super) fn copy_to(&self, encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer, offset: u64) {
        encoder.copy_buffer_to_buffer(&self.buffer, 0, staging, offset, LOOP_COUNTER_BYTES);
    }

    /// Buffer of all counters.
    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Decodes the work from the words of all counters, and sets the work counters to 0.
    pub(super) fn take_work(&self, queue: &wgpu::Queue, counters: &[u32]) -> Work {
        queue.write_buffer(&self.buffer, LOOP_COUNTER_BYTES, &[0; 4 * WORK_WORDS as usize]);
        let sums = &counters[(LOOP_COUNTER_BYTES / 4) as usize..];
        let sum = |kind: usize| u64::from(sums[2 * kind]) | u64::from(sums[2 * kind + 1]) << 32;
        let [samples, lookups, loads, cells, pieces] = std::array::from_fn(sum);
        Work { samples, lookups, loads, cells, pieces }
    }

    /// Refuses a pass's result where loops reached their limit, and sets the counter of loops to 0.
    ///
    /// # Errors
    /// Some loops did: a fault of this program, or of a driver that computes beyond all rounding.
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
