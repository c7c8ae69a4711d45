//! Settings of a shadow method that are searched in a cell: those of its search space, and under a light with a size the
//! number of samples that represent the light.

use super::answer::Answer;
use crate::error::Result;
use crate::measure::budget::search::SearchAxis;
use crate::scene::LightSource;
use crate::shadow::{Entry, Method, MethodSpec, SearchSpace};
use itertools::Itertools as _;

/// Numbers of samples that are tried for a light with a size, each sample with a shadow map.
const SAMPLES: [u32; 5] = [4, 8, 16, 32, 64];

/// Searched settings of a shadow method under a light. A place is, under a light with a size, an index into the numbers
/// of samples, then one for each axis of the method's search space.
pub struct Settings<'a> {
    space: SearchSpace,
    source: &'a LightSource,
}

impl<'a> Settings<'a> {
    /// Searched settings of a method; `None` if it has none.
    pub fn of(entry: &'static Entry, source: &'a LightSource) -> Option<Self> {
        SearchSpace::of(entry).map(|space| Self { space, source })
    }

    /// Returns the axes of the search.
    pub fn axes(&self) -> Vec<SearchAxis> {
        let of_method =
            self.space.axes().iter().map(|axis| SearchAxis { len: axis.len(), ordered: axis.ordered });
        let samples = self.source.is_soft().then_some(SearchAxis { len: SAMPLES.len(), ordered: true });
        samples.into_iter().chain(of_method).collect()
    }

    /// Returns the place at which a search starts.
    pub fn default_place(&self) -> Vec<usize> {
        let samples = self.source.is_soft().then_some(index_of(self.source.samples));
        samples.into_iter().chain(self.space.default_place()).collect()
    }

    /// Returns the places of the distinct settings of answers.
    ///
    /// # Errors
    /// Settings do not parse.
    pub fn places_of<'b>(&self, answers: impl Iterator<Item = &'b Answer>) -> Result<Vec<Vec<usize>>> {
        let distinct = answers.map(|answer| (&answer.settings, answer.light_samples)).unique();
        let place = |(settings, samples): (&String, Option<u32>)| {
            let of_method = self.space.place_of(&settings.parse::<MethodSpec>()?);
            let samples = self.source.is_soft().then(|| index_of(samples.unwrap_or(self.source.samples)));
            Ok(samples.into_iter().chain(of_method).collect())
        };
        distinct.map(place).collect()
    }

    /// Replaces settings without effect by their defaults.
    pub fn canonical(&self, place: &[usize]) -> Vec<usize> {
        let (samples, of_method) = self.split(place);
        let samples = samples.map(|index| if self.is_covered(of_method) { 0 } else { index });
        samples.into_iter().chain(self.space.canonical(of_method)).collect()
    }

    /// Creates the shadow method at a place, with the number of samples of the light if it has a size and one map does
    /// not answer for all of it; `None` for invalid settings.
    pub fn method(&self, place: &[usize]) -> Option<(Box<dyn Method>, Option<u32>)> {
        let (samples, of_method) = self.split(place);
        let samples = samples.filter(|_| !self.is_covered(of_method)).map(|index| SAMPLES[index]);
        Some((self.space.method(of_method)?, samples))
    }

    /// Splits a place into the index of the number of samples, if any, and the indices for the method.
    fn split<'b>(&self, place: &'b [usize]) -> (Option<usize>, &'b [usize]) {
        let (samples, of_method) = place.split_at(place.len() - self.space.axes().len());
        (samples.first().copied(), of_method)
    }

    /// Whether one map of the method answers for the whole light.
    fn is_covered(&self, of_method: &[usize]) -> bool {
        self.space.method(of_method).is_some_and(|method| method.covers(&self.source.extent))
    }
}

/// Returns the index of the largest number of samples that is at most `samples`.
fn index_of(samples: u32) -> usize {
    SAMPLES.iter().rposition(|tried| *tried <= samples).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::entry;

    fn source(text: &str) -> LightSource {
        crate::open::values::light(text).unwrap()
    }

    #[test]
    fn a_light_with_a_size_adds_an_axis_of_samples() {
        let (hard, soft) = (source("dir:0,0,1"), source("sun:0,0,1,angle=10,samples=20"));
        let [hard, soft] = [&hard, &soft].map(|s| Settings::of(entry("dsm").unwrap(), s).unwrap());
        assert_eq!(soft.axes().len(), hard.axes().len() + 1);
        assert!(hard.method(&hard.default_place()).unwrap().1.is_none());
        let (method, samples) = soft.method(&soft.default_place()).unwrap();
        assert_eq!(samples, Some(16));
        let answer =
            Answer { settings: method.spec().to_string(), light_samples: samples, ..Answer::default() };
        assert_eq!(soft.places_of([&answer, &answer].into_iter()).unwrap(), [soft.default_place()]);
    }

    #[test]
    fn samples_do_not_matter_where_one_map_answers_for_the_light() {
        let soft = source("sun:0,0,1,angle=10");
        let settings = Settings::of(entry("sat").unwrap(), &soft).unwrap();
        let [mut one, mut other] = [settings.default_place(), settings.default_place()];
        (one[0], other[0]) = (1, 3);
        assert_eq!(settings.canonical(&one), settings.canonical(&other));
        assert_eq!(settings.method(&one).unwrap().1, None);
    }
}
