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

use super::{Budget, By};
use crate::error::Result;
use crate::measure::table::Row;
use std::collections::HashMap;

/// Largest number of new trials of one method's settings for one budget and one error measure.
pub const MOST_TRIALS: usize = 120;

/// Point on the grid of method settings: an index along each axis.
pub type Place = Vec<usize>;

/// Axis of the grid of method settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// Number of setting values along this axis of the search grid.
    pub len: usize,
    /// Whether the method's memory never decreases along this axis of settings. Otherwise the values have no order.
    pub ordered: bool,
}

type Canonical<'a> = Box<dyn Fn(&[usize]) -> Place + 'a>;
type Attempt<'a> = Box<dyn FnMut(&[usize]) -> Result<Row> + 'a>;

/// Search over the settings of one shadow method, with all its trials.
pub struct Search<'a> {
    sides: Vec<Side>,
    /// Maps grid points with equal effective settings to the same grid point.
    canonical: Canonical<'a>,
    /// Measures the method with the settings of a grid point.
    attempt: Attempt<'a>,
    /// Grid points of settings tried so far with their measured rows, in order of trial.
    pub tried: Vec<(Place, Row)>,
    /// Index of each tried grid point in `tried`.
    known: HashMap<Place, usize>,
    /// Number of new trials left for the current budget and error measure.
    left: usize,
}

impl<'a> Search<'a> {
    /// Creates a search over a grid of method settings, with no trials yet. `canonical` unifies grid points with
    /// equal settings; `attempt` measures a grid point.
    pub fn new(
        sides: Vec<Side>,
        canonical: impl Fn(&[usize]) -> Place + 'a,
        attempt: impl FnMut(&[usize]) -> Result<Row> + 'a,
    ) -> Self {
        let (canonical, attempt) = (Box::new(canonical), Box::new(attempt));
        Self { sides, canonical, attempt, tried: Vec::new(), known: HashMap::new(), left: 0 }
    }

    /// Searches for the settings with the smallest error within a budget, from `default` and the best settings known.
    /// Returns whether it ended because no step improved, not because trials ran out. [`Self::best_known`] returns
    /// the result.
    ///
    /// # Errors
    /// Any error that `attempt` returns.
    pub fn look(&mut self, budget: Budget, by: By, default: &[usize]) -> Result<bool> {
        self.left = MOST_TRIALS;
        self.starts(budget, default)?;
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

    /// Tries the default settings. Where they exceed the budget, it lowers all ordered axes together, then each
    /// alone, to the last grid point within the budget.
    fn starts(&mut self, budget: Budget, default: &[usize]) -> Result<()> {
        let default = (self.canonical)(default);
        if self.is_held(budget, &default)? {
            return Ok(());
        }
        let ordered: Vec<usize> = (0..self.sides.len()).filter(|a| self.sides[*a].ordered).collect();
        self.lower(budget, &default, &ordered)?;
        ordered.iter().try_for_each(|axis| self.lower(budget, &default, &[*axis]))
    }

    /// Lowers some axes of the settings grid in proportion until the budget is satisfied, by bisection.
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
        if !self.is_held(budget, &lowest)? {
            return Ok(());
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            let place = at(self, middle);
            if self.is_held(budget, &place)? { low = middle } else { high = middle }
        }
        Ok(())
    }

    /// Returns the search steps, as changes of grid indices. An unordered axis jumps to each of its values.
    fn moves(&self) -> Vec<Vec<(usize, Step)>> {
        let ordered: Vec<usize> = (0..self.sides.len()).filter(|a| self.sides[*a].ordered).collect();
        let mut moves = Vec::new();
        for (axis, side) in self.sides.iter().enumerate() {
            if side.ordered {
                moves.extend([1, -1, 2, -2, 4, -4].map(|by| vec![(axis, Step::By(by))]));
            } else {
                moves.extend((0..side.len).map(|to| vec![(axis, Step::To(to))]));
            }
        }
        for (up, down) in
            ordered.iter().flat_map(|a| ordered.iter().map(move |b| (*a, *b))).filter(|(a, b)| a != b)
        {
            moves.push(vec![(up, Step::By(1)), (down, Step::By(-1))]);
            moves.push(vec![(up, Step::By(1)), (down, Step::By(-2))]);
        }
        moves
    }

    /// Returns the grid point that a search step leads to; `None` off the grid or where the settings stay equal.
    fn stepped(&self, place: &[usize], step: &[(usize, Step)]) -> Option<Place> {
        let mut next = place.to_vec();
        for (axis, step) in step {
            let index = match step {
                Step::To(index) => *index,
                Step::By(by) => next[*axis].checked_add_signed(*by)?,
            };
            if index >= self.sides[*axis].len {
                return None;
            }
            next[*axis] = index;
        }
        let next = (self.canonical)(&next);
        (next != place).then_some(next)
    }

    fn is_closer(&mut self, budget: Budget, by: By, next: &Place, than: &Place) -> Result<bool> {
        if !self.is_held(budget, next)? {
            return Ok(false);
        }
        Ok(match (self.score(budget, by, next), self.score(budget, by, than)) {
            (Some(a), Some(b)) => a < b,
            (a, b) => a.is_some() && b.is_none(),
        })
    }

    /// Returns the error of tried settings, followed by their memory or time to break ties.
    fn score(&self, budget: Budget, by: By, place: &Place) -> Option<(f64, f64)> {
        let trial = &self.tried[*self.known.get(place)?].1;
        Some((by.error(trial)?, budget.need(trial)?))
    }

    /// Returns the tried settings with the smallest error within a budget; `None` where no trial satisfies the
    /// budget.
    pub fn best_known(&self, budget: Budget, by: By) -> Option<Place> {
        let allowed = self.tried.iter().filter(|(_, t)| budget.holds(t));
        let scored = allowed.filter_map(|(place, _)| Some((self.score(budget, by, place)?, place)));
        scored
            .min_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(std::cmp::Ordering::Equal))
            .map(|(_, place)| place.clone())
    }

    /// Whether the settings of a grid point satisfy a budget. Tries them where they were not tried yet.
    fn is_held(&mut self, budget: Budget, place: &Place) -> Result<bool> {
        if let Some(found) = self.known.get(place) {
            return Ok(budget.holds(&self.tried[*found].1));
        }
        if self.left == 0 || self.is_surely_over(budget, place) {
            return Ok(false);
        }
        self.left -= 1;
        let trial = (self.attempt)(place)?;
        self.known.insert(place.clone(), self.tried.len());
        self.tried.push((place.clone(), trial));
        self.is_held(budget, place)
    }

    /// Whether smaller settings have already exceeded a memory budget: no larger along any ordered axis and equal
    /// along the others.
    fn is_surely_over(&self, budget: Budget, place: &Place) -> bool {
        let no_larger = |other: &Place| {
            let each = self.sides.iter().zip(other).zip(place);
            each.into_iter().all(|((side, a), b)| if side.ordered { a <= b } else { a == b })
        };
        let over = |t: &Row| budget.need(t).is_some_and(|need| need > budget.amount());
        matches!(budget, Budget::Bytes(_)) && self.tried.iter().any(|(other, t)| over(t) && no_larger(other))
    }
}

/// Search step along one axis of the settings grid: a relative or an absolute index.
#[derive(Debug, Clone, Copy)]
enum Step {
    By(isize),
    To(usize),
}

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
