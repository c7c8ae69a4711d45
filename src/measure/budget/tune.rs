//! Tuning of shadow methods on a graphics device: searches the settings of each method within budgets of memory and
//! time.

use super::search::{MOST_TRIALS, Place, Search, SearchAxis};
use super::{Budget, ErrorMeasure, Uses, answers, tuned_for};
use crate::error::{Error, Result};
use crate::measure::facts::row_key;
use crate::measure::job::{Job, name_of};
use crate::measure::journal::Journal;
use crate::measure::progress::{Progress, Step, StepKind};
use crate::measure::reference::Shared;
use crate::measure::table::Row;
use crate::shadow::{Entry, Method, SearchSpace};

/// Expected number of trials in a search for one method's settings within one budget, for the estimate of remaining
/// time.
const USUAL_TRIALS: usize = 30;

/// Shadow method with the settings that a search chose, and the budgets and error measures for which it chose them.
pub struct Chosen {
    pub method: Box<dyn Method>,
    pub uses: Uses,
}

/// Result of the searches for method settings within memory and time budgets: chosen settings, trials and notes.
#[derive(Default)]
pub struct Tuned {
    /// Distinct method settings that the searches chose, each with its budgets and error measures.
    pub chosen: Vec<Chosen>,
    /// Measured trials of the searches for method settings, method by method, in the order in which they were made.
    pub trials: Vec<Row>,
    /// Notes on the searches for method settings, for the reader of the comparison table.
    pub notes: Vec<String>,
}

/// Searches the settings of every tunable shadow method among `methods` for the smallest error within each memory or
/// time budget. A method listed several times is searched once.
///
/// # Errors
/// The reference data cannot be computed, the journal cannot be written, or the user cancelled the measurement.
pub fn tune(
    job: &Job,
    job_key: u64,
    methods: &[Box<dyn Method>],
    budgets: &[Budget],
    shared: &mut Shared,
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Tuned> {
    let mut tuned = Tuned::default();
    if budgets.is_empty() {
        return Ok(tuned);
    }
    if let Err(why) = job.session.needs_shadows(job.scene) {
        tuned.notes.push(format!("nothing is tuned: no shadow is needed ({why})"));
        return Ok(tuned);
    }
    let mut spaces: Vec<(&Entry, SearchSpace)> = Vec::new();
    for entry in methods.iter().map(|m| m.entry()) {
        if spaces.iter().all(|(other, _)| !std::ptr::eq(*other, entry))
            && let Some(space) = SearchSpace::of(entry)
        {
            spaces.push((entry, space));
        }
    }
    let step = |entry: &Entry| Step::new(StepKind::Trial, entry.name);
    spaces.iter().for_each(|(entry, _)| progress.expect(step(entry), USUAL_TRIALS * budgets.len()));
    for (entry, space) in &spaces {
        let mut attempt = |place: &[usize]| {
            let none = || Error::runtime("cannot tune", entry.name, "a place is none of its settings");
            let method = space.method(place).ok_or_else(none)?;
            let key = row_key(job_key, method.as_ref(), "trial");
            if let Some(recorded) = journal.trial(&key).filter(|t| answers(t, budgets)) {
                return Ok(recorded);
            }
            let map = method.map_size().map_or(String::new(), |n| format!(" map={n}"));
            progress.begin(step(entry), &format!("{}{map}: trying", name_of(method.as_ref())))?;
            let trial = attempt(method.as_ref(), budgets, shared, progress)?;
            journal.record_trial(&key, &trial)?;
            Ok(trial)
        };
        one_method(entry, space, budgets, &mut attempt, &mut tuned)?;
        progress.spare(&step(entry), usize::MAX);
    }
    Ok(tuned)
}

/// Measures a shadow method with one choice of settings on the graphics device. If the measurement fails, for example
/// for lack of memory, the returned row has the error in its note.
fn attempt(
    method: &dyn Method,
    budgets: &[Budget],
    shared: &mut Shared,
    progress: &mut Progress,
) -> Result<Row> {
    let reference = shared.get(progress)?;
    let mut trial = reference.row(method);
    match reference.try_setting(method, budgets, &mut trial) {
        Err(e) if e.is_cancelled() => return Err(e),
        Err(e) => {
            trial = reference.row(method);
            trial.add_note(&e);
        }
        Ok(()) => {}
    }
    Ok(trial)
}

/// Searches one shadow method's settings within every memory or time budget. Smaller budgets come first; each search
/// starts from the trials of the earlier ones.
fn one_method(
    entry: &Entry,
    space: &SearchSpace,
    budgets: &[Budget],
    attempt: &mut dyn FnMut(&[usize]) -> Result<Row>,
    tuned: &mut Tuned,
) -> Result<()> {
    let axes = space.axes().iter().map(|a| SearchAxis { len: a.len(), ordered: a.ordered }).collect();
    let mut search = Search::new(axes, |place| space.canonical(place), attempt);
    let default = space.default_place();
    let mut order = budgets.to_vec();
    order.sort_by(Budget::order);
    let questions: Uses = order.iter().flat_map(|budget| ErrorMeasure::ALL.map(|by| (*budget, by))).collect();
    for (budget, by) in &questions {
        if !search.minimize(*budget, *by, &default)? {
            let name = entry.name;
            tuned.notes.push(format!("{name}: the search within {budget} ended after {MOST_TRIALS} trials"));
        }
    }
    // Settings are chosen after all searches, since one search may find the best settings for another.
    let mut chosen: Vec<(Place, Uses)> = Vec::new();
    for (budget, by) in questions {
        match search.best_known(budget, by) {
            Some(place) => match chosen.iter_mut().find(|(p, _)| *p == place) {
                Some((_, uses)) => uses.push((budget, by)),
                None => chosen.push((place, vec![(budget, by)])),
            },
            None if by == ErrorMeasure::Points
                && !search.tried.iter().any(|(_, trial)| budget.stores_nothing(trial)) =>
            {
                tuned.notes.push(nothing_held(entry, budget, &search.tried));
            }
            None => {}
        }
    }
    let mut trials = std::mem::take(&mut search.tried);
    drop(search);
    for (place, uses) in chosen {
        for (_, trial) in trials.iter_mut().filter(|(p, _)| *p == place) {
            trial.tuned_for = tuned_for(&uses);
        }
        tuned.chosen.extend(space.method(&place).map(|method| Chosen { method, uses }));
    }
    tuned.trials.extend(trials.into_iter().map(|(_, trial)| trial));
    Ok(())
}

fn nothing_held(entry: &Entry, budget: Budget, tried: &[(Place, Row)]) -> String {
    let least = tried.iter().filter_map(|(_, t)| budget.need(t)).reduce(f64::min);
    let least = match (least, budget) {
        (Some(n), Budget::Bytes(_)) => format!("; the least that was tried takes {n} bytes"),
        (Some(ms), Budget::Ms(_)) => format!("; the least that was tried takes {ms:.3} ms"),
        (Some(n), Budget::Frames(_)) => format!("; the least that was tried takes {n:.2} frames"),
        (None, _) => String::new(),
    };
    format!("{}: no settings within {budget}{least}", entry.name)
}
