//! Surface of the window, on a device that the render thread uses as well.
//!
//! eframe reconfigures the surface when the window is resized. wgpu does so only on an idle device and fails while the render
//! thread submits. The surface then keeps the old size and the frame does not fit. [`Surface`] detects the failed calls and
//! lets eframe reconfigure the surface again while the render thread is paused. Persistent failures are reported.

use crate::error::Error;
use crate::gpu::{Gpu, Sharing, Uncaptured};
use eframe::{egui, egui_wgpu::SurfaceConfig};

/// Number of failed frames in a row that is reported.
const MAX_FAILURES: u32 = 30;

/// Keeps the surface and the window the same size.
pub struct Surface {
    sharing: Sharing,
    adapter: String,
    failures: Failures,
}

/// Number of failed frames in a row.
#[derive(Default)]
struct Failures(u32);

/// Reaction to a frame.
#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    Fine,
    /// Try another frame.
    Again,
    /// Try another frame and report.
    Say(String),
}

impl Failures {
    fn judge(&mut self, error: Option<Uncaptured>) -> Verdict {
        let Some(error) = error else {
            self.0 = 0;
            return Verdict::Fine;
        };
        self.0 = self.0.saturating_add(1);
        // Report once, not with every frame.
        if (error.out_of_memory && self.0 == 1) || self.0 == MAX_FAILURES {
            return Verdict::Say(error.why);
        }
        Verdict::Again
    }
}

impl Surface {
    /// Creates the state for a device.
    pub fn of(gpu: &Gpu) -> Self {
        let (sharing, adapter) = (gpu.sharing.clone(), gpu.info.name.clone());
        Self { sharing, adapter, failures: Failures::default() }
    }

    /// Checks the last frame before the next one; returns an error to report.
    pub fn before_frame(&mut self, context: &egui::Context, frame: &mut eframe::Frame) -> Option<Error> {
        let verdict = self.failures.judge(self.sharing.take_error());
        if verdict == Verdict::Fine {
            self.sharing.release();
            return None;
        }
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
        match verdict {
            Verdict::Say(why) => Some(Error::runtime("the graphics device failed", &self.adapter, why)),
            _ => None,
        }
    }
}

/// Configuration that is equal for wgpu (2 is its default) but not for egui, which then reconfigures the surface.
fn changed(config: SurfaceConfig) -> SurfaceConfig {
    let latency = config.desired_maximum_frame_latency;
    SurfaceConfig { desired_maximum_frame_latency: if latency.is_none() { Some(2) } else { None }, ..config }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failed(out_of_memory: bool) -> Option<Uncaptured> {
        Some(Uncaptured { why: "it does not fit".into(), out_of_memory })
    }

    #[test]
    fn what_another_frame_mends_is_not_said_and_what_none_mends_is_said_once() {
        let mut failures = Failures::default();
        for _ in 0..3 {
            for _ in 1..MAX_FAILURES {
                assert_eq!(failures.judge(failed(false)), Verdict::Again);
            }
            assert_eq!(failures.judge(None), Verdict::Fine);
        }
        let verdicts: Vec<Verdict> = (0..3 * MAX_FAILURES).map(|_| failures.judge(failed(false))).collect();
        let said = verdicts.iter().filter(|v| matches!(v, Verdict::Say(_))).count();
        assert_eq!(said, 1);
        assert_eq!(verdicts[MAX_FAILURES as usize - 1], Verdict::Say("it does not fit".into()));
        failures.judge(None);
        assert!(matches!(failures.judge(failed(true)), Verdict::Say(_)), "memory is said at once");
        assert_eq!(failures.judge(failed(true)), Verdict::Again);
    }

    #[test]
    fn a_surface_is_made_anew_with_what_it_had() {
        let config = SurfaceConfig::HIGH_THROUGHPUT;
        assert_ne!(changed(config), config);
        assert_eq!(changed(changed(config)), config);
        assert_eq!(changed(config).present_mode, config.present_mode);
    }
}
