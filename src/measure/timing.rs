//! Interleaved timing: A B C A B C, so that drift of the machine falls on every method alike.

use super::stats::Spread;
use crate::error::{Error, Result};
use serde::Serialize;

/// What a time was read from: the column `clock`.
///
/// The two disagree on software adapters, and only the second holds submission and waiting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockSource {
    /// Timestamps written by the GPU.
    Gpu,
    /// The host's clock around submission and completion.
    Wall,
}

impl ClockSource {
    /// As written in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Wall => "wall",
        }
    }
}

/// One run's stages, in ms, as the run measured them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageTimes {
    /// To make the shadow structure; 0 for a method that has none.
    pub build_ms: f64,
    /// One picture with it made.
    pub frame_ms: f64,
}

/// One method's stages over all repeats, in ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Timing {
    pub build_ms: Spread,
    pub frame_ms: Spread,
    pub repeats: usize,
}

/// Something to time: runs once and says how long its stages took.
pub type TimedRun<'a> = Box<dyn FnMut() -> Result<StageTimes> + 'a>;

/// Times `runs` in turn, first `warmup` rounds that do not count, then `repeats` rounds that do. One answer a run,
/// in their order. A run that fails is left out of later rounds and the others go on.
///
/// # Errors
/// (The whole) no repeats. (One entry) the run's own error, or a time that is negative or not finite.
pub fn interleave(runs: &mut [TimedRun], warmup: usize, repeats: usize) -> Result<Vec<Result<Timing>>> {
    if repeats == 0 {
        return Err(Error::input("cannot time", "--repeats", "at least 1 is needed"));
    }
    let mut readings: Vec<Result<Vec<StageTimes>>> = runs.iter().map(|_| Ok(Vec::new())).collect();
    for round in 0..warmup + repeats {
        for (run, reading) in runs.iter_mut().zip(&mut readings) {
            let Ok(times) = reading else { continue };
            match run().and_then(sensible) {
                Ok(time) if round >= warmup => times.push(time),
                Ok(_) => {}
                Err(error) => *reading = Err(error),
            }
        }
    }
    Ok(readings.into_iter().map(|r| r.and_then(|times| timing(&times))).collect())
}

fn timing(times: &[StageTimes]) -> Result<Timing> {
    let spread = |stage: fn(&StageTimes) -> f64| Spread::of(&times.iter().map(stage).collect::<Vec<_>>());
    match (spread(|t| t.build_ms), spread(|t| t.frame_ms)) {
        (Some(build_ms), Some(frame_ms)) => Ok(Timing { build_ms, frame_ms, repeats: times.len() }),
        _ => Err(Error::runtime("cannot time", "timing", "no run was counted")),
    }
}

/// Timestamps that wrap or were never written must not end up in a median.
fn sensible(times: StageTimes) -> Result<StageTimes> {
    let ok = |ms: f64| ms.is_finite() && ms >= 0.0;
    if ok(times.build_ms) && ok(times.frame_ms) {
        return Ok(times);
    }
    Err(Error::runtime(
        "cannot time",
        "clock",
        format!("it read {} ms to build and {} ms a frame", times.build_ms, times.frame_ms),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::{Cell, RefCell};

    /// A clock that moves only when told to.
    #[derive(Default)]
    struct FakeClock(Cell<f64>);

    impl FakeClock {
        fn pass(&self, ms: f64) {
            self.0.set(self.0.get() + ms);
        }

        fn time(&self, work: impl FnOnce()) -> f64 {
            let start = self.0.get();
            work();
            self.0.get() - start
        }
    }

    #[test]
    fn planted_delays_come_out_and_the_warm_up_does_not() {
        let clock = FakeClock::default();
        let mut frames = [500.0, 400.0, 8.0, 32.0, 2.0, 16.0, 4.0].into_iter();
        let mut runs: Vec<TimedRun> = vec![
            Box::new(|| Ok(StageTimes { build_ms: clock.time(|| clock.pass(0.5)), frame_ms: 1.0 })),
            Box::new(|| {
                let delay = frames.next().unwrap();
                let build_ms = clock.time(|| clock.pass(2.0 * delay));
                Ok(StageTimes { build_ms, frame_ms: clock.time(|| clock.pass(delay)) })
            }),
        ];
        let timings = interleave(&mut runs, 2, 5).unwrap();
        assert_eq!(
            *timings[0].as_ref().unwrap(),
            Timing { build_ms: Spread::exactly(0.5), frame_ms: Spread::exactly(1.0), repeats: 5 }
        );
        let planted = Spread { median: 8.0, min: 2.0, max: 32.0 };
        let doubled = Spread { median: 16.0, min: 4.0, max: 64.0 };
        assert_eq!(
            *timings[1].as_ref().unwrap(),
            Timing { build_ms: doubled, frame_ms: planted, repeats: 5 }
        );
    }

    #[test]
    fn runs_take_turns() {
        let order = RefCell::new(String::new());
        let log = &order;
        let mut runs: Vec<TimedRun> = "ABC"
            .chars()
            .map(|name| -> TimedRun {
                Box::new(move || {
                    log.borrow_mut().push(name);
                    Ok(StageTimes { build_ms: 0.0, frame_ms: 1.0 })
                })
            })
            .collect();
        interleave(&mut runs, 1, 2).unwrap();
        drop(runs);
        assert_eq!(order.into_inner(), "ABCABCABC");
    }

    #[test]
    fn a_run_that_fails_is_out_and_the_others_go_on() {
        let calls = Cell::new(0);
        let good = StageTimes { build_ms: 1.0, frame_ms: 2.0 };
        let mut runs: Vec<TimedRun> = vec![
            Box::new(|| {
                calls.set(calls.get() + 1);
                if calls.get() == 3 { Err(Error::runtime("lost", "device", "planted")) } else { Ok(good) }
            }),
            Box::new(|| Ok(good)),
            Box::new(|| Ok(StageTimes { build_ms: f64::NAN, frame_ms: 1.0 })),
            Box::new(|| Ok(StageTimes { build_ms: 1.0, frame_ms: -1.0 })),
        ];
        let timings = interleave(&mut runs, 1, 9).unwrap();
        drop(runs);
        assert_eq!(timings[0].as_ref().unwrap_err().why, "planted");
        assert_eq!(calls.get(), 3, "not run again");
        assert_eq!(timings[1].as_ref().unwrap().repeats, 9);
        assert!(timings[2].is_err() && timings[3].is_err());
    }

    #[test]
    fn no_repeats_is_an_input_error() {
        assert_eq!(interleave(&mut [], 3, 0).unwrap_err().exit_status(), 2);
        assert!(interleave(&mut [], 0, 1).unwrap().is_empty());
    }
}
