//! Search for the method settings with the smallest error within a budget: a coordinate search on a grid of settings,
//! with exchanges between two axes.
//!
//! The search starts from the default settings. Where these exceed the budget, it starts from the best of the nearest
//! settings within the budget: those with one axis lowered, and those with all ordered axes lowered together.
//!
//! It then tries short and long steps along each axis, because errors may increase before they decrease. A step that
//! reduces the error is taken and repeated. If no single step helps, one axis is raised while another is lowered,
//! within the same budget.
//!
//! Trials are stored and shared by all budgets and both errors. Settings that must exceed a memory budget are not
//! tried: along ordered axes, memory never decreases.

use super::{Budget, ErrorMeasure};
use crate::error::Result;
use crate::measure::table::Row;
use std::collections::HashMap;

/// Default maximum number of new trials in a search for one method's settings, for one budget and one error measure.
pub const MOST_TRIALS: usize = 120;

/// Point on the grid of settings that a search explores: one index per setting of the shadow method.
pub type Place = Vec<usize>;

/// Axis of the grid of settings that a search explores: one setting of the shadow method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SearchAxis {
    /// Number of values that the search may choose for one setting of the shadow method.
    pub len: usize,
    /// Whether memory never decreases with the index of this setting's value. Otherwise the setting's values have no
    /// order.
    pub ordered: bool,
}

type Canonical<'a> = Box<dyn Fn(&[usize]) -> Place + 'a>;
type Attempt<'a> = Box<dyn FnMut(&[usize]) -> Result<Row> + 'a>;

/// Search over the settings of one shadow method, with all its trials.
pub struct Search<'a> {
    axes: Vec<SearchAxis>,
    /// Function that returns the same point of the settings grid for all points whose settings have the same effect.
    canonical: Canonical<'a>,
    /// Function that measures the shadow method with the settings at a point of the settings grid.
    attempt: Attempt<'a>,
    /// Grid points of method settings tried so far, each with its measured table row, in order of trial.
    pub tried: Vec<(Place, Row)>,
    /// Index in the list of trials (`tried`) for each grid point of method settings tried so far.
    known: HashMap<Place, usize>,
    /// Maximum number of new trials of method settings for one budget and one error measure.
    most_trials: usize,
    /// Number of new trials of method settings still allowed for the current budget and error measure.
    left: usize,
}

impl<'a> Search<'a> {
    /// Creates a search over a grid of method settings, with no trials yet. `canonical` maps grid points with
    /// equivalent settings to the same point; `attempt` measures the method with the settings of a grid point.
    pub fn new(
        axes: Vec<SearchAxis>,
        canonical: impl Fn(&[usize]) -> Place + 'a,
        attempt: impl FnMut(&[usize]) -> Result<Row> + 'a,
    ) -> Self {
        let (canonical, attempt) = (Box::new(canonical), Box::new(attempt));
        let (tried, known, most_trials) = (Vec::new(), HashMap::new(), MOST_TRIALS);
        Self { axes, canonical, attempt, tried, known, most_trials, left: 0 }
    }

    /// Limits the new trials of method settings for one budget and one error measure.
    #[must_use]
    pub fn limited_to(self, most_trials: usize) -> Self {
        Self { most_trials, ..self }
    }

    /// Tries known settings, from which later searches may start. Where they exceed the budget, the last ordered setting,
    /// which decides the memory most, is lowered until the budget is satisfied, and where that fails, all ordered settings.
    ///
    /// # Errors
    /// Any error that `attempt` returns.
    pub fn start_from(&mut self, budget: Budget, place: &[usize]) -> Result<()> {
        self.left = MOST_TRIALS;
        let place = (self.canonical)(place);
        if self.is_within(budget, &place)? {
            return Ok(());
        }
        let ordered: Vec<usize> = (0..self.axes.len()).filter(|a| self.axes[*a].ordered).collect();
        if let Some(last) = ordered.last() {
            self.lower(budget, &place, &[*last])?;
        }
        let is_found = self.best_known(budget, ErrorMeasure::Points).is_some();
        if is_found { Ok(()) } else { self.lower(budget, &place, &ordered) }
    }

