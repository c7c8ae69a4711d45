//! Interleaved timing of shadow methods in the order A B C A B C; changes in the machine's speed thus affect all
//! methods equally.

use super::stats::{Spread, median_interval};
use crate::error::{Error, Result};
use crate::gpu::{Clock, Span};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Returns the name of the clock that measured times, `gpu` or `wall`, for the comparison table column `clock`.
pub fn clock_name(clock: Clock) -> &'static str {
    match clock {
        Clock::GpuTimestamps => "gpu",
        Clock::Wall => "wall",
    }
}

/// Returns a measured time by the GPU's or the host's clock, ms; `None` where that clock was not read.
fn read(clock: Clock, span: Span) -> Option<f64> {
    match clock {
        Clock::GpuTimestamps => span.gpu_ms,
        Clock::Wall => Some(span.wall_ms),
    }
}

/// Times of the stages of one run of a shadow method, ms: transfer function tables, shadow map build and frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Time to compute the transfer function's tables and to classify the volume's bricks, ms; `None` where the run
    /// reuses them.
    #[serde(default)]
    pub tables_ms: Option<f64>,
    /// Time of the host's work on building the shadow map, without the GPU passes, ms.
    pub build_host_ms: f64,
    /// Time of the GPU passes that build the shadow map; `None` where there are none.
    pub build_device: Option<Span>,
    /// Time from requesting the shadow map to its completion, by the host's clock, ms.
    pub build_wall_ms: f64,
    /// Time to render one picture with the shadow map already built.
    pub frame: Span,
    /// Part of `frame` that the host takes to project bricks to tiles of the picture, ms.
    #[serde(default)]
    pub frame_host_ms: f64,
    /// Clock rate of the graphics card before the run, while it is kept busy, MHz; `None` where the system reports none.
    #[serde(default)]
    pub gpu_mhz: Option<f64>,
    /// Whether the device times of repeated runs did not agree before this run was recorded ([`interleave`]).
    #[serde(default)]
    pub unsteady: bool,
}

impl StageTimes {
    /// Returns the time to build the shadow map by the GPU's or the host's clock, ms; `None` where that clock was not
    /// read.
    fn build_ms(&self, clock: Clock) -> Option<f64> {
        let device_ms = self.build_device.map_or(Some(0.0), |span| read(clock, span))?;
        Some(self.build_host_ms + device_ms)
    }

    /// Returns the time on the device for shadow map and picture, ms; `None` for adapters without timestamps.
    fn device_ms(&self) -> Option<f64> {
        let build_ms = self.build_device.map_or(Some(0.0), |span| span.gpu_ms)?;
        Some(build_ms + (self.frame.gpu_ms? - self.frame_host_ms).max(0.0))
    }
}

/// Times of a shadow method over all repeated runs, ms: median, minimum and maximum, or the median alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Time to build the shadow map over all repeated runs, ms.
    pub build_ms: Spread,
    /// Time to render one picture from a finished shadow map, over all repeated runs, ms.
    pub frame_ms: Spread,
    /// Ends of the 95 % intervals of the medians of `build_ms` and `frame_ms`; `None` with fewer than six runs.
    pub intervals_ms: [Option<[f64; 2]>; 2],
    /// Clock (GPU timestamps or the host's clock) that measured the shadow map build time and the frame time.
    pub clock: Clock,
    /// Median time to compute the transfer function's tables and to classify the volume's bricks, ms.
    pub tables_ms: Option<f64>,
    /// Median time of the host's work on building the shadow map, without the GPU passes, ms.
    pub build_host_ms: f64,
    /// Median time that the host takes to project bricks to tiles of the picture, ms.
    pub frame_host_ms: f64,
    /// Median time of the GPU passes that build the shadow map, by the adapter's timestamps, ms.
    pub build_gpu_ms: Option<f64>,
    /// Median time from requesting the shadow map to its completion, by the host's clock, ms.
    pub build_wall_ms: f64,
    /// Median time to render one picture by the adapter's timestamps, ms.
    pub frame_gpu_ms: Option<f64>,
    /// Median time to render one picture by the host's clock, ms.
    pub frame_wall_ms: f64,
    /// Median clock rate of the graphics card before the runs, while it is kept busy, MHz; `None` where the system reports none.
    pub gpu_mhz: Option<f64>,
    /// Number of timed runs whose device times did not agree with those of the run before.
    pub unsteady: usize,
    /// Number of timed runs of the shadow method, over which the medians are taken.
    pub repeats: usize,
}

