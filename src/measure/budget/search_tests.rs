//! Tests of the search for method settings, on synthetic memory, times and errors, against an exhaustive search of
//! the grid of settings.

use super::*;
use std::cell::Cell;

/// Synthetic memory, times and errors of a shadow method with four settings: map size, layers, a named choice, and a
/// number that has no effect under the second choice.
#[derive(Clone, Copy)]
struct Planted {
    /// Coefficients of the synthetic error: `texel` for the reciprocal map size, `layer` for the reciprocal number of
    /// layers.
    texel: f64,
    layer: f64,
    /// Synthetic error that each value of the named setting adds.
    words: [f64; 3],
    /// Synthetic error added at the second and third number of layers; it makes the error not monotone.
    bump: f64,
}

const AXES: [SearchAxis; 4] = [
    SearchAxis { len: 9, ordered: true },
    SearchAxis { len: 8, ordered: true },
    SearchAxis { len: 3, ordered: false },
    SearchAxis { len: 4, ordered: true },
];
const DEFAULT: [usize; 4] = [5, 4, 0, 2];

impl Planted {
    fn trial(&self, place: &[usize]) -> Row {
        let map = 64.0 * 2f64.powf(0.5 * place[0] as f64);
        let layers = 2f64.powi(place[1] as i32);
        let ratio = 0.1 * (place[3] as f64 - 2.0).abs();
        let bump = if (1..3).contains(&place[1]) { self.bump } else { 0.0 };
        let error = self.texel / map + self.layer / layers + self.words[place[2]] + 0.01 * ratio + bump;
        Row {
            bytes: Some((map * map * (layers + 1.0)) as u64),
            build_ms: Some(1e-5 * map * map * layers),
            frame_ms: Some(if place[2] == 2 { 20.0 } else { 10.0 }),
            point_err_rms: Some(error),
            image_rmse: Some(0.3 * error + 1e-3 * place[2] as f64),
            ..Row::default()
        }
    }
}

fn canonical(place: &[usize]) -> Place {
    let mut place = place.to_vec();
    if place[2] == 1 {
        place[3] = DEFAULT[3];
    }
    place
}

fn every_place() -> Vec<Place> {
    let mut places = vec![Vec::new()];
    for axis in AXES {
        places = places.iter().flat_map(|p| (0..axis.len).map(move |i| [&p[..], &[i]].concat())).collect();
    }
    places
}

/// Returns the smallest synthetic error of all settings of the method within a budget, by exhaustive search.
fn least(planted: &Planted, budget: Budget, by: ErrorMeasure) -> Option<f64> {
    let trials = every_place().into_iter().map(|p| planted.trial(&canonical(&p)));
    let allowed = trials.filter(|t| budget.need(t).unwrap() <= budget.amount());
    allowed.filter_map(|t| by.error(&t)).reduce(f64::min)
}

#[test]
fn the_closest_of_the_whole_grid_is_found_in_a_part_of_its_trials() {
    let mut most = 0;
    for (texel, layer, bump) in
        [(1.0, 0.2, 0.0), (8.0, 0.02, 0.0), (0.1, 1.0, 0.0), (3.0, 0.0, 0.0), (0.5, 0.3, 0.3)]
    {
        for words in [[0.02, 0.0, 0.01], [0.0, 0.02, 0.001], [0.01, 0.01, 0.0]] {
            let planted = Planted { texel, layer, words, bump };
            let tries = Cell::new(0);
            let attempt = |place: &[usize]| {
                tries.set(tries.get() + 1);
                Ok(planted.trial(place))
            };
            let mut search = Search::new(AXES.to_vec(), canonical, attempt);
            let budgets = [
                Budget::Bytes(64 * 64 * 3),
                Budget::Bytes(200_000),
                Budget::Bytes(2 << 20),
                Budget::Bytes(64 << 20),
                Budget::Ms(12.0),
                Budget::Ms(25.0),
            ];
            for budget in budgets {
                for by in ErrorMeasure::ALL {
                    assert!(search.minimize(budget, by, &DEFAULT).unwrap(), "it came to its end");
                    let trial = planted.trial(&search.best_known(budget, by).unwrap());
                    let (got, want) = (by.error(&trial).unwrap(), least(&planted, budget, by).unwrap());
                    assert!(budget.need(&trial).unwrap() <= budget.amount());
                    assert!(got <= want * 1.000_001, "{budget} {by:?}: {got}, not {want}");
                }
            }
            assert_eq!(search.tried.len(), tries.get(), "nothing is tried twice");
            most = most.max(tries.get());
        }
    }
    // Six budgets and two errors together, of 864 places.
    println!("at most {most} trials");
    assert!(most < 864 / 2, "{most}");
}