    /// Searches for the method settings with the smallest error within a budget, from `default` and the best settings
    /// known. Returns `true` if it ended because no step reduced the error, `false` if it used up its trials.
    /// [`Self::best_known`] returns the settings found.
    ///
    /// # Errors
    /// Any error that `attempt` returns.
    pub fn minimize(&mut self, budget: Budget, by: ErrorMeasure, default: &[usize]) -> Result<bool> {
        self.left = self.most_trials;
        self.starts(budget, by, default)?;
        let Some(mut place) = self.best_known(budget, by) else { return Ok(self.left > 0) };
        let moves = self.moves();
        // Cycles through the steps until a whole cycle brings no improvement.
        let (mut at, mut idle) = (0, 0);
        while idle < moves.len() && self.left > 0 {
            match self.stepped(&place, &moves[at]) {
                Some(next) if self.is_closer(budget, by, &next, &place)? => {
                    // The same step is repeated before any other.
                    (place, idle) = (next, 0);
                }
                _ => (at, idle) = ((at + 1) % moves.len(), idle + 1),
            }
        }
        Ok(idle >= moves.len())
    }

    /// Replaces the memory and the times of a trial by those of another measurement of the same settings.
    pub fn correct(&mut self, place: &Place, measured: &Row) {
        for (_, trial) in self.tried.iter_mut().filter(|(tried, _)| tried == place) {
            trial.bytes = measured.bytes;
            (trial.build_ms, trial.frame_ms, trial.frames) =
                (measured.build_ms, measured.frame_ms, measured.frames);
        }
    }

    /// Tries the method's default settings. Where neither they nor earlier trials are within the budget, it lowers all
    /// ordered settings together, then each alone, until the budget is satisfied; where that fails, also with other words
    /// of the unordered settings.
    fn starts(&mut self, budget: Budget, by: ErrorMeasure, default: &[usize]) -> Result<()> {
        let default = (self.canonical)(default);
        let is_within = self.is_within(budget, &default)?;
        // A method without memory has no setting within a memory budget.
        let stores_nothing = self.tried.iter().any(|(_, trial)| budget.stores_nothing(trial));
        if is_within || stores_nothing || self.best_known(budget, by).is_some() {
            return Ok(());
        }
        let ordered: Vec<usize> = (0..self.axes.len()).filter(|a| self.axes[*a].ordered).collect();
        self.lower(budget, &default, &ordered)?;
        ordered.iter().try_for_each(|axis| self.lower(budget, &default, &[*axis]))?;
        // Numbers may have no effect with the default word of another setting.
        let words = self.axes.iter().enumerate().filter(|(_, axis)| !axis.ordered);
        let words: Vec<_> =
            words.flat_map(|(index, axis)| (0..axis.len).map(move |word| (index, word))).collect();
        for (axis, word) in words {
            if self.best_known(budget, by).is_some() {
                break;
            }
            let mut place = default.clone();
            place[axis] = word;
            self.lower(budget, &place, &ordered)?;
        }
        Ok(())
    }

    /// Lowers several settings of a method in proportion until the memory or time budget is satisfied, by bisection.
    fn lower(&mut self, budget: Budget, default: &[usize], axes: &[usize]) -> Result<()> {
        let steps = axes.iter().map(|a| default[*a]).max().unwrap_or(0);
        let at = |search: &Self, step: usize| {
            let mut place = default.to_vec();
            axes.iter().for_each(|a| place[*a] = default[*a] * step / steps.max(1));
            (search.canonical)(&place)
        };
        // Invariant: `low` is within the budget, `high` exceeds it.
        let (mut low, mut high) = (0, steps);
        let lowest = at(self, 0);
        if !self.is_within(budget, &lowest)? {
            return Ok(());
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            let place = at(self, middle);
            if self.is_within(budget, &place)? { low = middle } else { high = middle }
        }
        Ok(())
    }

