//! Times of a shadow method with tried settings, for budgets of time.

use super::budget::Budget;
use super::job::Job;
use super::table::Row;
use super::timing::{StageTimes, Timing};
use crate::error::Result;
use crate::scene::Scene;
use crate::shadow::{Method, NoShadows};
use itertools::Itertools as _;

/// Number of timed runs in a trial of method settings. The slower run counts, to keep chosen settings within the time
/// budget when they are timed again.
const TRIAL_RUNS: usize = 2;

/// Times of one run of a shadow method, and of `none` beside it for a budget in frames.
type Run = (StageTimes, Option<StageTimes>);

/// Times a shadow method once. For a budget in frames it follows a frame without shadows, so that a change in the
/// machine's speed affects both.
fn run(job: &Job, (method, scene): (&dyn Method, &Scene), budgets: &[Budget]) -> Result<Run> {
    let timed = |method: &dyn Method| {
        job.keep_busy()?;
        job.timed_in(method, scene)
    };
    let in_frames = budgets.iter().any(|budget| matches!(budget, Budget::Frames(_)));
    let of_none = in_frames.then(|| timed(&NoShadows)).transpose()?;
    Ok((timed(method)?, of_none))
}

/// Median times of runs as a row of a comparison table.
fn row_of(runs: &[Run]) -> Result<Row> {
    let row = |times: &[StageTimes]| {
        let mut row = Row::default();
        Timing::of(times).map(|timing| row.set_timing(&timing))?;
        Ok(row)
    };
    let mut timed: Row = row(&runs.iter().map(|run| run.0).collect_vec())?;
    let of_none = runs.iter().filter_map(|run| run.1).collect_vec();
    if !of_none.is_empty() {
        timed.set_frames(&row(&of_none)?);
    }
    Ok(timed)
}

/// Sets `build_ms`, `frame_ms` and, for a budget in frames, `frames` from the medians of `runs` runs after a warm-up,
/// which may compile shaders.
///
/// # Errors
/// The device is lost, or a clock fails.
pub fn set_times(
    job: &Job,
    subject: (&dyn Method, &Scene),
    budgets: &[Budget],
    runs: usize,
    row: &mut Row,
) -> Result<()> {
    run(job, subject, budgets)?;
    let timed = row_of(&(0..runs).map(|_| run(job, subject, budgets)).collect::<Result<Vec<_>>>()?)?;
    [row.build_ms, row.frame_ms, row.frames] = [timed.build_ms, timed.frame_ms, timed.frames];
    Ok(())
}

/// Times a trial of a shadow method's settings, if a budget limits time. The slower of two runs after a warm-up counts;
/// the second is left out if the first takes more than twice every budget.
///
/// # Errors
/// The device is lost, or a clock fails.
pub fn set_trial_times(
    job: &Job,
    subject: (&dyn Method, &Scene),
    budgets: &[Budget],
    trial: &mut Row,
) -> Result<()> {
    let of_time: Vec<_> = budgets.iter().copied().filter(Budget::is_of_time).collect();
    if of_time.is_empty() {
        return Ok(());
    }
    run(job, subject, &of_time)?;
    for _ in 0..TRIAL_RUNS {
        let timed = row_of(&[run(job, subject, &of_time)?])?;
        for (slower, time) in [
            (&mut trial.build_ms, timed.build_ms),
            (&mut trial.frame_ms, timed.frame_ms),
            (&mut trial.frames, timed.frames),
        ] {
            *slower = slower.iter().copied().chain(time).reduce(f64::max);
        }
        if of_time.iter().all(|budget| budget.need(&timed).is_some_and(|need| need > 2.0 * budget.amount())) {
            break;
        }
    }
    Ok(())
}
