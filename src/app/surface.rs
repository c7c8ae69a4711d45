//! The window's surface, on a device that another thread draws with.
//!
//! eframe makes the surface anew as soon as the window has another size. wgpu does so only when the device is idle, and gives
//! up where the render thread submits meanwhile; the surface then keeps the old size, and what is painted for the new one
//! does not fit in. [`Surface`] sees that the window's own calls have failed, and lets eframe make the surface once more
//! while the render thread is held back. What goes on failing is said.

use crate::error::Error;
use crate::gpu::{Gpu, Sharing, Uncaptured};
use eframe::{egui, egui_wgpu::SurfaceConfig};

/// Frames in a row whose failure is nobody's business yet.
const MOST_FAILURES: u32 = 30;

/// Sees to it that the surface fits the window.
pub struct Surface {
    sharing: Sharing,
    adapter: String,
    failures: Failures,
}

/// Frames that have failed in a row.
#[derive(Default)]
struct Failures(u32);

/// What is to be done about a frame.
#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    Fine,
    /// Another one may do.
    Again,
    /// Another one, and a word.
    Say(String),
}

impl Failures {
    fn judge(&mut self, error: Option<Uncaptured>) -> Verdict {
        let Some(error) = error else {
            self.0 = 0;
            return Verdict::Fine;
        };
        self.0 = self.0.saturating_add(1);
        // Once, and not with every frame.
        if (error.out_of_memory && self.0 == 1) || self.0 == MOST_FAILURES {
            return Verdict::Say(error.why);
        }
        Verdict::Again
    }
}

impl Surface {
    /// Of a window on this device.
    pub fn of(gpu: &Gpu) -> Self {
        let (sharing, adapter) = (gpu.sharing.clone(), gpu.info.name.clone());
        Self { sharing, adapter, failures: Failures::default() }
    }

    /// Looks how the last frame went, before the next is painted: what there is to be said.
    pub fn before_frame(&mut self, context: &egui::Context, frame: &mut eframe::Frame) -> Option<Error> {
        let verdict = self.failures.judge(self.sharing.take_error());
        if verdict == Verdict::Fine {
            self.sharing.release();
            return None;
        }
        // What goes on failing is not mended by holding the render thread back.
        if self.failures.0 > MOST_FAILURES {
            self.sharing.release();
            return None;
        }
        tracing::info!("the window's surface is made anew");
        self.sharing.hold();
        if let Some(config) = frame.wgpu_surface_config() {
            frame.set_wgpu_surface_config(changed(config));
        }
        // Once more at least, to let the render thread go on.
        context.request_repaint();
        match verdict {
            Verdict::Say(why) => Some(Error::runtime("the graphics device failed", &self.adapter, why)),
            _ => None,
        }
    }
}

/// Of the same meaning to wgpu (2 is its default), but another one to egui, which makes the surface anew where it changes.
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
            for _ in 1..MOST_FAILURES {
                assert_eq!(failures.judge(failed(false)), Verdict::Again);
            }
            assert_eq!(failures.judge(None), Verdict::Fine);
        }
        let verdicts: Vec<Verdict> = (0..3 * MOST_FAILURES).map(|_| failures.judge(failed(false))).collect();
        let said = verdicts.iter().filter(|v| matches!(v, Verdict::Say(_))).count();
        assert_eq!(said, 1);
        assert_eq!(verdicts[MOST_FAILURES as usize - 1], Verdict::Say("it does not fit".into()));
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
