//! Timed rounds of a comparison of shadow methods: each round runs and times every method once, in turn.

use super::comparison::Compared;
use super::job::{Job, SHORT_MS, SLOW_FRAME_MS, name_of};
use super::journal::{Journal, Measured, Recorded};
use super::progress::{Progress, Step, StepKind};
use super::timing::{Event, StageTimes, Timing, Turns, interleave};
use crate::error::{Error, Result};
use crate::shadow::Method;

/// Shadow method in a comparison, with measured errors and the times of its rounds so far.
pub struct TimedRow<'a> {
    pub method: &'a dyn Method,
    /// Index of the shadow method's row in the comparison table.
    place: usize,
    key: String,
    pub compared: Compared,
    pub frame_ms: f64,
    /// Measured times of the shadow method, one entry per timed round, each with the index of the program run that
    /// measured it.
    rounds: Vec<(u32, StageTimes)>,
    /// Whether this program run has already rendered a picture with the shadow method.
    warm: bool,
}

impl<'a> TimedRow<'a> {
    /// Creates the timing entry of a shadow method with measured errors, and returns the notes about its measurement.
    /// `warm` tells whether this program run has rendered with the method.
    pub fn new(
        method: &'a dyn Method,
        place: usize,
        key: String,
        Recorded { measured, picture, rounds }: Recorded,
        warm: bool,
    ) -> (Self, Vec<String>) {
        let Measured { row, slug, left_out, notes, frame_ms } = measured;
        let (spec, picture) = (method.spec().to_string(), Some(picture));
        let compared = Compared { row, method: spec, slug, picture, left_out, difference: None, nodes: None };
        (Self { method, place, key, compared, frame_ms, rounds, warm }, notes)
    }

    /// Whether a build and a frame of the shadow method are short, so that more runs cost little.
    pub fn is_short(&self) -> bool {
        let row = &self.compared.row;
        row.build_ms.zip(row.frame_ms).is_some_and(|(build, frame)| build + frame < SHORT_MS)
    }

    /// Adds a note if the timed rounds of the shadow method are from several runs of the program.
    fn note_runs(&mut self) {
        let mut runs: Vec<_> = self.rounds.iter().map(|(run, _)| run).collect();
        runs.dedup();
        if runs.len() > 1 {
            let note =
                format!("its {} timed rounds are from {} runs of the program", self.rounds.len(), runs.len());
            self.compared.row.add_note(&note);
        }
    }
}

/// Times shadow methods in turn until each has `repeats` timed rounds, and writes the times to the comparison table
/// rows. Returns the methods that failed, with their errors.
pub fn time(
    job: &Job,
    rows: &mut [&mut TimedRow],
    repeats: usize,
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Vec<(String, Error)>> {
    let mut missing = Vec::new();
    for (i, timed) in rows.iter_mut().enumerate() {
        timed.rounds.truncate(repeats.max(job.effort.short_repeats));
        let rounds = repeats.saturating_sub(timed.rounds.len());
        // The first picture has warmed up a slow method; the others get one warm-up round, in turn.
        let warmup = usize::from(rounds > 0 && !(timed.warm && timed.frame_ms > SLOW_FRAME_MS));
        let step = Step::new(StepKind::Run, &name_of(timed.method));
        progress.spare(&step, (1 + job.effort.repeats).saturating_sub(warmup + rounds));
        progress.expect(step, (warmup + rounds).saturating_sub(1 + job.effort.repeats));
        if rounds > 0 {
            missing.push((i, warmup, rounds));
            let row = &mut timed.compared.row;
            // A row recorded by another run may have been timed under other conditions.
            if !job.remark.is_empty() && !row.note.contains(&job.remark) {
                row.add_note(&job.remark);
            }
        }
    }
    // Rows with their times so far, for the observer.
    let shown = |(i, ..): &(usize, usize, usize)| {
        let timed = &rows[*i];
        let times: Vec<_> = timed.rounds.iter().map(|(_, times)| *times).collect();
        (timed.place, timed.compared.row.clone(), times)
    };
    let mut shown: Vec<_> = missing.iter().map(shown).collect();
    let methods: Vec<_> = missing.iter().map(|(i, _, _)| rows[*i].method).collect();
    let mut turns: Vec<Turns> = Vec::new();
    for ((_, warmup, rounds), method) in missing.iter().zip(&methods) {
        let run = move || job.timed(*method);
        turns.push(Turns { run: Box::new(run), warmup: *warmup, rounds: *rounds });
    }
    let keys: Vec<_> = missing.iter().map(|(i, _, _)| rows[*i].key.clone()).collect();
    let read = interleave(&mut turns, &|| job.keep_busy(), &mut |event| match event {
        Event::Starts { turns, counts } => {
            let name = name_of(methods[turns]);
            let what = if counts { "timing" } else { "warming up" };
            progress.begin(Step::new(StepKind::Run, &name), &format!("{name}: {what}"))
        }
        Event::Repeats => progress.check("timing"),
        Event::Round(times) => {
            journal.record_round(times.iter().map(|(i, times)| (keys[*i].as_str(), *times)))?;
            for (i, times) in times {
                let (place, row, all) = &mut shown[*i];
                all.push(*times);
                row.set_timing(&Timing::of(all)?);
                progress.row(*place, row);
            }
            Ok(())
        }
    })?;
    let mut failures = Vec::new();
    for ((i, _, _), read) in missing.into_iter().zip(read) {
        match read {
            Ok(times) => rows[i].rounds.extend(times.into_iter().map(|t| (journal.run(), t))),
            Err(e) => {
                rows[i].compared.row.set_failed(&e);
                failures.push((name_of(rows[i].method), e));
            }
        }
    }
    for timed in rows.iter_mut().filter(|r| !r.compared.row.has_failed()) {
        let times: Vec<_> = timed.rounds.iter().map(|(_, times)| *times).collect();
        let timing = Timing::of(&times)?;
        timed.compared.row.set_timing(&timing);
        timed.compared.row.note_unsteady(&timing);
        timed.note_runs();
    }
    Ok(failures)
}