impl Timing {
    /// Computes the median times of a shadow method over several runs. GPU timestamps are used only where every run
    /// has them, since times of two clocks have no common median.
    ///
    /// # Errors
    /// The list of runs is empty.
    pub fn of(times: &[StageTimes]) -> Result<Self> {
        let spread = |stage: &dyn Fn(&StageTimes) -> Option<f64>| {
            Spread::of(&times.iter().map(stage).collect::<Option<Vec<_>>>()?)
        };
        let median = |stage: &dyn Fn(&StageTimes) -> Option<f64>| spread(stage).map(|s| s.median);
        let none = || Error::runtime("cannot time", "timing", "no run was counted");
        let by = |clock: Clock| {
            let build: Option<Vec<_>> = times.iter().map(|t| t.build_ms(clock)).collect();
            let frame: Option<Vec<_>> = times.iter().map(|t| read(clock, t.frame)).collect();
            Some((clock, build?, frame?))
        };
        let (clock, build, frame) = by(Clock::GpuTimestamps).or_else(|| by(Clock::Wall)).ok_or_else(none)?;
        Ok(Self {
            build_ms: Spread::of(&build).ok_or_else(none)?,
            frame_ms: Spread::of(&frame).ok_or_else(none)?,
            intervals_ms: [median_interval(&build), median_interval(&frame)],
            clock,
            tables_ms: median(&|t| t.tables_ms),
            build_host_ms: median(&|t| Some(t.build_host_ms)).ok_or_else(none)?,
            frame_host_ms: median(&|t| Some(t.frame_host_ms)).ok_or_else(none)?,
            build_gpu_ms: median(&|t| t.build_device?.gpu_ms),
            build_wall_ms: median(&|t| Some(t.build_wall_ms)).ok_or_else(none)?,
            frame_gpu_ms: median(&|t| t.frame.gpu_ms),
            frame_wall_ms: median(&|t| Some(t.frame.wall_ms)).ok_or_else(none)?,
            gpu_mhz: median(&|t| t.gpu_mhz),
            unsteady: times.iter().filter(|t| t.unsteady).count(),
            repeats: times.len(),
        })
    }
}

/// Function that performs one run of a shadow method and returns the times of its stages.
pub type TimedRun<'a> = Box<dyn FnMut() -> Result<StageTimes> + 'a>;

/// Task to be timed in turn with others, such as a shadow method on a scene: `warmup` discarded runs, then `rounds`
/// timed runs.
pub struct Turns<'a> {
    /// Function that performs one run of the timed task (a shadow method on a scene) and returns its times.
    pub run: TimedRun<'a>,
    /// Number of warm-up runs of the timed task (a shadow method on a scene), whose times are discarded.
    pub warmup: usize,
    /// Number of timed runs of the task (a shadow method on a scene) after the warm-up.
    pub rounds: usize,
}

/// Progress event of the interleaved timing of several tasks, such as shadow methods. It names tasks by their indices
/// in the list.
pub enum Event<'a> {
    /// Start of a timed run or a warm-up run of one task, such as a shadow method.
    Starts {
        /// Index of the task that starts, such as a shadow method, in the list of timed tasks.
        turns: usize,
        /// Whether the starting run of a shadow method is timed; otherwise it is a warm-up run.
        counts: bool,
    },
    /// Start of a repetition of a timed run whose times on the device did not agree yet.
    Repeats,
    /// End of a timed round: pairs of task index and stage times, for the tasks (such as shadow methods) that ran in
    /// it.
    Round(&'a [(usize, StageTimes)]),
}

/// Largest number of times that a timed run is repeated until its device times agree.
const MOST_REPEATS: usize = 20;
/// Largest relative difference of the device times of two runs that agree.
const AGREEMENT: f64 = 0.05;
/// Difference of two device times, in ms, below which they agree: timestamps are not more exact.
const AGREEMENT_MS: f64 = 0.01;
/// Longest time for which a timed run is repeated.
const LONGEST: Duration = Duration::from_secs(2);

