//! wgpu surface of the viewer window, on a device that the render thread uses at the same time.
//!
//! eframe reconfigures the surface when the window is resized. wgpu does so only on an idle device and fails while
//! the render thread submits. The surface then keeps the old size and the frame does not fit. [`Surface`] detects the
//! failed calls and lets eframe reconfigure the surface again while the render thread is paused. Persistent failures
//! are reported.

use crate::error::Error;
use crate::gpu::{Gpu, Sharing, Uncaptured};
use eframe::{egui, egui_wgpu::SurfaceConfig};

/// Number of successive failed window frames after which the failure of the window's wgpu surface is reported.
const MAX_FAILURES: u32 = 30;

/// Handler that reconfigures the wgpu surface of the viewer window until the surface has the size of the window.
pub struct Surface {
    sharing: Sharing,
    adapter: String,
    failures: Failures,
}

/// Number of successive frames of the window that failed on the graphics device.
#[derive(Default)]
struct Failures(u32);

impl Failures {
    /// Counts a failed frame of the viewer window. Returns an error to report only once, not for every frame.
    fn count(&mut self, error: Uncaptured) -> Option<String> {
        self.0 = self.0.saturating_add(1);
        ((error.out_of_memory && self.0 == 1) || self.0 == MAX_FAILURES).then_some(error.why)
    }
}

impl Surface {
    /// Creates the handler of the window's wgpu surface on a graphics device.
    pub fn of(gpu: &Gpu) -> Self {
        let (sharing, adapter) = (gpu.sharing.clone(), gpu.info.name.clone());
        Self { sharing, adapter, failures: Failures::default() }
    }

    /// Checks whether the last frame of the window failed on the graphics device, before the next frame is drawn.
    /// Returns an error to report.
    pub fn before_frame(&mut self, context: &egui::Context, frame: &mut eframe::Frame) -> Option<Error> {
        let Some(error) = self.sharing.take_error() else {
            self.failures.0 = 0;
            self.sharing.release();
            return None;
        };
        let report = self.failures.count(error);
        // Pausing the render thread does not help against persistent failures.
        if self.failures.0 > MAX_FAILURES {
            self.sharing.release();
            return None;
        }
        tracing::info!("the window's surface is made anew");
        self.sharing.hold();
        if let Some(config) = frame.wgpu_surface_config() {
            frame.set_wgpu_surface_config(changed(config));
        }
        // At least one more frame, to resume the render thread.
        context.request_repaint();
        report.map(|why| Error::runtime("the graphics device failed", &self.adapter, why))
    }
}

/// Alters a wgpu surface configuration so that egui sees a difference and reconfigures the surface. wgpu treats both
/// alike, since 2 is its default latency.
fn changed(config: SurfaceConfig) -> SurfaceConfig {
    let latency = config.desired_maximum_frame_latency;
    SurfaceConfig { desired_maximum_frame_latency: if latency.is_none() { Some(2) } else { None }, ..config }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_that_stay_are_reported_once_and_missing_memory_at_once() {
        let failed = |out_of_memory| Uncaptured { why: "it does not fit".into(), out_of_memory };
        let mut failures = Failures::default();
        let reports: Vec<_> = (1..3 * MAX_FAILURES).map(|_| failures.count(failed(false))).collect();
        assert_eq!(reports.iter().flatten().count(), 1);
        assert_eq!(reports[MAX_FAILURES as usize - 1].as_deref(), Some("it does not fit"));
        failures.0 = 0;
        assert!(failures.count(failed(true)).is_some());
        assert_eq!(failures.count(failed(true)), None);
    }

    #[test]
    fn a_surface_is_made_anew_with_what_it_had() {
        let config = SurfaceConfig::HIGH_THROUGHPUT;
        assert_ne!(changed(config), config);
        assert_eq!(changed(changed(config)), config);
        assert_eq!(changed(config).present_mode, config.present_mode);
    }
}
