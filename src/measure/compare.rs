//! Comparison of shadow methods on one scene: first measures each method's errors, then its times in interleaved
//! rounds.
//!
//! Every result is recorded in the [`Journal`] at once: a row with its errors and picture, then the times of each
//! round. Results that an earlier run recorded are not measured again. The missing timed rounds of all methods are
//! run in turn.

use super::budget::tune::{Chosen, tune};
use super::budget::{Budget, ErrorMeasure, Uses, tuned_for};
use super::comparison::{Compared, Comparison, take_differences};
use super::facts::{Facts, job_key, row_key};
use super::job::{Effort, Job, SLOW_FRAME_MS, file_name_part, name_of};
use super::journal::{Journal, Recorded};
use super::pareto::mark_pareto;
use super::progress::{Progress, Step, StepKind};
use super::reference::Shared;
use super::rounds::{TimedRow, time};
use super::row_measurements::set_frames;
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::shadow::Method;
use ndarray::Axis;
use std::collections::HashMap;

/// Allowed difference in opacity between pictures of one scene by two shadow methods. Early ray termination may cause
/// such a difference.
const OPACITY_TOLERANCE: f32 = 2e-3;

/// Returns the progress steps for the comparison of shadow methods on one scene, each with its number of repetitions.
pub fn steps(methods: &[Box<dyn Method>], effort: &Effort) -> Vec<(Step, usize)> {
    let mut steps = vec![(Step::new(StepKind::Points, ""), 1), (Step::new(StepKind::ExactPicture, ""), 1)];
    steps.extend(methods.iter().flat_map(|method| method_steps(method.as_ref(), effort)));
    steps
}

fn method_steps(method: &dyn Method, effort: &Effort) -> [(Step, usize); 3] {
    let name = name_of(method);
    let times = [(StepKind::Draw, 1), (StepKind::Errors, 1), (StepKind::Run, 1 + effort.repeats)];
    times.map(|(kind, times)| (Step::new(kind, &name), times))
}

