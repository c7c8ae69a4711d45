//! The timed rounds of a table's rows.

use super::super::journal::{Journal, Kept, Measured};
use super::super::prepare::build;
use super::super::progress::{Progress, Stage, Step};
use super::super::timing::{Event, StageTimes, Timing, Turns, interleave};
use super::{Compared, Job, SLOW_FRAME_MS, name_of};
use crate::error::{Error, Result};
use crate::shadow::Method;
use ndarray::Array3;
use std::time::Instant;

/// A method whose errors are known and whose times may be.
pub struct Entry<'a> {
    pub method: &'a dyn Method,
    /// Among the rows.
    place: usize,
    key: String,
    pub compared: Compared,
    pub frame_ms: f64,
    /// Timed rounds with the run of the program that each is from.
    rounds: Vec<(u32, StageTimes)>,
    /// This run of the program has drawn it.
    warm: bool,
}

impl<'a> Entry<'a> {
    /// With the notes about it.
    pub fn new(
        method: &'a dyn Method,
        place: usize,
        key: String,
        measured: Measured,
        picture: Array3<f32>,
    ) -> (Self, Vec<String>) {
        let Measured { row, slug, left_out, notes, frame_ms } = measured;
        let compared = Compared { row, slug, picture: Some(picture), difference: None, left_out };
        (Self { method, place, key, compared, frame_ms, rounds: Vec::new(), warm: true }, notes)
    }

    pub fn kept(method: &'a dyn Method, place: usize, key: String, kept: Kept) -> (Self, Vec<String>) {
        let (entry, notes) = Self::new(method, place, key, kept.measured, kept.picture);
        (Self { rounds: kept.rounds, warm: false, ..entry }, notes)
    }
}

/// Times methods in turn, each until it has been timed `repeats` times, and fills their rows; gives what failed.
pub fn time(
    job: &Job,
    entries: &mut [&mut Entry],
    repeats: usize,
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Vec<(String, Error)>> {
    let mut missing = Vec::new();
    for (i, entry) in entries.iter_mut().enumerate() {
        entry.rounds.truncate(repeats);
        let rounds = repeats - entry.rounds.len();
        // A slow frame has been warmed up by its first picture; the others by one more round, all in turn.
        let warmup = usize::from(rounds > 0 && !(entry.warm && entry.frame_ms > SLOW_FRAME_MS));
        let step = Step::new(Stage::Run, &name_of(entry.method));
        progress.spare(&step, (1 + job.effort.repeats).saturating_sub(warmup + rounds));
        if rounds > 0 {
            missing.push((i, warmup, rounds));
            let row = &mut entry.compared.row;
            // A row kept by another run may have been timed otherwise.
            if !job.remark.is_empty() && !row.note.contains(&job.remark) {
                row.add_note(&job.remark);
            }
        }
    }
    // Rows as they are so far, for who watches.
    let shown = |(i, ..): &(usize, usize, usize)| {
        let entry = &entries[*i];
        let times: Vec<_> = entry.rounds.iter().map(|(_, times)| *times).collect();
        (entry.place, entry.compared.row.clone(), times)
    };
    let mut shown: Vec<_> = missing.iter().map(shown).collect();
    let methods: Vec<_> = missing.iter().map(|(i, _, _)| entries[*i].method).collect();
    let mut turns: Vec<Turns> = Vec::new();
    for ((_, warmup, rounds), method) in missing.iter().zip(&methods) {
        let run = move || timed(job, *method);
        turns.push(Turns { run: Box::new(run), warmup: *warmup, rounds: *rounds });
    }
    let keys: Vec<_> = missing.iter().map(|(i, _, _)| entries[*i].key.clone()).collect();
    let read = interleave(&mut turns, &mut |event| match event {
        Event::Starts { turns, counts } => {
            let name = name_of(methods[turns]);
            let what = if counts { "timing" } else { "warming up" };
            progress.begin(Step::new(Stage::Run, &name), &format!("{name}: {what}"))
        }
        Event::Round(times) => {
            journal.keep_round(times.iter().map(|(i, times)| (keys[*i].as_str(), *times)))?;
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
            Ok(times) => entries[i].rounds.extend(times.into_iter().map(|t| (journal.run(), t))),
            Err(e) => {
                entries[i].compared.row.set_failed(&e);
                failures.push((name_of(entries[i].method), e));
            }
        }
    }
    for entry in entries.iter_mut().filter(|e| !e.compared.row.has_failed()) {
        let times: Vec<_> = entry.rounds.iter().map(|(_, times)| *times).collect();
        entry.compared.row.set_timing(&Timing::of(&times)?);
        let mut runs: Vec<_> = entry.rounds.iter().map(|(run, _)| run).collect();
        runs.dedup();
        if runs.len() > 1 {
            let note =
                format!("its {} timed rounds are from {} runs of the program", times.len(), runs.len());
            entry.compared.row.add_note(&note);
        }
    }
    Ok(failures)
}

/// One timed run of a method.
fn timed(job: &Job, method: &dyn Method) -> Result<StageTimes> {
    let start = Instant::now();
    let shadow = build(job, method)?;
    let build_wall_ms = start.elapsed().as_secs_f64() * 1e3;
    let frame = job.session.render(&shadow, job.scene)?.span;
    let report = &shadow.report;
    Ok(StageTimes { build_host_ms: report.host_ms, build_device: report.device, build_wall_ms, frame })
}
