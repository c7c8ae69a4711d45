//! Progress of a measurement with an estimate of the remaining time; an observer can cancel it between steps.

use super::table::Row;
use crate::error::{Error, Result};
use std::collections::HashMap;
use std::time::Instant;

/// Kind of step in a measurement, such as computing the exact picture, measuring errors, or one timed run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StepKind {
    /// Step of a measurement that computes the exact transmittance at points visible to the camera.
    Points,
    /// Step of a measurement that computes the exact reference picture.
    ExactPicture,
    /// Step of a measurement that builds a method's shadow map for the first time and renders a first picture with
    /// it.
    Draw,
    /// Step of a measurement that determines a shadow method's errors.
    Errors,
    /// Step of a measurement that is one timed run or warm-up run of a shadow method.
    Run,
    /// Step of a measurement for the ablation study of one shadow method, in which each renderer optimization is
    /// disabled in turn.
    Ablation,
    /// Step of a measurement that tests all shadow methods in one case of the stability suite, or in one cell of the
    /// benchmark.
    Case,
    /// Step of a measurement that tries one choice of method settings, in a search within a memory or time budget.
    Trial,
    /// Step of a command that reads a volume or draws pictures, and measures nothing.
    Render,
}

/// Step of a measurement: its kind and its shadow method. The estimate of the remaining time assumes that equal steps
/// take equally long in all scenes.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Step {
    /// Kind of this step of the measurement, such as measuring errors or one timed run.
    pub kind: StepKind,
    /// Name and settings of the shadow method that this step measures. Empty where the step applies to all methods.
    pub method: String,
}

impl Step {
    /// Creates a step of a measurement for one shadow method, or for all methods if `method` is empty.
    pub fn new(kind: StepKind, method: &str) -> Self {
        Self { kind, method: method.into() }
    }
}

/// State of a running measurement for a progress bar: current step, completed and total steps, and remaining time.
#[derive(Debug, Clone, PartialEq)]
pub struct Status<'a> {
    /// Step of the measurement that is running now.
    pub step: &'a Step,
    /// Description of the current step of the measurement, for display to the user.
    pub what: &'a str,
    /// Number of completed steps of the measurement.
    pub done: usize,
    /// Total number of steps of the measurement, including those not started.
    pub total: usize,
    /// Estimated remaining time of the measurement, s; `None` where unknown.
    pub left_s: Option<f64>,
}

impl Status<'_> {
    /// Fraction of the measurement's steps that are completed, from 0 to 1.
    pub fn share(&self) -> f32 {
        self.done as f32 / self.total.max(1) as f32
    }
}

/// Observer of a running measurement. Its methods are called on the measuring thread.
pub trait Watch {
    /// Called when a step of the measurement starts.
    fn starts(&mut self, _status: &Status) {}

    /// Receives a comparison table row that has new errors or times of one more round. `_place` is the row's index,
    /// from 0. The column `pareto` is filled only in the finished table.
    fn row(&mut self, _place: usize, _row: &Row) {}

    /// Called between steps of the measurement. If it returns `false`, the measurement is cancelled.
    fn goes_on(&self) -> bool {
        true
    }
}

/// Observer of a measurement that only receives the progress at the start of each step.
struct Look<F>(F);

impl<F: FnMut(&Status)> Watch for Look<F> {
    fn starts(&mut self, status: &Status) {
        (self.0)(status);
    }
}

/// Progress of a measurement: completed steps with their durations, and remaining steps.
pub struct Progress<'a> {
    left: HashMap<Step, usize>,
    /// Number of completed runs of each measurement step and their total duration, s.
    took: HashMap<Step, (usize, f64)>,
    now: Option<(Step, Instant)>,
    done: usize,
    /// Number of comparison table rows of the scenes that are already measured.
    rows_before: usize,
    watch: Box<dyn Watch + 'a>,
}

impl<'a> Progress<'a> {
    /// Creates the progress record of a measurement. `show` is called whenever a step of the measurement starts.
    pub fn new(show: impl FnMut(&Status) + 'a) -> Self {
        Self::watched(Look(show))
    }