/// Repeats a run until the times on the device of two runs in a row agree, and returns the last run. `keep_busy` runs
/// before each, since graphics cards lower their clocks while the host works. Adapters without timestamps run once.
fn steady(
    run: &mut TimedRun<'_>,
    keep_busy: &dyn Fn() -> Result<Option<f64>>,
    tell: &mut dyn FnMut(Event<'_>) -> Result<()>,
) -> Result<Result<StageTimes>> {
    let mut run = || -> Result<StageTimes> {
        let gpu_mhz = keep_busy()?;
        Ok(StageTimes { gpu_mhz, ..sensible(run()?)? })
    };
    let start = Instant::now();
    let first = run();
    let Ok(mut last) = first else { return Ok(first) };
    let Some(mut before) = last.device_ms() else { return Ok(Ok(last)) };
    for _ in 0..MOST_REPEATS {
        if start.elapsed() > LONGEST {
            break;
        }
        tell(Event::Repeats)?;
        let next = run();
        let Ok(next) = next else { return Ok(next) };
        // Some drivers leave timestamps unwritten now and then.
        let Some(now) = next.device_ms() else { continue };
        last = next;
        if (now - before).abs() <= AGREEMENT_MS.max(AGREEMENT * now.max(before)) {
            return Ok(Ok(last));
        }
        before = now;
    }
    Ok(Ok(StageTimes { unsteady: true, ..last }))
}

/// Times several tasks, such as shadow methods, in turn, after a warm-up. Returns the times of all runs of each task,
/// in order. A task that fails is excluded from later rounds, and the others continue. On a graphics card, a timed run
/// is repeated until the times on the device of two runs in a row agree to 5 %. `keep_busy` gives the card work before
/// each run, so that its clocks stay high, and returns the clock rate.
///
/// # Errors
/// For the whole call: any error that `tell` returns. For one task: its own error, or a time that is negative or
/// not finite.
pub fn interleave(
    all: &mut [Turns],
    keep_busy: &dyn Fn() -> Result<Option<f64>>,
    tell: &mut dyn FnMut(Event) -> Result<()>,
) -> Result<Vec<Result<Vec<StageTimes>>>> {
    let mut readings: Vec<Result<Vec<StageTimes>>> = all.iter().map(|_| Ok(Vec::new())).collect();
    for counts in [false, true] {
        let wanted = |t: &Turns| if counts { t.rounds } else { t.warmup };
        for round in 0..all.iter().map(wanted).max().unwrap_or(0) {
            let mut counted = Vec::new();
            for (turns, (t, reading)) in all.iter_mut().zip(&mut readings).enumerate() {
                let Ok(times) = reading else { continue };
                if round >= wanted(t) {
                    continue;
                }
                tell(Event::Starts { turns, counts })?;
                let run =
                    if counts { steady(&mut t.run, keep_busy, tell)? } else { (t.run)().and_then(sensible) };
                match run {
                    Ok(time) if counts => {
                        times.push(time);
                        counted.push((turns, time));
                    }
                    Ok(_) => {}
                    Err(error) => *reading = Err(error),
                }
            }
            if counts {
                tell(Event::Round(&counted))?;
            }
        }
    }
    Ok(readings)
}

/// Returns an error for times that are negative or not finite, such as GPU timestamps that wrapped or were never
/// written.
fn sensible(times: StageTimes) -> Result<StageTimes> {
    let StageTimes { tables_ms, build_host_ms, build_device, build_wall_ms, frame, frame_host_ms, .. } =
        times;
    let of = |span: Span| [Some(span.wall_ms), span.gpu_ms];
    let host = [tables_ms, Some(build_host_ms), Some(build_wall_ms), Some(frame_host_ms)];
    let wrong = host
        .into_iter()
        .chain(of(frame))
        .chain(build_device.into_iter().flat_map(of))
        .flatten()
        .find(|ms| !(ms.is_finite() && *ms >= 0.0));
    match wrong {
        None => Ok(times),
        Some(ms) => Err(Error::runtime("cannot time", "clock", format!("it read {ms} ms"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::{Cell, RefCell};

    /// Simulated clock for tests of the timing code, which advances only on request.
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

    fn wall(ms: f64) -> Span {
        Span { gpu_ms: None, wall_ms: ms }
    }

    fn stages(build: f64, frame: f64) -> StageTimes {
        StageTimes {
            tables_ms: None,
            build_host_ms: 0.0,
            build_device: Some(wall(build)),
            build_wall_ms: build,
            frame: wall(frame),
            frame_host_ms: 0.25 * frame,
            gpu_mhz: None,
            unsteady: false,
        }
    }

    fn quietly(all: &mut [Turns]) -> Vec<Result<Vec<StageTimes>>> {
        interleave(all, &|| Ok(None), &mut |_| Ok(())).unwrap()
    }

    #[test]
    fn planted_delays_come_out_and_the_warm_up_does_not() {
        let clock = FakeClock::default();
        let mut frames = [500.0, 400.0, 8.0, 32.0, 2.0, 16.0, 4.0].into_iter();
        let steady = || Ok(stages(clock.time(|| clock.pass(0.5)), 1.0));
        let varied = || {
            let delay = frames.next().unwrap();
            let build_ms = clock.time(|| clock.pass(2.0 * delay));
            Ok(stages(build_ms, clock.time(|| clock.pass(delay))))
        };
        let mut all = vec![
            Turns { run: Box::new(steady), warmup: 2, rounds: 5 },
            Turns { run: Box::new(varied), warmup: 2, rounds: 5 },
        ];
        let read = quietly(&mut all);
        let timing = |i: usize| Timing::of(read[i].as_ref().unwrap()).unwrap();
        assert_eq!((timing(0).build_ms, timing(0).frame_ms), (Spread::exactly(0.5), Spread::exactly(1.0)));
        assert_eq!(timing(1).frame_ms, Spread { median: 8.0, min: 2.0, max: 32.0 });
        assert_eq!(timing(1).build_ms, Spread { median: 16.0, min: 4.0, max: 64.0 });
        assert_eq!((timing(1).build_wall_ms, timing(1).frame_wall_ms, timing(1).repeats), (16.0, 8.0, 5));
    }

    #[test]
    fn a_median_is_of_one_clock() {
        let both = |gpu_ms, wall_ms| Span { gpu_ms, wall_ms };
        let run = |gpu_ms| StageTimes {
            tables_ms: None,
            build_host_ms: 3.0,
            build_device: Some(both(Some(1.0), 2.0)),
            build_wall_ms: 6.0,
            frame: both(gpu_ms, 20.0),
            frame_host_ms: 2.0,
            gpu_mhz: gpu_ms.map(|ms| 100.0 * ms),
            unsteady: gpu_ms.is_none(),
        };
        let timing = Timing::of(&[run(Some(10.0)), run(Some(10.0))]).unwrap();
        assert_eq!(
            (timing.clock, timing.build_ms.median, timing.frame_ms.median),
            (Clock::GpuTimestamps, 4.0, 10.0)
        );
        assert_eq!((timing.build_gpu_ms, timing.build_wall_ms), (Some(1.0), 6.0));
        assert_eq!((timing.build_host_ms, timing.frame_host_ms), (3.0, 2.0));
        let timing = Timing::of(&[run(Some(10.0)), run(None)]).unwrap();
        assert_eq!((timing.clock, timing.build_ms.median, timing.frame_ms.median), (Clock::Wall, 5.0, 20.0));
        assert_eq!((timing.frame_gpu_ms, timing.frame_wall_ms), (None, 20.0));
        assert_eq!((timing.gpu_mhz, timing.unsteady), (None, 1));
        // A method without a shadow map has only host time for another light.
        let none = StageTimes { build_device: None, ..run(Some(10.0)) };
        assert_eq!(Timing::of(&[none]).unwrap().build_ms, Spread::exactly(3.0));
        assert!(Timing::of(&[]).is_err());
    }

    #[test]
    fn a_card_runs_until_its_times_agree() {
        let on_card = |ms: f64| {
            let span = Span { gpu_ms: Some(ms), wall_ms: ms };
            StageTimes { build_device: Some(span), frame: span, frame_host_ms: 0.0, ..stages(ms, ms) }
        };
        // A card that raises its clocks: the third and the fourth run agree.
        let mut times = [8.0, 4.0, 2.0, 1.95, 1.0].into_iter();
        let mut raises = Turns { run: Box::new(|| Ok(on_card(times.next().unwrap()))), warmup: 0, rounds: 1 };
        let read = quietly(std::slice::from_mut(&mut raises));
        let timing = Timing::of(read[0].as_ref().unwrap()).unwrap();
        assert_eq!((timing.build_ms.median, timing.unsteady), (1.95, 0));
        // Times that never agree are recorded, and counted.
        let mut calls = 0;
        let run = || {
            calls += 1;
            Ok(on_card(if calls % 2 == 0 { 1.0 } else { 2.0 }))
        };
        let read = quietly(&mut [Turns { run: Box::new(run), warmup: 0, rounds: 1 }]);
        assert_eq!(Timing::of(read[0].as_ref().unwrap()).unwrap().unsteady, 1);
        assert_eq!(calls, 1 + MOST_REPEATS);
    }

    #[test]
    fn runs_take_turns() {
        let order = RefCell::new(String::new());
        let log = &order;
        let turns = |name: char, warmup, rounds| {
            let run = move || {
                log.borrow_mut().push(name);
                Ok(stages(0.0, 1.0))
            };
            Turns { run: Box::new(run), warmup, rounds }
        };
        let mut all: Vec<_> = vec![turns('A', 1, 2), turns('B', 1, 2), turns('C', 1, 2)];
        let mut rounds = Vec::new();
        let fillings = Cell::new(0.0);
        let keep_busy = || Ok(Some(fillings.replace(fillings.get() + 1.0)));
        let mut tell = |event: Event| {
            let Event::Round(read) = event else { return Ok(()) };
            rounds.push(read.iter().map(|(i, _)| *i).collect::<Vec<_>>());
            Ok(())
        };
        let read = interleave(&mut all, &keep_busy, &mut tell).unwrap();
        assert_eq!(rounds, [[0, 1, 2], [0, 1, 2]], "after the warm-up");
        assert_eq!(order.take(), "ABCABCABC");
        let mhz = |turns: usize| {
            read[turns].as_ref().unwrap().iter().map(|t| t.gpu_mhz.unwrap()).collect::<Vec<_>>()
        };
        assert_eq!([0, 1, 2].map(mhz), [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]);
        quietly(&mut [turns('A', 0, 1), turns('B', 1, 3), turns('C', 1, 2)]);
        assert_eq!(order.take(), "BCABCBCB");
    }

    #[test]
    fn a_run_that_fails_is_out_and_the_others_go_on() {
        let calls = Cell::new(0);
        let good = stages(1.0, 2.0);
        let failing = || {
            calls.set(calls.get() + 1);
            if calls.get() == 3 { Err(Error::runtime("lost", "device", "planted")) } else { Ok(good) }
        };
        let runs: Vec<TimedRun> = vec![
            Box::new(failing),
            Box::new(|| Ok(good)),
            Box::new(|| Ok(stages(f64::NAN, 1.0))),
            Box::new(|| Ok(stages(1.0, -1.0))),
        ];
        let mut all: Vec<_> = runs.into_iter().map(|run| Turns { run, warmup: 1, rounds: 9 }).collect();
        let read = quietly(&mut all);
        drop(all);
        assert_eq!(read[0].as_ref().unwrap_err().why, "planted");
        assert_eq!(calls.get(), 3, "not run again");
        assert_eq!(read[1].as_ref().unwrap().len(), 9);
        assert!(read[2].is_err() && read[3].is_err());
    }

    #[test]
    fn nothing_to_time_and_a_listener_that_refuses() {
        assert!(quietly(&mut []).is_empty());
        let mut all = [Turns { run: Box::new(|| Ok(stages(1.0, 1.0))), warmup: 0, rounds: 2 }];
        let full = || Error::runtime("cannot write", "journal", "disk full");
        assert!(interleave(&mut all, &|| Ok(None), &mut |_| Err(full())).is_err());
    }
}
