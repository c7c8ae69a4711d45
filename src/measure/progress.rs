//! Progress of a measurement with an estimate of the remaining time; an observer can cancel it between steps.

use super::table::Row;
use crate::error::{Error, Result};
use std::collections::HashMap;
use std::time::Instant;

/// A kind of work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StepKind {
    /// Exact transmittance at the points that the camera sees.
    Points,
    /// The exact picture that images are compared with.
    ExactPicture,
    /// Building a method's structure and drawing for the first time.
    Draw,
    /// A method's errors.
    Errors,
    /// One timed run of a method, or one to warm up.
    Run,
    /// Ablation: each optimization of a method's plan disabled in turn.
    Ablation,
    /// A setting that a search within a budget tries.
    Trial,
}

/// Step of a measurement. For the estimate of the remaining time, steps of one kind and method take equally long in
/// all scenes.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Step {
    /// Kind of work.
    pub kind: StepKind,
    /// Name and settings; empty where the step is for all methods.
    pub method: String,
}

impl Step {
    /// Creates a step of a method, or of all methods if `method` is empty.
    pub fn new(kind: StepKind, method: &str) -> Self {
        Self { kind, method: method.into() }
    }
}

/// Status that a progress bar shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Status<'a> {
    /// Stage and method of the step.
    pub step: &'a Step,
    /// Description of the current work.
    pub what: &'a str,
    /// Steps that are done.
    pub done: usize,
    /// Number of all steps.
    pub total: usize,
    /// Seconds that what is left will take, as far as that is known.
    pub left_s: Option<f64>,
}

impl Status<'_> {
    /// Share of the steps that is done, from 0 to 1.
    pub fn share(&self) -> f32 {
        self.done as f32 / self.total.max(1) as f32
    }
}

/// Observer of a running measurement, called on the measuring thread.
pub trait Watch {
    /// Called when a step starts.
    fn starts(&mut self, _status: &Status) {}

    /// The `place`-th row of the table, from 0, has new figures: its errors, or times of one more round. Only of the
    /// finished table is known what is on its Pareto front.
    fn row(&mut self, _place: usize, _row: &Row) {}

    /// Called between steps: `false` ends the table there.
    fn goes_on(&self) -> bool {
        true
    }
}

/// Observer that only receives the status.
struct Look<F>(F);

impl<F: FnMut(&Status)> Watch for Look<F> {
    fn starts(&mut self, status: &Status) {
        (self.0)(status);
    }
}

/// Steps that are done, with what they took, and those that are left.
pub struct Progress<'a> {
    left: HashMap<Step, usize>,
    /// Number of finished runs of each step and their total duration, s.
    took: HashMap<Step, (usize, f64)>,
    now: Option<(Step, Instant)>,
    done: usize,
    /// Number of rows of earlier scenes.
    rows_before: usize,
    watch: Box<dyn Watch + 'a>,
}

impl<'a> Progress<'a> {
    /// Progress whose `show` is called whenever a step starts.
    pub fn new(show: impl FnMut(&Status) + 'a) -> Self {
        Self::watched(Look(show))
    }

    /// Progress whose `watch` is informed of everything, and may end the table.
    pub fn watched(watch: impl Watch + 'a) -> Self {
        let (left, took) = (HashMap::new(), HashMap::new());
        Self { left, took, now: None, done: 0, rows_before: 0, watch: Box::new(watch) }
    }

    /// Nobody looks.
    pub fn unseen() -> Self {
        Self::new(|_| {})
    }

    /// Adds steps to what is to be done.
    pub fn expect(&mut self, step: Step, times: usize) {
        *self.left.entry(step).or_default() += times;
    }

    /// Takes steps off again that turn out not to be needed; all of that kind and method where `times` is more.
    pub fn spare(&mut self, step: &Step, times: usize) {
        if let Some(left) = self.left.get_mut(step) {
            *left = left.saturating_sub(times);
        }
    }

    /// Ends the step before and starts this one; `what` says what it is.
    ///
    /// # Errors
    /// It is to end here ([`Error::cancelled`]).
    pub fn begin(&mut self, step: Step, what: &str) -> Result<()> {
        self.end();
        self.check(what)?;
        let left_s = self.left_s();
        let total = self.done + self.left.values().sum::<usize>();
        // A step that nobody expected still counts.
        let total = total.max(self.done + 1);
        self.watch.starts(&Status { step: &step, what, done: self.done, total, left_s });
        self.now = Some((step, Instant::now()));
        Ok(())
    }

    /// Checks inside a step whether to go on.
    ///
    /// # Errors
    /// It is to end here ([`Error::cancelled`]).
    pub fn check(&self, what: &str) -> Result<()> {
        if self.watch.goes_on() { Ok(()) } else { Err(Error::cancelled(what)) }
    }

    /// Tells of new figures of a row of this scene.
    pub fn row(&mut self, place: usize, row: &Row) {
        self.watch.row(self.rows_before + place, row);
    }

    /// Begins the next scene; `rows` is the number of rows of the current one.
    pub fn next_scene(&mut self, rows: usize) {
        self.rows_before += rows;
    }

    /// Ends the step that is being done.
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

    /// Seconds for what is left, each step at the mean of those like it: of the same kind and method; for a timed run
    /// of a method that has had none, its first drawing; of the same kind; of all. `None` before anything is done.
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

/// Seconds as one says them: `40 s`, `3 min`, `2 h 10 min`.
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
    fn what_is_left_takes_as_long_as_its_like() {
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
    fn the_bar_is_told_what_starts_and_how_much_there_is() {
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
    fn a_watcher_hears_of_steps_and_rows_and_ends_it() {
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