    /// Creates the progress record of a measurement with an observer. The observer can cancel the measurement.
    pub fn watched(watch: impl Watch + 'a) -> Self {
        let (left, took) = (HashMap::new(), HashMap::new());
        Self { left, took, now: None, done: 0, rows_before: 0, watch: Box::new(watch) }
    }

    /// Creates the progress record of a measurement without an observer.
    pub fn unseen() -> Self {
        Self::new(|_| {})
    }

    /// Adds a step to the remaining steps of the measurement, to be run `times` times.
    pub fn expect(&mut self, step: Step, times: usize) {
        *self.left.entry(step).or_default() += times;
    }

    /// Removes up to `times` runs of a step from the remaining steps of the measurement, because they are not needed.
    pub fn spare(&mut self, step: &Step, times: usize) {
        if let Some(left) = self.left.get_mut(step) {
            *left = left.saturating_sub(times);
        }
    }

    /// Ends the previous step of the measurement and starts a new one; `what` describes the new step to the user.
    ///
    /// # Errors
    /// The observer cancelled the measurement ([`Error::cancelled`]).
    pub fn begin(&mut self, step: Step, what: &str) -> Result<()> {
        self.end();
        self.check(what)?;
        let left_s = self.left_s();
        let total = self.done + self.left.values().sum::<usize>();
        // A step that was not announced with `expect` counts too.
        let total = total.max(self.done + 1);
        self.watch.starts(&Status { step: &step, what, done: self.done, total, left_s });
        self.now = Some((step, Instant::now()));
        Ok(())
    }

    /// Returns an error if the observer has cancelled the measurement; for use within a step.
    ///
    /// # Errors
    /// The observer cancelled the measurement ([`Error::cancelled`]).
    pub fn check(&self, what: &str) -> Result<()> {
        if self.watch.goes_on() { Ok(()) } else { Err(Error::cancelled(what)) }
    }

    /// Reports new values of a comparison table row to the observer of the measurement. `place` is the row's index
    /// within the current scene.
    pub fn row(&mut self, place: usize, row: &Row) {
        self.watch.row(self.rows_before + place, row);
    }

    /// Starts the next scene of the measurement. `rows` is the number of table rows of the scene just completed.
    pub fn next_scene(&mut self, rows: usize) {
        self.rows_before += rows;
    }

    /// Ends the current measurement step and records its duration.
    pub fn end(&mut self) {
        if let Some((step, start)) = self.now.take() {
            self.finished(step, start.elapsed().as_secs_f64());
        }
    }

    fn finished(&mut self, step: Step, seconds: f64) {
        self.spare(&step, 1);
        let (times, total) = self.took.entry(step).or_default();
        *times += 1;
        *total += seconds;
        self.done += 1;
    }

