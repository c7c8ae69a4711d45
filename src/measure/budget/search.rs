//! The search itself, whatever is searched: on a grid of settings, one axis at a time and by trades between two.
//!
//! It starts from the place of the defaults, or where a budget does not hold it, from the closest of the places nearest to
//! it that the budget holds: those with one axis lowered, and that with all ordered axes lowered together. From there
//! steps along each axis are tried, short and long, since errors may rise before they fall; one that is closer is taken,
//! and taken again. Where none is, one axis is raised while another is lowered: what a budget that is spent still allows.
//! Trials are stored, so that all budgets and both errors draw on one stock. What is sure to need too many bytes is not
//! tried: along ordered axes a budget that was overrun stays so.

use super::{Budget, By};
use crate::error::Result;
use crate::measure::table::Row;
use std::collections::HashMap;

/// New trials that one budget and error may take of a method.
pub const MOST_TRIALS: usize = 120;

/// A place on the grid: an index along each axis.
pub type Place = Vec<usize>;

/// An axis of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// Values along it.
    pub len: usize,
    /// Whether memory never falls along it; otherwise values stand in no order.
    pub ordered: bool,
}

type Canonical<'a> = Box<dyn Fn(&[usize]) -> Place + 'a>;
type Attempt<'a> = Box<dyn FnMut(&[usize]) -> Result<Row> + 'a>;

/// Search over the settings of one method, with all its trials.
pub struct Search<'a> {
    /// The grid.
    sides: Vec<Side>,
    /// Canonical place of settings: places with equal settings have one.
    canonical: Canonical<'a>,
    /// Tries a place.
    attempt: Attempt<'a>,
    /// Places tried so far with their trials, in order.
    pub tried: Vec<(Place, Row)>,
    /// Places in `tried`.
    known: HashMap<Place, usize>,
    /// New trials that are left to the question at hand.
    left: usize,
}

impl<'a> Search<'a> {
    /// Creates a search without trials.
    pub fn new(
        sides: Vec<Side>,
        canonical: impl Fn(&[usize]) -> Place + 'a,
        attempt: impl FnMut(&[usize]) -> Result<Row> + 'a,
    ) -> Self {
        let (canonical, attempt) = (Box::new(canonical), Box::new(attempt));
        Self { sides, canonical, attempt, tried: Vec::new(), known: HashMap::new(), left: 0 }
    }

    /// Looks for the place with the least error that a budget holds, as far as steps from `default` and from the best that
    /// is known lead; [`Self::best_known`] is what came of it. Whether it ended since no step was closer, and not for want
    /// of trials.
    ///
    /// # Errors
    /// What `attempt` refuses.
    pub fn look(&mut self, budget: Budget, by: By, default: &[usize]) -> Result<bool> {
        self.left = MOST_TRIALS;
        self.starts(budget, default)?;
        let Some(mut place) = self.best_known(budget, by) else { return Ok(self.left > 0) };
        let moves = self.moves();
        // Around the list of steps until a whole turn has brought nothing.
        let (mut at, mut idle) = (0, 0);
        while idle < moves.len() && self.left > 0 {
            match self.stepped(&place, &moves[at]) {
                Some(next) if self.is_closer(budget, by, &next, &place)? => {
                    // The same step again, before any other.
                    (place, idle) = (next, 0);
                }
                _ => (at, idle) = ((at + 1) % moves.len(), idle + 1),
            }
        }
        Ok(idle >= moves.len())
    }

    /// Tries the default, and where the budget does not hold it, lowers all ordered axes together, and each alone, to the
    /// last place that it holds.
    fn starts(&mut self, budget: Budget, default: &[usize]) -> Result<()> {
        let default = (self.canonical)(default);
        if self.is_held(budget, &default)? {
            return Ok(());
        }
        let ordered: Vec<usize> = (0..self.sides.len()).filter(|a| self.sides[*a].ordered).collect();
        self.lower(budget, &default, &ordered)?;
        ordered.iter().try_for_each(|axis| self.lower(budget, &default, &[*axis]))
    }

    /// Lowers some axes in step until the budget holds the place, halving the way there.
    fn lower(&mut self, budget: Budget, default: &[usize], axes: &[usize]) -> Result<()> {
        let steps = axes.iter().map(|a| default[*a]).max().unwrap_or(0);
        let at = |search: &Self, step: usize| {
            let mut place = default.to_vec();
            axes.iter().for_each(|a| place[*a] = default[*a] * step / steps.max(1));
            (search.canonical)(&place)
        };
        // Within the budget at `low`, beyond it at `high`.
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

    /// Steps, as changes of index; an unordered axis goes to each of its other values.
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

    /// The place that a step leads to, where that is another one on the grid.
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

    /// Error, and where that is the same the need.
    fn score(&self, budget: Budget, by: By, place: &Place) -> Option<(f64, f64)> {
        let trial = &self.tried[*self.known.get(place)?].1;
        Some((by.error(trial)?, budget.need(trial)?))
    }

    /// The place of the least error that the budget holds, of all that was tried; `None` where it holds nothing.
    pub fn best_known(&self, budget: Budget, by: By) -> Option<Place> {
        let allowed = self.tried.iter().filter(|(_, t)| budget.holds(t));
        let scored = allowed.filter_map(|(place, _)| Some((self.score(budget, by, place)?, place)));
        scored
            .min_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(std::cmp::Ordering::Equal))
            .map(|(_, place)| place.clone())
    }

    /// Whether a budget holds a place, which is tried where that is not known.
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

    /// Whether a place that is no larger along any ordered axis, and the same along the others, has overrun the bytes.
    fn is_surely_over(&self, budget: Budget, place: &Place) -> bool {
        let no_larger = |other: &Place| {
            let each = self.sides.iter().zip(other).zip(place);
            each.into_iter().all(|((side, a), b)| if side.ordered { a <= b } else { a == b })
        };
        let over = |t: &Row| budget.need(t).is_some_and(|need| need > budget.amount());
        matches!(budget, Budget::Bytes(_)) && self.tried.iter().any(|(other, t)| over(t) && no_larger(other))
    }
}

/// Along one axis.
#[derive(Debug, Clone, Copy)]
enum Step {
    By(isize),
    To(usize),
}

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
