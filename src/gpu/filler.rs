//! Work without a result that keeps a graphics card busy. Cards lower their clocks while they wait for the host: an H100
//! ran at 345 MHz instead of 1980 when timed passes kept it busy for 5 to 25 % of the time, and times were 4 times as long.

use super::Gpu;
use crate::error::Result;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

/// Duration of the work of one call, ms.
const TARGET_MS: f64 = 20.0;
/// Number of loop iterations of a thread in the first call, and the largest number.
const FIRST_ITERATIONS: u32 = 1 << 14;
const MOST_ITERATIONS: u32 = 1 << 23;
/// Number of workgroups of the pass.
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

/// Compute pass without a result, which takes about 20 ms.
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

    /// Keeps the device busy while `meanwhile` runs on the host, and for about 20 ms. Returns the result of `meanwhile`
    /// when the device is done.
    ///
    /// # Errors
    /// The device is lost.
    pub fn keep_busy<T>(&self, gpu: &Gpu, meanwhile: impl FnOnce() -> T) -> Result<T> {
        let iterations = self.iterations.load(Ordering::Relaxed);
        gpu.queue.write_buffer(&self.words, 0, &iterations.to_ne_bytes());
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(WORKGROUPS, 1, 1);
        drop(pass);
        let start = Instant::now();
        let submission = gpu.submit([encoder.finish()]);
        let result = meanwhile();
        let host_ms = start.elapsed().as_secs_f64() * 1e3;
        gpu.wait_for(submission)?;
        let all_ms = start.elapsed().as_secs_f64() * 1e3;
        self.iterations.store(next_iterations(iterations, host_ms, all_ms), Ordering::Relaxed);
        Ok(result)
    }
}

/// Returns the number of iterations of the next call, from the time that the host worked beside this one and the time
/// until both were done. A device that was done before the host gets more work.
fn next_iterations(iterations: u32, host_ms: f64, all_ms: f64) -> u32 {
    let waited = all_ms > 1.05 * host_ms;
    let wanted_ms = TARGET_MS.max(1.5 * host_ms);
    let factor = if waited { (wanted_ms / all_ms).clamp(0.25, 4.0) } else { 2.0 };
    (f64::from(iterations) * factor).clamp(1.0, f64::from(MOST_ITERATIONS)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_busy_for_longer_than_the_host_and_not_much_longer() {
        for (host_ms, ms_per_iteration) in [(0.0, 1e-4), (30.0, 1e-5), (5.0, 2e-3)] {
            let mut iterations = FIRST_ITERATIONS;
            let device_ms = |iterations: u32| f64::from(iterations) * ms_per_iteration;
            for _ in 0..12 {
                iterations = next_iterations(iterations, host_ms, host_ms.max(device_ms(iterations)));
            }
            let wanted = TARGET_MS.max(1.5 * host_ms);
            assert!((device_ms(iterations) / wanted - 1.0).abs() < 0.05, "{host_ms}: {iterations}");
        }
    }
}