    /// Estimates the remaining time of the measurement, s; `None` before any step is complete. The estimate for a
    /// step is the mean duration of similar steps: the same kind and method, then (for timed runs) the method's first
    /// picture, then the same kind, then all.
    pub fn left_s(&self) -> Option<f64> {
        let mean = |like: &dyn Fn(&Step) -> bool| {
            let found = self.took.iter().filter(|(step, _)| like(step)).map(|(_, took)| *took);
            let (times, seconds) = found.fold((0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
            (times > 0).then(|| seconds / times as f64)
        };
        let of = |step: &Step| {
            mean(&|s| s == step)
                .or_else(|| {
                    let drawn = Step { kind: StepKind::Draw, method: step.method.clone() };
                    (step.kind == StepKind::Run).then(|| mean(&|s| *s == drawn)).flatten()
                })
                .or_else(|| mean(&|s| s.kind == step.kind))
                .or_else(|| mean(&|_| true))
        };
        self.left
            .iter()
            .filter(|(_, times)| **times > 0)
            .map(|(step, times)| Some(*times as f64 * of(step)?))
            .sum()
    }
}

/// Formats a duration in seconds for the user: `40 s`, `3 min`, `2 h 10 min`.
pub fn spoken(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    match minutes {
        _ if seconds < 99.5 => format!("{} s", seconds.ceil()),
        0..100 => format!("{minutes} min"),
        _ => format!("{} h {} min", minutes / 60, minutes % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remaining_time_follows_similar_steps() {
        let mut progress = Progress::unseen();
        let step = Step::new;
        for method in ["dsm", "rays"] {
            for (stage, times) in [(StepKind::Draw, 1), (StepKind::Errors, 1), (StepKind::Run, 6)] {
                progress.expect(step(stage, method), times);
            }
        }
        assert_eq!(progress.left_s(), None);
        progress.finished(step(StepKind::Draw, "dsm"), 2.0);
        // All else is like the one that is known.
        assert_eq!(progress.left_s(), Some(15.0 * 2.0));
        progress.finished(step(StepKind::Errors, "dsm"), 10.0);
        progress.finished(step(StepKind::Draw, "rays"), 4.0);
        // Runs of dsm as its drawing, 6 x 2; of rays 6 x 4; errors of rays as those of dsm.
        assert_eq!(progress.left_s(), Some(12.0 + 24.0 + 10.0));
        progress.finished(step(StepKind::Run, "dsm"), 1.0);
        assert_eq!(progress.left_s(), Some(5.0 + 24.0 + 10.0));
        progress.spare(&step(StepKind::Run, "rays"), 5);
        progress.spare(&step(StepKind::Errors, "rays"), usize::MAX);
        assert_eq!(progress.left_s(), Some(5.0 + 4.0));
    }

    #[test]
    fn progress_bar_receives_steps_and_total() {
        let mut shown = Vec::new();
        let mut progress =
            Progress::new(|s| shown.push((s.what.to_owned(), s.done, s.total, s.left_s.is_some())));
        progress.expect(Step::new(StepKind::Points, ""), 1);
        progress.expect(Step::new(StepKind::Run, "dsm"), 2);
        progress.begin(Step::new(StepKind::Points, ""), "points").unwrap();
        progress.begin(Step::new(StepKind::Run, "dsm"), "timing").unwrap();
        progress.end();
        drop(progress);
        assert_eq!(shown, [("points".to_owned(), 0, 3, false), ("timing".to_owned(), 1, 3, true)]);
    }

    #[test]
    fn observer_receives_rows_and_can_cancel() {
        #[derive(Default)]
        struct Heard {
            shares: Vec<(StepKind, String, f32)>,
            places: Vec<usize>,
        }
        impl Watch for &mut Heard {
            fn starts(&mut self, status: &Status) {
                self.shares.push((status.step.kind, status.step.method.clone(), status.share()));
            }
            fn row(&mut self, place: usize, _row: &Row) {
                self.places.push(place);
            }
            fn goes_on(&self) -> bool {
                self.shares.len() < 2
            }
        }
        let mut heard = Heard::default();
        let mut progress = Progress::watched(&mut heard);
        progress.expect(Step::new(StepKind::Draw, "dsm"), 4);
        progress.begin(Step::new(StepKind::Draw, "dsm"), "drawing").unwrap();
        progress.row(1, &Row::default());
        progress.next_scene(3);
        progress.row(1, &Row::default());
        progress.begin(Step::new(StepKind::Draw, "dsm"), "drawing").unwrap();
        let ended = progress.begin(Step::new(StepKind::Draw, "dsm"), "dsm: drawing").unwrap_err();
        assert!(ended.is_cancelled() && ended.place == "dsm: drawing" && ended.exit_status() == 1, "{ended}");
        drop(progress);
        let draw = |share| (StepKind::Draw, "dsm".to_owned(), share);
        assert_eq!((heard.shares, heard.places), (vec![draw(0.0), draw(0.25)], vec![1, 4]));
    }

    #[test]
    fn times_are_spoken() {
        for (seconds, expected) in
            [(0.2, "1 s"), (40.0, "40 s"), (99.0, "99 s"), (170.0, "3 min"), (7800.0, "2 h 10 min")]
        {
            assert_eq!(spoken(seconds), expected);
        }
    }
}
