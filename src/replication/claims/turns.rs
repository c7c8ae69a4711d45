//! Interleaved timing of shadow methods on several variants of a scene. Separate comparisons would be minutes apart,
//! and the load of the machine changes meanwhile.

use super::claim::Need;
use super::figures::Figures;
use super::scenes::Subject;
use crate::error::Result;
use crate::measure::job::{Effort, Job, name_of};
use crate::measure::progress::Progress;
use crate::measure::table::Row;
use crate::measure::timing::{Timing, Turns, interleave};
use crate::render::{DisabledOptimizations, Renderer, Session};
use crate::shadow::parse_list;
use std::sync::Arc;

/// Times all shadow methods that the test of a paper's claim needs, on all scene variants, in interleaved rounds.
/// Nothing else is measured.
///
/// # Errors
/// The device cannot store a variant of the scene, or the user cancelled the measurement.
pub fn time_in_turn(
    renderer: &Arc<Renderer>,
    (name, subject): (&str, &Subject),
    needs: &[Need],
    effort: Effort,
    progress: &Progress,
) -> Result<Vec<Vec<Figures>>> {
    let mut stages = Vec::new();
    for need in needs {
        let changed = need.variant.of(subject);
        let session =
            Session::on(renderer, Arc::clone(&changed.volume), &changed.tf, DisabledOptimizations::NONE)?;
        stages.push((session, changed, parse_list(&need.methods)?));
    }
    let jobs: Vec<Job> = stages
        .iter()
        .map(|(session, Subject { volume, tf, scene }, _)| {
            Job::new(session, (volume, tf), scene, name, effort)
        })
        .collect();
    let mut turns = Vec::new();
    for (job, (_, _, methods)) in jobs.iter().zip(&stages) {
        for method in methods {
            let run = Box::new(move || job.timed(method.as_ref()));
            turns.push(Turns { run, warmup: 1, rounds: effort.repeats });
        }
    }
    let keep_busy = || jobs.first().map_or(Ok(None), |job| job.keep_busy());
    let mut times = interleave(&mut turns, &keep_busy, &mut |_| progress.check("claims"))?.into_iter();
    let mut all = Vec::new();
    for (_, changed, methods) in &stages {
        let mut own = Vec::new();
        for (method, times) in methods.iter().zip(&mut times) {
            let [width, height] = [changed.scene.width, changed.scene.height];
            let mut row = Row { width, height, ..Row::default() };
            match times.and_then(|t| Timing::of(&t)) {
                Ok(timing) => row.set_timing(&timing),
                Err(e) => row.set_failed(&e),
            }
            own.push(Figures { name: name_of(method.as_ref()), row, ..Figures::default() });
        }
        all.push(own);
    }
    Ok(all)
}
