//! Measurement of one cell of the benchmark: exact transmittances, a search for the best settings of every method within
//! each budget, and paired comparisons of the methods.

use super::answer::{Answer, CellResult};
use super::exact;
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::measure::budget::search::{Search, Side};
use crate::measure::budget::{Budget, By};
use crate::measure::errors::VisiblePoints;
use crate::measure::job::{Effort, Job};
use crate::measure::stats::{ErrorStats, rms_difference_interval};
use crate::measure::table::Row;
use crate::measure::timing::Timing;
use crate::shadow::{BuildReport, Entry, Method, MethodSpec, SearchSpace, ShadowMap};
use itertools::Itertools as _;

/// Largest number of trials of a method for each budget: in the first cell of a volume and transfer function, and in the
/// cells beside it, whose searches start from the settings found there. All methods have the same numbers.
const FULL_TRIALS: usize = 24;
const NEARBY_TRIALS: usize = 4;
/// Number of timed runs of the settings found within a budget of time.
const TIMED_RUNS: usize = 3;

/// Cell of the benchmark that is being measured.
pub struct CellJob<'a> {
    job: Job<'a>,
    visible: VisiblePoints,
    /// Hash of the visible points and their exact transmittances.
    pub hash: String,
}

/// Errors of an answer at all visible points, each with the weight of the point.
pub type Errors = Vec<(f64, f64)>;

impl<'a> CellJob<'a> {
    /// Chooses the visible points of a cell and computes their exact transmittances.
    ///
    /// # Errors
    /// The camera sees nothing.
    pub fn new(job: Job<'a>) -> Result<Self> {
        let field = ExactField::new(job.volume, job.tf);
        let visible = VisiblePoints::new(&field, job.scene, job.effort.points);
        if visible.is_empty() {
            return Err(Error::runtime(
                "cannot use benchmark cell",
                &job.scene_name,
                "the camera sees nothing",
            ));
        }
        let hash = exact::fingerprint(&visible);
        Ok(Self { job, visible, hash })
    }

    /// Visible points of the cell, with their exact transmittances.
    pub fn visible(&self) -> &VisiblePoints {
        &self.visible
    }

