//! Exact picture on its own thread, coarse first.

use crate::engine::mailbox::Wake;
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::measure::error_map::{ExactView, Quantity};
use crate::scene::Scene;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Successive pixel sizes of the light's heat map, view pixels.
const LIGHT_DIVISORS: [f64; 5] = [16.0, 8.0, 4.0, 2.0, 1.0];
/// Successive pixel sizes of the picture's heat map, which takes a hundred times as long.
const PICTURE_DIVISORS: [f64; 6] = [24.0, 12.0, 6.0, 3.0, 2.0, 1.0];

/// Inputs of the exact picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    pub tf: Arc<TransferFunction>,
    pub scene: Scene,
    pub quantity: Quantity,
}

/// Running computation; dropping it cancels the thread.
pub struct Computing {
    views: Receiver<ExactView>,
    cancelled: Arc<AtomicBool>,
}

impl Drop for Computing {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

impl Computing {
    /// Starts the thread; `wake` is called after each resolution.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start(
        (volume, strands): (Arc<Volume>, Option<Arc<VoxelisedStrands>>),
        what: Question,
        wake: Wake,
    ) -> Result<Self> {
        let (send, views) = channel();
        let cancelled = Arc::new(AtomicBool::new(false));
        let is_cancelled = Arc::clone(&cancelled);
        // One core stays free for the interface.
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get().saturating_sub(1).max(1));
        let failed = |why: String| Error::runtime("cannot compute the exact picture", "window", why);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| failed(e.to_string()))?;
        let work = move || {
            let strands = strands.filter(|_| what.scene.shading.is_of_strands());
            // Without the memory for directions the picture itself could not be drawn.
            let directions = strands.and_then(|strands| strands.directions().ok());
            let field = ExactField::new(&volume, &what.tf).with_directions(directions);
            let divisors: &[f64] = match what.quantity {
                Quantity::Light => &LIGHT_DIVISORS,
                Quantity::Picture => &PICTURE_DIVISORS,
            };
            for divisor in divisors {
                let side = |n: u32| ((f64::from(n) / divisor).round() as u32).max(1);
                let scene = Scene {
                    width: side(what.scene.width),
                    height: side(what.scene.height),
                    ..what.scene.clone()
                };
                let proceed = || !is_cancelled.load(Ordering::Relaxed);
                let view = pool.install(|| ExactView::new(&field, &scene, what.quantity, proceed));
                let Some(view) = view else { return };
                if send.send(view).is_err() {
                    return;
                }
                wake();
            }
            drop(send);
            wake();
        };
        std::thread::Builder::new().name("exact".into()).spawn(work).map_err(|e| failed(e.to_string()))?;
        Ok(Self { views, cancelled })
    }

    /// Next result, and whether the computation continues.
    pub fn poll(&self) -> (Option<ExactView>, bool) {
        match self.views.try_recv() {
            Ok(view) => (Some(view), true),
            Err(e) => (None, e == TryRecvError::Empty),
        }
    }
}
