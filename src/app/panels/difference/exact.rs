//! Computes the exact reference picture for the error heat maps on a separate thread, from coarse to fine resolution.

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

/// Pixel sizes of the successive refinements of the heat map of transmittance errors, in pixels of the window's
/// picture.
const LIGHT_DIVISORS: [f64; 5] = [16.0, 8.0, 4.0, 2.0, 1.0];
/// Pixel sizes of the successive refinements of the heat map of colour errors, in pixels of the window's picture, and
/// of that of bounds on them. This heat map takes about a hundred times as long as that of transmittance errors.
const PICTURE_DIVISORS: [f64; 6] = [24.0, 12.0, 6.0, 3.0, 2.0, 1.0];

/// Inputs of the exact reference picture for the error heat maps: transfer function, scene, and quantity
/// (transmittance or colour).
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    pub tf: Arc<TransferFunction>,
    pub scene: Scene,
    pub quantity: Quantity,
}

/// Starts the computation of the exact reference picture at successively finer resolutions, on a background thread.
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
        // Without memory for the strand directions, the picture itself could not be rendered either.
        let directions = strands.and_then(|strands| strands.directions().ok());
        let field = ExactField::new(&volume, &what.tf).with_directions(directions);
        let divisors: &[f64] = match what.quantity {
            Quantity::Light => &LIGHT_DIVISORS,
            Quantity::Picture | Quantity::Bound => &PICTURE_DIVISORS,
        };
        for divisor in divisors {
            let side = |n: u32| ((f64::from(n) / divisor).round() as u32).max(1);
            let [width, height] = [what.scene.width, what.scene.height].map(side);
            let scene = Scene { width, height, ..what.scene.clone() };
            let proceed = || !cancelled.load(Ordering::Relaxed);
            let view = pool.install(|| ExactView::new(&field, &scene, what.quantity, proceed));
            let Some(view) = view.filter(|_| volume.check_reads().is_ok()) else { return };
            if sender.send(view).is_err() {
                return;
            }
            each();
        }
    })
}
