//! Measurement of one cell of the benchmark: exact transmittances, a search for the best settings of every method within
//! each budget, and paired comparisons of the methods.

use super::answer::{Answer, CellResult};
use super::definition::Source;
use super::exact;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::measure::budget::search::Search;
use crate::measure::budget::{Budget, ErrorMeasure};
use crate::measure::errors::VisiblePoints;
use crate::measure::job::{Effort, Job};
use crate::measure::small_scene::small_scene;
use crate::measure::stats::{image_error, rms_difference_interval};
use crate::measure::table::Row;
use crate::measure::trial_times::{set_times, set_trial_times};
use crate::render::Session;
use crate::scene::Scene;
use crate::shadow::{BuildReport, Entry, Method, ShadowMap};
use ndarray::{Array3, ArrayView3};
use std::borrow::Cow;
use std::cell::{OnceCell, RefCell};
use std::sync::Arc;

/// Largest number of new trials of a method for each budget and each of its searched settings: in the first cell of a
/// volume and transfer function, and in the cells beside it, whose searches start from the settings found there.
const FULL_TRIALS: usize = 6;
const NEARBY_TRIALS: usize = 1;
/// Number of timed runs of the settings found within a budget of time.
const TIMED_RUNS: usize = 5;
/// Factor on a budget of time up to which settings are accepted when they are timed again.
const TIME_TOLERANCE: f64 = 1.1;