    /// Measuring job of the cell: session and scene.
    pub fn job(&self) -> &Job<'a> {
        &self.job
    }

    /// Searches the best settings of every method within each budget. `first` is the result of the first cell of the same
    /// volume and transfer function, whose settings start the searches; `None` for that cell itself. `step` is called
    /// before each method, and may end the measurement.
    ///
    /// # Errors
    /// The device is lost, or `step` ends the measurement.
    pub fn search_all(
        &self,
        methods: &[&'static Entry],
        budgets: &[Budget],
        first: Option<&CellResult>,
        step: &mut dyn FnMut(&str) -> Result<()>,
    ) -> Result<Vec<(Answer, Errors)>> {
        let mut found = Vec::new();
        for entry in methods {
            step(entry.name)?;
            let Some(space) = SearchSpace::of(entry) else { continue };
            found.extend(self.search(&space, entry, budgets, first)?);
        }
        Ok(found)
    }

    /// Searches the best settings of one method within each budget, smaller budgets first.
    fn search(
        &self,
        space: &SearchSpace,
        entry: &'static Entry,
        budgets: &[Budget],
        first: Option<&CellResult>,
    ) -> Result<Vec<(Answer, Errors)>> {
        let mut note = String::new();
        let attempt = |place: &[usize]| {
            let method = space.method(place).ok_or_else(|| no_method(entry))?;
            Ok(self.trial(method.as_ref(), budgets).unwrap_or_else(|e| {
                note = e.to_string();
                Row { note: e.to_string(), ..Row::default() }
            }))
        };
        let sides = space.axes().iter().map(|a| Side { len: a.len(), ordered: a.ordered }).collect();
        let most_trials = if first.is_some() { NEARBY_TRIALS } else { FULL_TRIALS };
        let mut search = Search::new(sides, |place| space.canonical(place), attempt).limited_to(most_trials);
        let known = first.map_or(&[][..], |first| &first.answers).iter();
        let starts = known.filter(|a| a.method == entry.name && !a.settings.is_empty()).map(|a| &a.settings);
        for settings in starts.unique() {
            search.try_first(&space.place_of(&settings.parse::<MethodSpec>()?))?;
        }
        for budget in budgets {
            search.look(*budget, By::Points, &space.default_place())?;
        }
        let best: Vec<_> = budgets.iter().map(|budget| search.best_known(*budget, By::Points)).collect();
        let trials = search.tried.len();
        drop(search);
        let mut answers = Vec::new();
        for (budget, place) in budgets.iter().zip(best) {
            let mut answer =
                Answer { budget: budget.to_string(), method: entry.name.into(), trials, ..Answer::default() };
            let mut errors = Errors::new();
            match place {
                Some(place) => {
                    let method = space.method(&place).ok_or_else(|| no_method(entry))?;
                    errors = self.measure(method.as_ref(), *budget, &mut answer)?;
                }
                None => answer.note.clone_from(&note),
            }
            answers.push((answer, errors));
        }
        Ok(answers)
    }

    /// Measures memory of a method, its times for a budget of time, and its error if any budget allows it.
    fn trial(&self, method: &dyn Method, budgets: &[Budget]) -> Result<Row> {
        let shadow = self.build(method)?;
        let mut trial = Row { bytes: Some(BuildReport::of_all([&shadow]).bytes), ..Row::default() };
        if budgets.iter().any(|budget| matches!(budget, Budget::Ms(_))) {
            self.job.keep_busy()?;
            let timing = Timing::of(&[self.job.timed(method)?])?;
            [trial.build_ms, trial.frame_ms] = [timing.build_ms, timing.frame_ms].map(|ms| Some(ms.median));
        }
        if budgets.iter().any(|budget| budget.holds(&trial)) {
            trial.point_err_rms = self.visible.errors(self.job.session, &shadow)?.map(|stats| stats.rms);
        }
        Ok(trial)
    }

    /// Measures a method with the settings that the search found, and returns its error at every visible point.
    fn measure(&self, method: &dyn Method, budget: Budget, answer: &mut Answer) -> Result<Errors> {
        let shadow = self.build(method)?;
        answer.settings = method.spec().to_string();
        answer.bytes = Some(BuildReport::of_all([&shadow]).bytes);
        if matches!(budget, Budget::Ms(_)) {
            let mut times = Vec::new();
            for _ in 0..TIMED_RUNS {
                self.job.keep_busy()?;
                times.push(self.job.timed(method)?);
            }
            let timing = Timing::of(&times)?;
            [answer.build_ms, answer.frame_ms] = [timing.build_ms, timing.frame_ms].map(|ms| Some(ms.median));
        }
        let errors = self.visible.weighted(self.job.session, &shadow)?;
        if let Some(stats) = ErrorStats::of(errors.iter().copied())? {
            answer.set_errors(&stats);
        }
        Ok(errors)
    }

    fn build(&self, method: &dyn Method) -> Result<ShadowMap> {
        let light = self.job.scene.light();
        self.job.session.shadow_of(method, self.job.scene, light)
    }
}

fn no_method(entry: &Entry) -> Error {
    Error::runtime("cannot tune", entry.name, "a place is none of its settings")
}

/// Returns the answers of all methods and external programs budget by budget, each with the result of the paired
/// comparison with the least error. An external program has no settings to search, so its answer takes part in every
/// budget.
pub fn compared(
    budgets: &[Budget],
    found: Vec<(Answer, Errors)>,
    of_externals: &[(Answer, Errors)],
) -> Vec<Answer> {
    let mut answers = Vec::new();
    for budget in budgets.iter().map(Budget::to_string) {
        let own = found.iter().filter(|(answer, _)| answer.budget == budget).cloned();
        let of_budget = |(answer, errors): &(Answer, Errors)| {
            (Answer { budget: budget.clone(), ..answer.clone() }, errors.clone())
        };
        let all: Vec<_> = own.chain(of_externals.iter().map(of_budget)).collect();
        let least = all.iter().filter(|(answer, _)| answer.point_err_rms.is_some());
        let least = least.min_by(|(a, _), (b, _)| a.error().total_cmp(&b.error()));
        answers.extend(all.iter().map(|(answer, errors)| {
            let least = least.filter(|(best, _)| best.method != answer.method);
            let interval = least.and_then(|(_, of_best)| rms_difference_interval(errors, of_best));
            Answer { separated: interval.map(|[low, _]| low > 0.0), ..answer.clone() }
        }));
    }
    answers
}

/// Extent of the measurement of a cell with the given number of visible points.
pub fn effort(points: usize) -> Effort {
    Effort { points, repeats: 1, ..Effort::default() }
}
