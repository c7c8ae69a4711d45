//! Exact picture on its own thread, coarse first.

use crate::engine::task::{Task, Wake};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::measure::error_map::{ExactView, Quantity};
use crate::scene::Scene;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::sync::Arc;
use std::sync::atomic::Ordering;

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

/// Starts the computation of successive resolutions.
///
/// # Errors
/// The system cannot start a thread.
pub fn start(
    (volume, strands): (Arc<Volume>, Option<Arc<VoxelisedStrands>>),
    what: Question,
    wake: Wake,
) -> Result<Task<ExactView>> {
    // One core stays free for the interface.
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get().saturating_sub(1).max(1));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::runtime("cannot compute the exact picture", "window", e))?;
    let each = Arc::clone(&wake);
    Task::start("exact", wake, move |sender, cancelled| {
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
            let [width, height] = [what.scene.width, what.scene.height].map(side);
            let scene = Scene { width, height, ..what.scene.clone() };
            let proceed = || !cancelled.load(Ordering::Relaxed);
            let view = pool.install(|| ExactView::new(&field, &scene, what.quantity, proceed));
            let Some(view) = view else { return };
            if sender.send(view).is_err() {
                return;
            }
            each();
        }
    })
}
