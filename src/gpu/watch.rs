//! Loops of shaders that reach their bound: every loop of WGSL has one that follows from sizes, and none is cut in silence.

use crate::error::{Error, Result};

/// Counts loops that have reached their bound: `overruns` of `shaders/field/watch.wgsl`.
#[derive(Debug)]
pub struct Watch {
    overruns: wgpu::Buffer,
}

/// Bytes of the counter.
pub(super) const WATCH_BYTES: u64 = 4;

impl Watch {
    /// Of one device.
    pub(super) fn new(device: &wgpu::Device) -> Self {
        // A new buffer is 0.
        let overruns = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("loops that reached their bound"),
            size: 16,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { overruns }
    }

    /// `overruns` of `shaders/field/watch.wgsl`.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        self.overruns.as_entire_binding()
    }

    /// Copies the counter behind what else a submission hands to the host.
    pub(super) fn copy_to(&self, encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer, offset: u64) {
        encoder.copy_buffer_to_buffer(&self.overruns, 0, staging, offset, WATCH_BYTES);
    }

    /// Refuses what a pass has made where loops have reached their bound, and counts anew.
    ///
    /// # Errors
    /// Some have: a fault of this program, or of a driver that computes what no rounding explains.
    pub(super) fn check(&self, queue: &wgpu::Queue, adapter: &str, label: &str, overruns: u32) -> Result<()> {
        if overruns == 0 {
            return Ok(());
        }
        queue.write_buffer(&self.overruns, 0, &0u32.to_ne_bytes());
        let why = format!("{overruns} loops on {adapter} did not end where they must");
        Err(Error::runtime("cannot use what the graphics device made", label, why)
            .hint("please report the scene and the adapter; `--adapter` picks another one"))
    }
}