#[test]
fn what_no_setting_can_do_is_not_found_and_costs_little() {
    let planted = Planted { texel: 1.0, layer: 0.2, words: [0.0; 3], bump: 0.0 };
    let mut search = Search::new(AXES.to_vec(), canonical, |p| Ok(planted.trial(p)));
    let mut found = |budget, by| {
        search.minimize(budget, by, &DEFAULT).unwrap();
        (search.best_known(budget, by), search.tried.len())
    };
    // Tried: the default settings, and all axes lowered together with each of three words. No lowering of a single axis
    // needs less memory.
    assert_eq!(found(Budget::Bytes(100), ErrorMeasure::Points), (None, 4));
    // For times, this is not certain, so single axes are tried too, but only once.
    assert_eq!(found(Budget::Ms(1.0), ErrorMeasure::Points), (None, 7));
    assert_eq!(found(Budget::Ms(2.0), ErrorMeasure::Picture), (None, 7));
}

#[test]
fn a_setting_that_needs_another_word_is_found() {
    // The number has an effect only with the second word.
    let canonical = |place: &[usize]| if place[1] == 0 { vec![3, 0] } else { place.to_vec() };
    let attempt = |place: &[usize]| {
        let ms = if place[1] == 0 { 100.0 } else { 1.0 + 10.0 * place[0] as f64 };
        Ok(Row {
            bytes: Some(0),
            build_ms: Some(0.0),
            frame_ms: Some(ms),
            point_err_rms: Some(1.0 / ms),
            ..Row::default()
        })
    };
    let axes = vec![SearchAxis { len: 4, ordered: true }, SearchAxis { len: 2, ordered: false }];
    let mut search = Search::new(axes, canonical, attempt);
    search.minimize(Budget::Ms(15.0), ErrorMeasure::Points, &[3, 0]).unwrap();
    assert_eq!(search.best_known(Budget::Ms(15.0), ErrorMeasure::Points), Some(vec![1, 1]));
    let tried = search.tried.len();
    search.minimize(Budget::Bytes(1000), ErrorMeasure::Points, &[3, 0]).unwrap();
    assert_eq!(
        (search.best_known(Budget::Bytes(1000), ErrorMeasure::Points), search.tried.len()),
        (None, tried)
    );
}

#[test]
fn known_settings_that_exceed_a_budget_are_lowered_by_their_size_alone() {
    let planted = Planted { texel: 1.0, layer: 0.2, words: [0.0; 3], bump: 0.0 };
    // The size of the map is the last axis.
    let turned = |place: &[usize]| planted.trial(&[place[2], place[0], place[1], 2]);
    let axes = vec![AXES[1], AXES[2], AXES[0]];
    let mut search = Search::new(axes, <[usize]>::to_vec, |place| Ok(turned(place)));
    let known = [6, 1, 8];
    let budget = Budget::Bytes(turned(&[6, 1, 4]).bytes.unwrap());
    search.start_from(budget, &known).unwrap();
    assert_eq!(search.best_known(budget, ErrorMeasure::Points), Some(vec![6, 1, 4]));
    assert!(search.tried.iter().all(|(place, _)| place[..2] == known[..2]));
}

#[test]
fn what_is_sure_to_overrun_is_not_tried() {
    let planted = Planted { texel: 8.0, layer: 0.0, words: [0.0; 3], bump: 0.0 };
    let budget = Budget::Bytes(200_000);
    let mut search = Search::new(AXES.to_vec(), canonical, |p| Ok(planted.trial(p)));
    search.minimize(budget, ErrorMeasure::Points, &DEFAULT).unwrap();
    for (i, (place, _)) in search.tried.iter().enumerate() {
        let over = search.tried[..i].iter().filter(|(_, t)| t.bytes.unwrap() > 200_000);
        for (other, _) in over {
            let larger = place[0] >= other[0] && place[1] >= other[1] && place[3] >= other[3];
            assert!(!(larger && place[2] == other[2]), "{place:?} after {other:?}");
        }
    }
}

#[test]
fn failures_and_gaps_are_walked_around_and_an_end_is_an_end() {
    let planted = Planted { texel: 1.0, layer: 0.2, words: [0.0; 3], bump: 0.0 };
    // The two largest map sizes cannot be allocated; one error is NaN.
    let attempt = |place: &[usize]| {
        let trial = planted.trial(place);
        Ok(match place[0] {
            7.. => Row { note: "cannot allocate".into(), ..Row::default() },
            6 => Row { point_err_rms: Some(f64::NAN), ..trial },
            _ => trial,
        })
    };
    let mut search = Search::new(AXES.to_vec(), canonical, attempt);
    search.minimize(Budget::Bytes(1 << 40), ErrorMeasure::Points, &DEFAULT).unwrap();
    let place = search.best_known(Budget::Bytes(1 << 40), ErrorMeasure::Points).unwrap();
    assert_eq!((place[0], place[1]), (5, 7));
    drop(search);
    let mut left = 7;
    let attempt = |place: &[usize]| {
        left -= 1;
        if left == 0 { Err(crate::error::Error::cancelled("trial")) } else { Ok(planted.trial(place)) }
    };
    let mut search = Search::new(AXES.to_vec(), canonical, attempt);
    assert!(search.minimize(Budget::Ms(50.0), ErrorMeasure::Points, &DEFAULT).unwrap_err().is_cancelled());
    assert_eq!(search.tried.len(), 6);
}
