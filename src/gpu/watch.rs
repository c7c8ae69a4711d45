//! What shaders count for the host: loops that reach their bound (every loop of WGSL has one that follows from sizes, and
//! none is cut in silence), and work.

use crate::error::{Error, Result};

/// Counts loops that have reached their bound, and work: `watched` of `shaders/field/watch.wgsl`.
#[derive(Debug)]
pub struct Watch {
    watched: wgpu::Buffer,
}

/// Bytes of the counter of loops.
pub(super) const WATCH_BYTES: u64 = 4;
/// Kinds of work that are counted.
pub const WORK_KINDS: u32 = 5;
/// Words of their sums, low and high of each.
pub const WORK_WORDS: u32 = 2 * WORK_KINDS;

/// What a pass did, counted and not timed: `shaders/field/work.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Samples of the volume by its filter.
    pub samples: u64,
    /// Questions for the light at a point.
    pub lookups: u64,
    /// Texture reads of all kinds.
    pub loads: u64,
    /// Cells that light rays were marched through.
    pub cells: u64,
    /// Pieces of light rays whose optical depth was integrated.
    pub pieces: u64,
}

impl Watch {
    /// Of one device.
    pub(super) fn new(device: &wgpu::Device) -> Self {
        // A new buffer is 0.
        let watched = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("loops that reached their bound, and work"),
            size: WATCH_BYTES + 4 * u64::from(WORK_WORDS),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { watched }
    }

    /// `watched` of `shaders/field/watch.wgsl`.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        self.watched.as_entire_binding()
    }

    /// Copies the counter behind what else a submission hands to the host.
    pub(super) fn copy_to(&self, encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer, offset: u64) {
        encoder.copy_buffer_to_buffer(&self.watched, 0, staging, offset, WATCH_BYTES);
    }

    /// The buffer of all counters.
    pub(super) fn counters(&self) -> &wgpu::Buffer {
        &self.watched
    }

    /// The work that the counters say, which count anew.
    pub(super) fn take_work(&self, queue: &wgpu::Queue, counters: &[u32]) -> Work {
        queue.write_buffer(&self.watched, WATCH_BYTES, &[0; 4 * WORK_WORDS as usize]);
        let sums = &counters[(WATCH_BYTES / 4) as usize..];
        let sum = |kind: usize| u64::from(sums[2 * kind]) | u64::from(sums[2 * kind + 1]) << 32;
        let [samples, lookups, loads, cells, pieces] = std::array::from_fn(sum);
        Work { samples, lookups, loads, cells, pieces }
    }

    /// Refuses what a pass has made where loops have reached their bound, and counts anew.
    ///
    /// # Errors
    /// Some have: a fault of this program, or of a driver that computes what no rounding explains.
    pub(super) fn check(&self, queue: &wgpu::Queue, adapter: &str, label: &str, overruns: u32) -> Result<()> {
        if overruns == 0 {
            return Ok(());
        }
        queue.write_buffer(&self.watched, 0, &0u32.to_ne_bytes());
        let why = format!("{overruns} loops on {adapter} did not end where they must");
        Err(Error::runtime("cannot use what the graphics device made", label, why)
            .hint("please report the scene and the adapter; `--adapter` picks another one"))
    }
}