    /// Returns the steps that the search tries from a point of the settings grid, small ones first. An unordered setting
    /// jumps to each of its values.
    fn moves(&self) -> Vec<Vec<(usize, Step)>> {
        let ordered: Vec<usize> = (0..self.axes.len()).filter(|a| self.axes[*a].ordered).collect();
        let single = |by: [isize; 2]| {
            let of_axis = move |axis: &usize| by.map(|by| vec![(*axis, Step::By(by))]);
            ordered.iter().flat_map(of_axis).collect::<Vec<_>>()
        };
        let exchange = |down: isize| {
            let pairs = ordered.iter().flat_map(|a| ordered.iter().map(move |b| (*a, *b)));
            let step = move |(a, b)| vec![(a, Step::By(1)), (b, Step::By(down))];
            pairs.filter(|(a, b)| a != b).map(step).collect::<Vec<_>>()
        };
        let words = self.axes.iter().enumerate().filter(|(_, axis)| !axis.ordered);
        let jumps = words.flat_map(|(index, axis)| (0..axis.len).map(move |to| vec![(index, Step::To(to))]));
        let near = [single([1, -1]), jumps.collect(), exchange(-1)];
        let far = [single([2, -2]), exchange(-2), single([4, -4])];
        near.into_iter().chain(far).flatten().collect()
    }

    /// Returns the point of the settings grid after a search step; `None` if the step leaves the grid or changes
    /// nothing.
    fn stepped(&self, place: &[usize], step: &[(usize, Step)]) -> Option<Place> {
        let mut next = place.to_vec();
        for (axis, step) in step {
            let index = match step {
                Step::To(index) => *index,
                Step::By(by) => next[*axis].checked_add_signed(*by)?,
            };
            if index >= self.axes[*axis].len {
                return None;
            }
            next[*axis] = index;
        }
        let next = (self.canonical)(&next);
        (next != place).then_some(next)
    }

    fn is_closer(&mut self, budget: Budget, by: ErrorMeasure, next: &Place, than: &Place) -> Result<bool> {
        if !self.is_within(budget, next)? {
            return Ok(false);
        }
        Ok(match (self.score(budget, by, next), self.score(budget, by, than)) {
            (Some(a), Some(b)) => a < b,
            (a, b) => a.is_some() && b.is_none(),
        })
    }

    /// Returns the error of a method with settings already tried, followed by its memory or time to break ties.
    fn score(&self, budget: Budget, by: ErrorMeasure, place: &Place) -> Option<(f64, f64)> {
        let trial = &self.tried[*self.known.get(place)?].1;
        Some((by.error(trial)?, budget.need(trial)?))
    }

    /// Returns the grid point of the tried method settings with the smallest error within a budget; `None` where no
    /// trial satisfies the budget.
    pub fn best_known(&self, budget: Budget, by: ErrorMeasure) -> Option<Place> {
        let allowed = self.tried.iter().filter(|(_, t)| budget.holds(t));
        let scored = allowed.filter_map(|(place, _)| Some((self.score(budget, by, place)?, place)));
        scored
            .min_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(std::cmp::Ordering::Equal))
            .map(|(_, place)| place.clone())
    }

    /// Whether a method satisfies a budget with the settings at a point of the settings grid. Measures the method if
    /// these settings were not tried yet.
    fn is_within(&mut self, budget: Budget, place: &Place) -> Result<bool> {
        if let Some(found) = self.known.get(place) {
            return Ok(budget.holds(&self.tried[*found].1));
        }
        if self.left == 0 || self.must_exceed(budget, place) {
            return Ok(false);
        }
        self.left -= 1;
        let trial = (self.attempt)(place)?;
        self.known.insert(place.clone(), self.tried.len());
        self.tried.push((place.clone(), trial));
        self.is_within(budget, place)
    }

    /// Whether a tried grid point with smaller or equal settings has already exceeded the memory budget, so that this
    /// grid point must exceed it too.
    fn must_exceed(&self, budget: Budget, place: &Place) -> bool {
        let no_larger = |other: &Place| {
            let each = self.axes.iter().zip(other).zip(place);
            each.into_iter().all(|((axis, a), b)| if axis.ordered { a <= b } else { a == b })
        };
        let over = |t: &Row| budget.need(t).is_some_and(|need| need > budget.amount());
        matches!(budget, Budget::Bytes(_)) && self.tried.iter().any(|(other, t)| over(t) && no_larger(other))
    }
}

/// Search step for one setting of a method: a change of the value's index, or a new index.
#[derive(Debug, Clone, Copy)]
enum Step {
    By(isize),
    To(usize),
}

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
