//! Duration of compute passes, ms: by device timestamps where the adapter has them, otherwise by the wall clock.

use super::Gpu;
use super::buffers::{buffer, map_staging, read_mapped, staging_buffer};
use super::counters::LOOP_COUNTER_BYTES;
use crate::error::Result;
use std::sync::{Mutex, PoisonError};

/// Clock with which the duration of work on the device was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// Clock of the graphics device: timestamps before and after a compute pass.
    GpuTimestamps,
    /// Clock of the host: time from before the submission of a compute pass until the device is idle.
    Wall,
}

impl std::fmt::Display for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::GpuTimestamps => "gpu-timestamps",
            Self::Wall => "wall",
        })
    }
}

/// Duration of compute passes, measured by device timestamps and by the host clock.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Span {
    /// Duration of compute passes by device timestamps, ms; `None` if the adapter has none.
    pub gpu_ms: Option<f64>,
    /// Duration of compute passes by the host clock, from before the submission until the device is idle, ms.
    pub wall_ms: f64,
}

impl Span {
    /// Returns the sum of two durations of compute passes, for the device clock and for the host clock.
    #[must_use]
    pub fn plus(self, next: Self) -> Self {
        let gpu_ms = self.gpu_ms.zip(next.gpu_ms).map(|(a, b)| a + b);
        Self { gpu_ms, wall_ms: self.wall_ms + next.wall_ms }
    }

    /// Returns the duration of compute passes in ms, by device timestamps or, if there are none, by the host clock;
    /// and which clock it is.
    pub fn best(&self) -> (f64, Clock) {
        self.gpu_ms.map_or((self.wall_ms, Clock::Wall), |ms| (ms, Clock::GpuTimestamps))
    }
}

/// First words of a device buffer that the host reads after a pass, without a submission of their own.
#[derive(Debug, Clone, Copy)]
pub struct Read<'a> {
    /// Buffer on the device.
    pub buffer: &'a wgpu::Buffer,
    /// Number of 32-bit words to read.
    pub words: usize,
}

/// Words that a pass read for the host, one list for each [`Read`] request.
pub type Words = Vec<Vec<u32>>;

/// Compute pass whose commands are recorded and not yet submitted.
pub struct RecordedPass {
    commands: wgpu::CommandBuffer,
    results: Results,
}

/// Buffers into which the device writes the results of a recorded pass.
struct Results {
    label: &'static str,
    queries: Option<Queries>,
    staging: wgpu::Buffer,
    /// Number of 32-bit words that each [`Read`] request copies.
    words: Vec<usize>,
}

/// Query set for the start and end timestamps of a compute pass, and the buffer into which the device writes them.
struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

/// Timer of compute passes on the device.
pub struct PassTimer {
    /// Whether the adapter has timestamps.
    has_timestamps: bool,
    /// Query sets that no recorded pass uses.
    free: Mutex<Vec<Queries>>,
}

/// Size of two device timestamps, bytes.
const TICKS_BYTES: u64 = 16;
/// Number of bytes that the host reads after a compute pass: two timestamps (0 without any), and the number of shader
/// loops that reached their iteration limit.
const REPORT_BYTES: u64 = TICKS_BYTES + LOOP_COUNTER_BYTES;

impl PassTimer {
    /// Creates a timer of compute passes, with device timestamps where the adapter has them.
    pub fn new(gpu: &Gpu) -> Self {
        Self { has_timestamps: gpu.timestamp_period_ns.is_some(), free: Mutex::default() }
    }

