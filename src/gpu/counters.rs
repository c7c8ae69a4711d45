//! Counters that shaders write for the host: loops that reach their iteration limit, and executed operations such as
//! texture reads. Every loop in WGSL has a limit that follows from the sizes of its data; a loop that reaches its
//! limit is an error.

use crate::error::{Error, Result};
use wgpu::BufferUsages;

/// Device buffer with the counters that shaders write, of loops at their iteration limit and of executed operations:
/// `watched` of `shaders/field/watch.wgsl`.
#[derive(Debug)]
pub struct DeviceCounters {
    buffer: wgpu::Buffer,
}

/// Size of the counter of shader loops that reached their iteration limit, bytes.
pub(super) const LOOP_COUNTER_BYTES: u64 = 4;
/// Number of kinds of shader operations that are counted, such as volume samples and texture reads.
pub const WORK_KINDS: u32 = 6;
/// Number of 32-bit words of the counters of shader operations: a low and a high word for each kind of operation.
pub const WORK_WORDS: u32 = 2 * WORK_KINDS;
/// Largest number of blocks of 8 x 4 threads whose longest ray marches are counted. Further blocks are left out.
pub const MAX_BLOCKS: u32 = 1 << 17;
/// Number of threads in a block, and so of lanes in a subgroup of a graphics card.
const BLOCK_LANES: u64 = 32;

/// Numbers of operations that shaders executed in compute passes, such as volume samples and texture reads, as
/// counted by `shaders/field/work.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Number of filtered samples of the volume that shaders took.
    pub samples: u64,
    /// Number of queries for the transmittance from the light at a point.
    pub lookups: u64,
    /// Number of texture reads of all kinds in shaders.
    pub loads: u64,
    /// Number of volume cells that the march along light rays traversed.
    pub cells: u64,
    /// Number of intervals on light rays whose optical depth shaders computed.
    pub pieces: u64,
    /// Number of steps of ray marches, through one cell, one sample or empty bricks each, in the counted blocks of 8 x
    /// 4 threads.
    pub steps: u64,
    /// Number of steps that the lanes of subgroups would take if each block of 8 x 4 threads took as many as its
    /// longest ray: 32 times the sum of the longest rays.
    pub lane_steps: u64,
    /// Largest number of steps of a ray.
    pub longest_ray: u64,
}

impl Work {
    /// Returns the sums of the work of two submissions; only `longest_ray` is the larger one.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            lookups: self.lookups + other.lookups,
            loads: self.loads + other.loads,
            cells: self.cells + other.cells,
            pieces: self.pieces + other.pieces,
            steps: self.steps + other.steps,
            lane_steps: self.lane_steps + other.lane_steps,
            longest_ray: self.longest_ray.max(other.longest_ray),
        }
    }

    /// Returns the share of lane steps that are idle because another ray of the block takes longer; `None` if no steps
    /// were counted. Real subgroups are idle more often, since their lanes also wait for each other in between.
    pub fn divergence(&self) -> Option<f64> {
        (self.lane_steps > 0).then(|| 1.0 - self.steps as f64 / self.lane_steps as f64)
    }
}

impl DeviceCounters {
    /// Creates the device buffer of the counters that shaders write, all with value 0.
    pub(super) fn new(device: &wgpu::Device) -> Self {
        Self {
            buffer: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("counters of loops and work"),
                size: LOOP_COUNTER_BYTES + 4 * u64::from(WORK_WORDS + MAX_BLOCKS),
                usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
        }
    }

    /// Returns the binding of the counters that shaders write, `watched` of `shaders/field/watch.wgsl`.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        self.buffer.as_entire_binding()
    }

    /// Copies the number of shader loops that reached their iteration limit to a staging buffer, for the host.
    pub(super) fn copy_to(&self, encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer, offset: u64) {
        encoder.copy_buffer_to_buffer(&self.buffer, 0, staging, offset, LOOP_COUNTER_BYTES);
    }

    /// Returns the device buffer of all counters that shaders write.
    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Decodes the numbers of operations that shaders executed from the words of the counter buffer, and resets these
    /// counters to 0.
    pub(super) fn take_work(&self, queue: &wgpu::Queue, counters: &[u32]) -> Work {
        let zeros = vec![0; 4 * (WORK_WORDS + MAX_BLOCKS) as usize];
        queue.write_buffer(&self.buffer, LOOP_COUNTER_BYTES, &zeros);
        let (sums, longest) = counters[(LOOP_COUNTER_BYTES / 4) as usize..].split_at(WORK_WORDS as usize);
        let sum = |kind: usize| u64::from(sums[2 * kind]) | u64::from(sums[2 * kind + 1]) << 32;
        let [samples, lookups, loads, cells, pieces, steps] = std::array::from_fn(sum);
        let lane_steps = BLOCK_LANES * longest.iter().map(|steps| u64::from(*steps)).sum::<u64>();
        let longest_ray = longest.iter().max().map_or(0, |steps| u64::from(*steps));
        Work { samples, lookups, loads, cells, pieces, steps, lane_steps, longest_ray }
    }

    /// Returns an error if shader loops of a compute pass reached their iteration limit, and resets the counter of
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