/// Cell of the benchmark that is being measured.
pub struct CellJob<'a> {
    job: Job<'a>,
    visible: Arc<VisiblePoints>,
    /// Hash of the visible points and their exact transmittances.
    pub hash: String,
    /// Whether answers get an error of the small picture too, for a comparison with programs that draw one.
    pub with_pictures: bool,
    /// Exact small picture of the cell, once it is needed.
    exact_picture: OnceCell<Array3<f32>>,
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
        let visible = Arc::new(visible);
        Ok(Self { job, visible, hash, with_pictures: false, exact_picture: OnceCell::new() })
    }

    /// Returns the same job on the device of another session.
    pub fn on<'b>(&'b self, session: &'b Session) -> CellJob<'b> {
        let Job { volume, tf, scene, ref scene_name, effort, .. } = self.job;
        CellJob {
            job: Job::new(session, (volume, tf), scene, scene_name, effort),
            visible: Arc::clone(&self.visible),
            hash: self.hash.clone(),
            with_pictures: self.with_pictures,
            exact_picture: OnceCell::new(),
        }
    }

    /// Returns the rms difference of a small picture of the cell from the exact one.
    ///
    /// # Errors
    /// The picture has another size.
    pub fn picture_error(&self, picture: ArrayView3<f32>) -> Result<f64> {
        let exact = || ExactField::new(self.job.volume, self.job.tf).picture(&small_scene(self.job.scene));
        Ok(image_error(picture, self.exact_picture.get_or_init(exact).view())?.rmse)
    }

    /// Visible points of the cell, with their exact transmittances.
    pub fn visible(&self) -> &VisiblePoints {
        &self.visible
    }

    /// Measuring job of the cell: session and scene.
    pub fn job(&self) -> &Job<'a> {
        &self.job
    }

    /// Measures a method within each budget, smaller budgets first, with settings from `source`.
    ///
    /// # Errors
    /// The device is lost.
    pub fn answer(
        &self,
        entry: &'static Entry,
        budgets: &[Budget],
        source: &Source<CellResult>,
    ) -> Result<Vec<(Answer, Errors)>> {
        match source {
            Source::Full => self.search(entry, budgets, None),
            Source::Nearby(first) => self.search(entry, budgets, Some(first)),
            Source::Known(other) => {
                let is_same = other.cell == self.job.scene_name;
                let known = budgets.iter().filter_map(|b| Some((*b, other.answer(entry.name, b)?)));
                known.map(|(budget, known)| self.measure_again(entry, budget, (known, is_same))).collect()
            }
        }
    }

    /// Measures a method with known settings, found in the same cell or in another view. Where they exceed the budget, the
    /// size of the map is lowered until it is within the budget.
    fn measure_again(
        &self,
        entry: &'static Entry,
        budget: Budget,
        (known, is_same): (&Answer, bool),
    ) -> Result<(Answer, Errors)> {
        let none = Answer { budget: known.budget.clone(), method: known.method.clone(), ..Answer::default() };
        let mut answer = none.clone();
        if is_same {
            (answer.trials, answer.converged) = (known.trials, known.converged);
        }
        let Some(method) = known.own_method()? else { return Ok((answer, Errors::new())) };
        let method = (method.as_ref(), known.light_samples);
        let errors = self.measure(method, Some(budget), self.with_pictures, &mut answer)?;
        if !exceeds(budget, &answer) {
            return Ok((answer, errors));
        }
        let source = self.job.scene.lights.first().cloned().unwrap_or_default();
        let settings = Settings::of(entry, &source).ok_or_else(|| no_method(entry))?;
        let starts = settings.places_of(std::iter::once(known))?;
        let lowered = self.search_kind((&settings, entry), &[budget], &starts, 0)?;
        Ok(lowered.into_iter().next().unwrap_or_else(|| (none, Errors::new())))
    }

    /// Searches the best settings of a method within each budget, smaller budgets first. `first` is the result of the first
    /// cell, whose settings start the search; `None` for that cell itself. Searches within memory and within time share
    /// nothing, since times vary.
    fn search(
        &self,
        entry: &'static Entry,
        budgets: &[Budget],
        first: Option<&CellResult>,
    ) -> Result<Vec<(Answer, Errors)>> {
        let mut found = Vec::new();
        let source = self.job.scene.lights.first().cloned().unwrap_or_default();
        let Some(settings) = Settings::of(entry, &source) else { return Ok(found) };
        for of_time in [false, true] {
            let is_own = |budget: &&Budget| budget.is_of_time() == of_time;
            let own: Vec<Budget> = budgets.iter().filter(is_own).copied().collect();
            let known = first.map_or(&[][..], |first| &first.answers).iter();
            let is_known =
                |a: &&Answer| a.method == entry.name && own.iter().any(|b| b.to_string() == a.budget);
            let known = known.filter(is_known).filter(|a| !a.settings.is_empty());
            let starts = settings.places_of(known)?;
            let trials = if first.is_some() { NEARBY_TRIALS } else { FULL_TRIALS };
            found.extend(self.search_kind((&settings, entry), &own, &starts, trials)?);
        }
        Ok(found)
    }

    /// Searches the best settings of one method within budgets of one kind, with up to `trials` new trials a budget for each
    /// setting beside `starts`.
    fn search_kind(
        &self,
        (settings, entry): (&Settings, &'static Entry),
        budgets: &[Budget],
        starts: &[Vec<usize>],
        trials: usize,
    ) -> Result<Vec<(Answer, Errors)>> {
        let note = RefCell::new(String::new());
        let attempt = |place: &[usize]| {
            let (method, samples) = settings.method(place).ok_or_else(|| no_method(entry))?;
            self.trial((method.as_ref(), samples), budgets).or_else(|e| {
                // A failure of the device would fail all further trials.
                if e.is_cancelled() || self.job.session.renderer.gpu().loss().reason().is_some() {
                    return Err(e);
                }
                *note.borrow_mut() = e.to_string();
                Ok(Row { note: e.to_string(), ..Row::default() })
            })
        };
        let axes = settings.axes();
        let most_trials = axes.len() * trials;
        let mut search =
            Search::new(axes, |place| settings.canonical(place), attempt).limited_to(most_trials);
        for (budget, place) in
            budgets.iter().flat_map(|budget| starts.iter().map(move |place| (budget, place)))
        {
            search.start_from(*budget, place)?;
        }
        let mut converged = Vec::new();
        for budget in budgets.iter().filter(|_| trials > 0) {
            converged.push(search.minimize(*budget, ErrorMeasure::Points, &settings.default_place())?);
        }
        let mut answers = Vec::new();
        for (i, budget) in budgets.iter().enumerate() {
            let (text, method) = (budget.to_string(), entry.name.to_owned());
            let none = Answer { budget: text, method, ..Answer::default() };
            let (mut answer, errors) = loop {
                let Some(place) = search.best_known(*budget, ErrorMeasure::Points) else {
                    break (Answer { note: note.borrow().clone(), ..none }, Errors::new());
                };
                let (method, samples) = settings.method(&place).ok_or_else(|| no_method(entry))?;
                let mut answer = Answer { converged: converged.get(i).copied(), ..none.clone() };
                let method = (method.as_ref(), samples);
                let errors = self.measure(method, Some(*budget), self.with_pictures, &mut answer)?;
                if !exceeds(*budget, &answer) {
                    break (answer, errors);
                }
                // The trial was timed in a faster moment: the next best settings are measured.
                search.correct(&place, &answer.needs());
                for place in starts {
                    search.start_from(*budget, place)?;
                }
            };
            answer.trials = search.tried.len();
            answers.push((answer, errors));
        }
        Ok(answers)
    }

    /// Measures memory of a method, its times for a budget of time, and its error if any budget allows it.
    fn trial(&self, (method, samples): (&dyn Method, Option<u32>), budgets: &[Budget]) -> Result<Row> {
        let scene = self.scene_with(samples);
        let shadows = self.build(method, &scene)?;
        let mut trial = Row { bytes: Some(BuildReport::of_all(&shadows).bytes), ..Row::default() };
        set_trial_times(&self.job, (method, &scene), budgets, &mut trial)?;
        if budgets.iter().any(|budget| budget.holds(&trial)) {
            trial.point_err_rms = self.visible.errors(self.job.session, &shadows)?.map(|stats| stats.rms);
        }
        Ok(trial)
    }

    /// Measures errors and memory of a method, its times for a budget of time, and with `with_picture` the error of its
    /// picture. Returns its error at every visible point.
    pub(super) fn measure(
        &self,
        (method, samples): (&dyn Method, Option<u32>),
        budget: Option<Budget>,
        with_picture: bool,
        answer: &mut Answer,
    ) -> Result<Errors> {
        let scene = self.scene_with(samples);
        let shadows = self.build(method, &scene)?;
        (answer.settings, answer.light_samples) = (method.spec().to_string(), samples);
        answer.bytes = Some(BuildReport::of_all(&shadows).bytes);
        if let Some(budget) = budget.filter(Budget::is_of_time) {
            let mut row = Row::default();
            set_times(&self.job, (method, &scene), &[budget], TIMED_RUNS, &mut row)?;
            [answer.build_ms, answer.frame_ms, answer.frames] = [row.build_ms, row.frame_ms, row.frames];
            if let Some(need) = budget.need(&row).filter(|need| *need > budget.amount()) {
                answer.note = format!("{budget}: {need:.2} when measured again");
            }
        }
        let errors = self.visible.weighted(self.job.session, &shadows)?;
        answer.set_errors(&errors)?;
        if with_picture {
            let small = small_scene(&scene);
            let picture = self.job.session.render(&self.build(method, &small)?, &small)?;
            answer.image_rmse = Some(self.picture_error(picture.pixels.view())?);
        }
        Ok(errors)
    }

    /// Returns the scene of the cell with another number of samples of its light.
    fn scene_with(&self, samples: Option<u32>) -> Cow<'a, Scene> {
        let Some(samples) = samples else { return Cow::Borrowed(self.job.scene) };
        let mut scene = self.job.scene.clone();
        scene.lights.iter_mut().for_each(|source| source.samples = samples);
        Cow::Owned(scene)
    }

    fn build(&self, method: &dyn Method, scene: &Scene) -> Result<Vec<ShadowMap>> {
        self.job.session.shadows_of(method, scene)
    }
}

/// Whether a measured answer is not within its budget. Times vary, so they may exceed it a little.
fn exceeds(budget: Budget, answer: &Answer) -> bool {
    let most = budget.amount() * if budget.is_of_time() { TIME_TOLERANCE } else { 1.0 };
    budget.need(&answer.needs()).is_some_and(|need| need > most)
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
            let separated = interval.filter(|[low, _]| !low.is_nan()).map(|[low, _]| low > 0.0);
            Answer { separated, ..answer.clone() }
        }));
    }
    answers
}

/// Extent of the measurement of a cell with the given number of visible points.
pub fn effort(points: usize) -> Effort {
    Effort { points, repeats: 1, ..Effort::default() }
}
