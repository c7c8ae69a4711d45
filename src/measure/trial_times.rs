//! Times of a shadow method with tried settings, for budgets of time.

use super::budget::Budget;
use super::job::Job;
use super::table::Row;
use super::timing::Timing;
use crate::error::Result;
use crate::scene::Scene;
use crate::shadow::{Method, NoShadows};

/// Number of timed runs in a trial of method settings. The slower run counts, to keep chosen settings within the time
/// budget when they are timed again.
const TRIAL_RUNS: usize = 2;

/// Times the build of a shadow method's maps and a frame with them in `runs` runs. For a budget in frames, each run
/// follows a frame without shadows, so that a change in the machine's speed affects both.
///
/// # Errors
/// The device is lost, or a clock fails.
pub fn set_times(
    job: &Job,
    (method, scene): (&dyn Method, &Scene),
    budgets: &[Budget],
    runs: usize,
    row: &mut Row,
) -> Result<()> {
    let in_frames = budgets.iter().any(|budget| matches!(budget, Budget::Frames(_)));
    let timed = |method: &dyn Method| {
        job.keep_busy()?;
        job.timed_in(method, scene)
    };
    let (mut times, mut times_of_none) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        if in_frames {
            times_of_none.push(timed(&NoShadows)?);
        }
        times.push(timed(method)?);
    }
    let timing = Timing::of(&times)?;
    [row.build_ms, row.frame_ms] = [timing.build_ms, timing.frame_ms].map(|ms| Some(ms.median));
    if in_frames {
        row.set_frames(Timing::of(&times_of_none)?.frame_ms.median);
    }
    Ok(())
}

/// Times a trial of a shadow method's settings, if a budget limits time. The slower of two runs counts; the second is
/// left out if the first takes more than twice every budget.
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
    for _ in 0..TRIAL_RUNS {
        let mut run = Row::default();
        if of_time.is_empty() {
            break;
        }
        set_times(job, subject, &of_time, 1, &mut run)?;
        for (slower, ms) in [
            (&mut trial.build_ms, run.build_ms),
            (&mut trial.frame_ms, run.frame_ms),
            (&mut trial.frames, run.frames),
        ] {
            *slower = slower.iter().copied().chain(ms).reduce(f64::max);
        }
        if of_time.iter().all(|budget| budget.need(&run).is_some_and(|need| need > 2.0 * budget.amount())) {
            break;
        }
    }
    Ok(())
}
