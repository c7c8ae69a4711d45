//! Work without a result that keeps a graphics card busy. Cards lower their clocks while they wait for the host: an H100
//! ran at 345 MHz instead of 1980 when timed passes kept it busy for 5 to 25 % of the time, and times were 4 times as long.

use super::Gpu;
use crate::error::{Error, Result};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Shortest time for which the device is kept busy.
const SHORTEST: Duration = Duration::from_millis(20);
/// Duration of one pass that is long enough; the iterations of shorter ones are doubled.
const PASS: Duration = Duration::from_millis(2);
/// Number of loop iterations of a thread in the first pass, and the largest number.
const FIRST_ITERATIONS: u32 = 1 << 14;
const MOST_ITERATIONS: u32 = 1 << 24;
/// Number of workgroups of a pass.
const WORKGROUPS: u32 = 256;
/// Shader of the pass. The store never happens, and keeps the loop.
const SHADER: &str = "
@group(0) @binding(0) var<storage, read_write> words: array<u32, 2>;
@compute @workgroup_size(64)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    let iterations = words[0];
    var x = f32(id.x);
    for (var i = 0u; i < iterations; i++) { x = fma(x, 0.999, 1.0); }
    if x < 0.0 { words[1] = 1u; }
}
";

/// Compute pass without a result, for a graphics card that would otherwise wait.
#[derive(Debug)]
pub struct Filler {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    words: wgpu::Buffer,
    iterations: AtomicU32,
}

impl Filler {
    /// Compiles the pass.
    pub fn new(gpu: &Gpu) -> Self {
        let label = Some("filler");
        let source = wgpu::ShaderSource::Wgsl(SHADER.into());
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: None,
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            cache: None,
        });
        let words = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label,
            size: 8,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: words.as_entire_binding() }],
        });
        Self { pipeline, group, words, iterations: AtomicU32::new(FIRST_ITERATIONS) }
    }

    /// Keeps the device busy for 20 ms, and until `meanwhile` has returned on another thread of the host. Returns the
    /// result of `meanwhile`.
    ///
    /// # Errors
    /// The device is lost, or the host cannot start a thread.
    ///
    /// # Panics
    /// `meanwhile` panics.
    pub fn keep_busy<T: Send>(&self, gpu: &Gpu, meanwhile: impl FnOnce() -> T + Send) -> Result<T> {
        let start = Instant::now();
        std::thread::scope(|scope| {
            let host = std::thread::Builder::new()
                .spawn_scoped(scope, meanwhile)
                .map_err(|e| Error::runtime("cannot time", "a thread of the host", e))?;
            while start.elapsed() < SHORTEST || !host.is_finished() {
                self.run(gpu)?;
            }
            Ok(host.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        })
    }

    /// Runs the pass once. A pass that was too short is longer the next time.
    fn run(&self, gpu: &Gpu) -> Result<()> {
        let iterations = self.iterations.load(Ordering::Relaxed);
        gpu.queue.write_buffer(&self.words, 0, &iterations.to_ne_bytes());
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(WORKGROUPS, 1, 1);
        drop(pass);
        let start = Instant::now();
        gpu.wait_for(gpu.submit([encoder.finish()]))?;
        if start.elapsed() < PASS {
            self.iterations.store((2 * iterations).min(MOST_ITERATIONS), Ordering::Relaxed);
        }
        Ok(())
    }
}