    fn queries(&self, gpu: &Gpu) -> Queries {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop();
        free.unwrap_or_else(|| {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            });
            let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
            Queries { set, resolved: buffer(&gpu.device, "resolved timestamps", TICKS_BYTES, usage) }
        })
    }

    /// Records one compute pass with `record`. Its submission also copies its timestamps and the first words of the
    /// buffers in `reads`, so that reading them needs no submission of their own.
    pub fn record(
        &self,
        gpu: &Gpu,
        label: &'static str,
        record: impl FnOnce(&mut wgpu::ComputePass<'_>),
        reads: &[Read<'_>],
    ) -> RecordedPass {
        let queries = self.has_timestamps.then(|| self.queries(gpu));
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) });
        {
            let timestamp_writes = queries.as_ref().map(|q| wgpu::ComputePassTimestampWrites {
                query_set: &q.set,
                beginning_of_pass_write_index: Some(0),
                end_of_pass_write_index: Some(1),
            });
            let mut pass = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes });
            record(&mut pass);
        }
        let bytes = REPORT_BYTES + 4 * reads.iter().map(|read| read.words as u64).sum::<u64>();
        let staging = staging_buffer(gpu, bytes);
        if let Some(q) = queries.as_ref() {
            encoder.resolve_query_set(&q.set, 0..2, &q.resolved, 0);
            encoder.copy_buffer_to_buffer(&q.resolved, 0, &staging, 0, TICKS_BYTES);
        }
        gpu.counters.copy_to(&mut encoder, &staging, TICKS_BYTES);
        let mut end = REPORT_BYTES;
        for read in reads {
            encoder.copy_buffer_to_buffer(read.buffer, 0, &staging, end, 4 * read.words as u64);
            end += 4 * read.words as u64;
        }
        let words = reads.iter().map(|read| read.words).collect();
        RecordedPass { commands: encoder.finish(), results: Results { label, queries, staging, words } }
    }

    /// Submits recorded passes in one submission, and waits until they are done. Returns the duration of each, and the
    /// words that it read.
    ///
    /// The host's clock cannot separate passes of one submission: all but the last take their time by timestamps.
    ///
    /// # Errors
    /// The device is lost, or a loop reached its iteration limit (see [`DeviceCounters`](super::DeviceCounters)).
    pub fn submit(&self, gpu: &Gpu, passes: Vec<RecordedPass>) -> Result<Vec<(Span, Words)>> {
        let (commands, results): (Vec<_>, Vec<_>) =
            passes.into_iter().map(|pass| (pass.commands, pass.results)).unzip();
        let (start, submission) = gpu.submit_timed(commands);
        map_staging(gpu, results.iter().map(|r| &r.staging), submission)?;
        let mut wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let last = results.len().saturating_sub(1);
        let mut all = Vec::with_capacity(results.len());
        for (i, Results { label, queries, staging, words }) in results.into_iter().enumerate() {
            let report = read_mapped::<u32>(gpu, &staging)?;
            gpu.counters.check(&gpu.queue, &gpu.info.name, label, report[4])?;
            let gpu_ms = gpu.timestamp_period_ns.and_then(|period| span_ms(&report, period, wall_ms));
            let own_ms = if i == last { wall_ms } else { gpu_ms.unwrap_or(0.0).min(wall_ms) };
            wall_ms -= own_ms;
            let mut left = report[(REPORT_BYTES / 4) as usize..].iter().copied();
            let words = words.iter().map(|words| left.by_ref().take(*words).collect()).collect();
            all.push((Span { gpu_ms, wall_ms: own_ms }, words));
            self.free.lock().unwrap_or_else(PoisonError::into_inner).extend(queries);
        }
        Ok(all)
    }
}

/// Returns the time between the two timestamps at the start of a report, ms; `None` if the driver left them unwritten,
/// or if it is longer than the host waited.
fn span_ms(report: &[u32], period_ns: f32, wall_ms: f64) -> Option<f64> {
    let tick = |i: usize| u64::from(report[2 * i]) | u64::from(report[2 * i + 1]) << 32;
    let ms = tick(1).wrapping_sub(tick(0)) as f64 * f64::from(period_ns) * 1e-6;
    (ms > 0.0 && ms <= wall_ms * 1.5 + 1.0).then_some(ms)
}
