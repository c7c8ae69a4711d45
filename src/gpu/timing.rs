//! Duration of a compute pass, ms: by device timestamps where the adapter has them, otherwise by the wall clock.

use super::Gpu;
use super::buffers::{buffer, read_staging, staging_buffer};
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

/// Timer of compute passes on the device, one submission at a time.
pub struct PassTimer {
    /// Query set for the start and end timestamps of a compute pass, and the buffer into which the device writes
    /// them. One compute pass uses them at a time.
    queries: Option<Mutex<(wgpu::QuerySet, wgpu::Buffer)>>,
}

/// Size of two device timestamps, bytes.
const TICKS_BYTES: u64 = 16;
/// Number of bytes that the host reads after a compute pass: two timestamps (0 without any), and the number of shader
/// loops that reached their iteration limit.
const REPORT_BYTES: u64 = TICKS_BYTES + LOOP_COUNTER_BYTES;

impl PassTimer {
    /// Creates a timer of compute passes, with device timestamps where the adapter has them.
    pub fn new(gpu: &Gpu) -> Self {
        let queries = gpu.timestamp_period_ns.map(|_| {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            });
            let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
            let resolved = buffer(&gpu.device, "resolved timestamps", TICKS_BYTES, usage);
            Mutex::new((set, resolved))
        });
        Self { queries }
    }

    /// Records one compute pass with `record`, submits it, waits for it, and returns its duration and the first words
    /// of the buffers in `reads`.
    ///
    /// The measured submission also copies its timestamps and these words, so that reading them needs no second wait.
    ///
    /// # Errors
    /// The device is lost, or a loop reached its iteration limit (see [`DeviceCounters`](super::DeviceCounters)).
    pub fn compute(
        &self,
        gpu: &Gpu,
        label: &str,
        record: impl FnOnce(&mut wgpu::ComputePass<'_>),
        reads: &[Read<'_>],
    ) -> Result<(Span, Vec<Vec<u32>>)> {
        let queries = self.queries.as_ref().map(|q| q.lock().unwrap_or_else(PoisonError::into_inner));
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) });
        {
            let timestamp_writes = queries.as_ref().map(|q| wgpu::ComputePassTimestampWrites {
                query_set: &q.0,
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
            encoder.resolve_query_set(&q.0, 0..2, &q.1, 0);
            encoder.copy_buffer_to_buffer(&q.1, 0, &staging, 0, TICKS_BYTES);
        }
        gpu.counters.copy_to(&mut encoder, &staging, TICKS_BYTES);
        let mut end = REPORT_BYTES;
        for read in reads {
            encoder.copy_buffer_to_buffer(read.buffer, 0, &staging, end, 4 * read.words as u64);
            end += 4 * read.words as u64;
        }
        let (start, submission) = gpu.submit_timed([encoder.finish()]);
        let report = read_staging::<u32>(gpu, &staging, submission, bytes)?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        gpu.counters.check(&gpu.queue, &gpu.info.name, label, report[4])?;
        let tick = |i: usize| u64::from(report[2 * i]) | u64::from(report[2 * i + 1]) << 32;
        let gpu_ms = gpu.timestamp_period_ns.and_then(|period| {
            let ms = tick(1).wrapping_sub(tick(0)) as f64 * f64::from(period) * 1e-6;
            // Some drivers leave the query unwritten; a span longer than the wait is no measurement.
            (ms > 0.0 && ms <= wall_ms * 1.5 + 1.0).then_some(ms)
        });
        let mut words = report[(REPORT_BYTES / 4) as usize..].iter().copied();
        let reads = reads.iter().map(|read| words.by_ref().take(read.words).collect()).collect();
        Ok((Span { gpu_ms, wall_ms }, reads))
    }
}