/// Measures errors and times of every shadow method on one scene. A method that fails becomes a row with its error
/// message, and the others continue. A method whose timing fails retains its errors. After a cancellation the journal
/// contains all results so far.
///
/// # Errors
/// No method is given, the journal cannot be written, or the user cancelled the measurement.
pub fn compare(
    job: &Job,
    methods: &[Box<dyn Method>],
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Comparison> {
    compare_within(job, methods, &[], journal, progress)
}

/// Searches the settings of every tunable method for the smallest errors within each budget, then measures as
/// [`compare`] does. Settings that the searches choose are measured as further rows.
///
/// # Errors
/// See [`compare`].
pub fn compare_within(
    job: &Job,
    methods: &[Box<dyn Method>],
    budgets: &[Budget],
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Comparison> {
    if methods.is_empty() {
        return Err(Error::input("nothing to compare", "--methods", "no method is given"));
    }
    Budget::check_methods(budgets, methods)?;
    let mut result = Comparison::default();
    let facts = Facts::of(job.session.renderer.gpu());
    let field = ExactField::new(job.volume, job.tf).with_directions(job.directions()?);
    let mut shared = Shared::new(job, &facts, &field);
    let tuned = match tune(job, job_key(job, &facts), methods, budgets, &mut shared, journal, progress) {
        Ok(tuned) => tuned,
        Err(e) if e.is_cancelled() => return Err(e),
        Err(e) => {
            result.failures.push(("budgets".into(), e));
            Default::default()
        }
    };
    result.notes.extend(tuned.notes);
    result.trials = tuned.trials;
    let (further, uses) = beside(methods, tuned.chosen, &job.effort, progress);
    let all: Vec<&dyn Method> = methods.iter().chain(&further).map(Box::as_ref).collect();
    let mut rows = measure_errors(job, &facts, &all, &mut shared, journal, progress, &mut result)?;

    let mut ready: Vec<&mut TimedRow> = rows.iter_mut().filter_map(|r| r.as_mut().ok()).collect();
    result.notes.extend(unequal_opacity(&ready));
    // Slow methods are timed separately; otherwise every round would be as slow as they are.
    let (mut slow, mut fast): (Vec<_>, Vec<_>) = ready.drain(..).partition(|r| r.frame_ms > SLOW_FRAME_MS);
    if job.effort.repeats > 1 {
        for row in &mut slow {
            let seconds = 1e-3 * row.frame_ms;
            row.compared.row.add_note(&format_args!("a frame takes {seconds:.1} s: timed once"));
        }
    }
    for (group, repeats) in [(&mut fast, job.effort.repeats), (&mut slow, 1)] {
        result.failures.extend(time(job, group, repeats, journal, progress)?);
    }
    let mut short: Vec<_> = fast.into_iter().filter(|r| r.is_short()).collect();
    if job.effort.short_repeats > job.effort.repeats {
        result.failures.extend(time(job, &mut short, job.effort.short_repeats, journal, progress)?);
    }
    progress.end();

    result.compared = rows.into_iter().map(|r| r.map_or_else(|failed| failed, |r| r.compared)).collect();
    set_frames(result.compared.iter_mut().map(|c| &mut c.row));
    if !budgets.is_empty() {
        result.compared.iter_mut().zip(&uses).for_each(|(c, uses)| say_tuned(c, uses));
    }
    result.tuned = further;
    if !job.remark.is_empty() && result.compared.iter().any(|c| c.row.note.contains(&job.remark)) {
        result.notes.insert(0, job.remark.clone());
    }
    mark_pareto(result.compared.iter_mut().map(|c| &mut c.row));
    let reference = result.compared.iter().find(|c| c.is_reference()).and_then(|c| c.picture.clone());
    if let Some(reference) = reference {
        take_differences(&mut result.compared, &reference)?;
    }
    Ok(result)
}

/// Splits the chosen methods of the settings search: returns those not among the requested methods, and the budgets
/// of each method, requested ones first.
fn beside(
    methods: &[Box<dyn Method>],
    chosen: Vec<Chosen>,
    effort: &Effort,
    progress: &mut Progress,
) -> (Vec<Box<dyn Method>>, Vec<Uses>) {
    let mut uses = vec![Uses::new(); methods.len()];
    let mut further = Vec::new();
    for Chosen { method, uses: own } in chosen {
        match methods.iter().position(|m| m.spec() == method.spec()) {
            Some(place) => uses[place] = own,
            None => {
                let steps = method_steps(method.as_ref(), effort);
                steps.into_iter().for_each(|(step, times)| progress.expect(step, times));
                further.push(method);
                uses.push(own);
            }
        }
    }
    (further, uses)
}

/// Fills the columns `tuned` and `tuned_for` of a comparison table row. Adds a note where the row's measured memory
/// or time exceeds its budget.
fn say_tuned(compared: &mut Compared, uses: &[(Budget, ErrorMeasure)]) {
    let row = &mut compared.row;
    (row.tuned, row.tuned_for) = (Some(!uses.is_empty()), tuned_for(uses));
    let mut over: Vec<Budget> = Vec::new();
    for (budget, _) in uses {
        if budget.need(row).is_some_and(|need| need > budget.amount()) && !over.contains(budget) {
            over.push(*budget);
        }
    }
    for budget in over {
        let need = budget.need(row).unwrap_or(f64::NAN);
        row.add_note(&format!("measured in full it needs {need:.1}, more than {budget}"));
    }
}

/// Measures the errors of every shadow method, or takes them from the journal file. Returns one row or failed row of
/// the comparison table per method; notes and failures are added to `result`.
fn measure_errors<'m>(
    job: &Job,
    facts: &Facts,
    methods: &[&'m dyn Method],
    shared: &mut Shared,
    journal: &mut Journal,
    progress: &mut Progress,
    result: &mut Comparison,
) -> Result<Vec<Result<TimedRow<'m>, Compared>>> {
    let job_key = job_key(job, facts);
    let mut rows = Vec::new();
    let mut slugs = HashMap::new();
    for (place, method) in methods.iter().copied().enumerate() {
        let name = name_of(method);
        let slug = unused_slug(&job.file_prefix, method, &mut slugs);
        let key = row_key(job_key, method, &slug);
        let measured = if let Some(recorded) = journal.take(&key) {
            progress.spare(&Step::new(StepKind::Draw, &name), 1);
            progress.spare(&Step::new(StepKind::Errors, &name), 1);
            Ok(TimedRow::new(method, place, key, recorded, false))
        } else {
            let reference = shared.get(progress);
            let measured = reference.and_then(|r| r.measure(method, &slug, progress));
            match measured.and_then(|measured| job.volume.check_reads().map(|()| measured)) {
                Ok((measured, picture)) => {
                    journal.record(&key, &measured, &picture)?;
                    let recorded = Recorded { measured, picture, rounds: Vec::new() };
                    Ok(TimedRow::new(method, place, key, recorded, true))
                }
                Err(e) if e.is_cancelled() => return Err(e),
                Err(e) => Err(e),
            }
        };
        match measured {
            Ok((row, notes)) => {
                for note in notes {
                    if !result.notes.contains(&note) {
                        result.notes.push(note);
                    }
                }
                progress.row(place, &row.compared.row);
                rows.push(Ok(row));
            }
            Err(e) => {
                let size = [job.scene.width, job.scene.height];
                let mut row = facts.row(&job.scene_name, size, method);
                row.lights = Some(job.scene.lights_shining());
                let failed = Compared::failed(row, method, slug, &e);
                progress.row(place, &failed.row);
                rows.push(Err(failed));
                progress.spare(&Step::new(StepKind::Run, &name), 1 + job.effort.repeats);
                result.failures.push((name, e));
            }
        }
    }
    if !shared.is_made() {
        progress.spare(&Step::new(StepKind::Points, ""), 1);
        progress.spare(&Step::new(StepKind::ExactPicture, ""), 1);
    }
    Ok(rows)
}

/// Returns notes on shadow methods whose picture differs in opacity from the first method's picture. Shadows never
/// change opacity; a difference shows a fault, such as a driver that aborts a shader's loop.
fn unequal_opacity(rows: &[&mut TimedRow]) -> Vec<String> {
    let opacity = |r: &TimedRow| r.compared.picture.as_ref().map(|p| p.index_axis(Axis(2), 3).to_owned());
    let Some((first, others)) = rows.split_first() else { return Vec::new() };
    let note = |r: &&mut TimedRow| {
        let (opacity, expected) = (opacity(r)?, opacity(first)?);
        let off = (opacity - &expected).iter().filter(|d| d.is_nan() || d.abs() > OPACITY_TOLERANCE).count();
        let (name, first) = (name_of(r.method), name_of(first.method));
        (off > 0)
            .then(|| format!("{name}: {off} pixels of its picture differ in opacity from that of {first}"))
    };
    others.iter().filter_map(note).collect()
}

/// Returns a unique text for the file names of each shadow method, in the order of `methods`. The method's name and
/// settings form the text.
pub fn slugs(prefix: &str, methods: &[Box<dyn Method>]) -> Vec<String> {
    let mut used = HashMap::new();
    methods.iter().map(|method| unused_slug(prefix, method.as_ref(), &mut used)).collect()
}

/// Returns a text of scene, shadow method and settings for use in file names. A number is appended where the text is
/// already in use.
fn unused_slug(prefix: &str, method: &dyn Method, used: &mut HashMap<String, u32>) -> String {
    let map = method.map_size().map_or(String::new(), |n| format!(" map={n}"));
    let slug = prefix.to_owned() + &file_name_part(&format!("{}{map} {}", method.name(), method.params()));
    let times = used.entry(slug.clone()).and_modify(|n| *n += 1).or_insert(1);
    if *times == 1 { slug } else { format!("{slug}-{times}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::parse_list;

    #[test]
    fn file_names_tell_rows_apart() {
        let methods = parse_list("none;dsm:epsilon=0.02,0.005,map=64,128;none").unwrap();
        let expected = [
            "none",
            "dsm-map-64-epsilon-0.02",
            "dsm-map-128-epsilon-0.02",
            "dsm-map-64-epsilon-0.005",
            "dsm-map-128-epsilon-0.005",
            "none-2",
        ];
        assert_eq!(slugs("", &methods), expected);
        assert_eq!(slugs("lungs_", &methods[..1]), ["lungs_none"]);
    }
}
