//! Ranking of shadow methods over the cells of the benchmark: shares of cells won, mean ranks and their critical
//! difference.
//!
//! Cells of one volume are alike, so two intervals of a share are given: Wilson's (1927, *Probable inference*), which takes
//! the cells as independent, and one by a bootstrap over volumes. Ranks are averaged within each volume, and the volume
//! ranks the methods by these means. The critical difference (Nemenyi's test; Demšar 2006, *Statistical comparisons of
//! classifiers over multiple data sets*) is that of as many samples as there are volumes. Methods that have no answer in
//! any cell take no part.
//!
//! A tie for the least error counts for each tied method. Errors below [`FLOAT32_ERROR`] count as this error, so methods
//! that differ by float32 rounding alone are tied.

use super::answer::{Answer, CellResult};
use crate::random::Chance;
use itertools::Itertools as _;
use serde::Serialize;

/// Error of transmittance that float32 rounding alone causes. The ranking raises smaller errors to it.
pub const FLOAT32_ERROR: f64 = 1e-6;
/// Quantile of the normal distribution for 95 % intervals.
const Z: f64 = 1.96;
/// Number of samples of the bootstrap over volumes, and its seed.
const BOOTSTRAP_SAMPLES: usize = 2000;
const BOOTSTRAP_SEED: u64 = 23;
/// Critical values of Nemenyi's test at 5 % for 2 to 16 methods: quantiles of the studentized range, divided by the root
/// of 2 (Demšar 2006, table 5; the values beyond 10 from the same distribution).
const NEMENYI: [f64; 15] =
    [1.960, 2.343, 2.569, 2.728, 2.850, 2.949, 3.031, 3.102, 3.164, 3.219, 3.268, 3.313, 3.354, 3.391, 3.426];

/// Row of `ranking.csv`: a shadow method or external program within one budget, over all cells of the benchmark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rank {
    /// Budget within which settings were searched, in the syntax of `--budget`.
    pub budget: String,
    /// Name of the shadow method or external program.
    pub method: String,
    /// Number of cells that were measured.
    pub cells: usize,
    /// Number of cells in which the method has settings within the budget.
    pub answered: usize,
    /// Number of cells in which the method has the least error, alone or with others.
    pub won: usize,
    /// Share of cells in which the method has the least error, alone or with others.
    pub share: f64,
    /// Lower end of Wilson's 95 % interval of `share`, which takes cells as independent.
    pub share_lo: f64,
    /// Upper end of Wilson's 95 % interval of `share`.
    pub share_hi: f64,
    /// Lower end of the 95 % interval of `share` by a bootstrap over volumes; `None` for a single volume.
    pub share_volumes_lo: Option<f64>,
    /// Upper end of the 95 % interval of `share` by a bootstrap over volumes.
    pub share_volumes_hi: Option<f64>,
    /// Number of cells in which the method has the least error, or one that a paired bootstrap does not distinguish from
    /// it.
    pub not_separated: usize,
    /// Mean over volumes of the method's rank in each; a volume ranks methods by their mean rank in its cells.
    pub mean_rank: f64,
    /// Difference of mean ranks from which two methods within this budget differ, see [`Ranking`].
    pub critical_difference: Option<f64>,
    /// Geometric mean of the ratio of the method's error to the least error of the cell, over the cells with an answer.
    pub ratio: Option<f64>,
}

/// Ranking of all methods within one budget.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranking {
    /// Budget within which settings were searched, in the syntax of `--budget`.
    pub budget: String,
    /// Ranks of all methods, the least mean rank first.
    pub ranks: Vec<Rank>,
    /// Difference of mean ranks from which two methods differ (Nemenyi's test at 5 %); `None` for one method, more than
    /// 16, or one volume.
    pub critical_difference: Option<f64>,
    /// Number of volumes of the measured cells.
    pub volumes: usize,
}

/// Returns the methods with the least error of a cell within a budget, all of them if there is a tie. Errors below
/// [`FLOAT32_ERROR`] are tied.
pub fn winners<'a>(result: &'a CellResult, budget: &str) -> Vec<&'a str> {
    let answers = result.answers.iter().filter(|a| a.budget == budget && a.point_err_rms.is_some());
    let answers: Vec<&Answer> = answers.collect();
    let least = least(&answers);
    answers.into_iter().filter(|answer| ranked_error(answer) == least).map(|answer| &*answer.method).collect()
}

/// Returns the error by which an answer is ranked, at least [`FLOAT32_ERROR`]; infinite where there is no answer.
fn ranked_error(answer: &Answer) -> f64 {
    answer.error().max(FLOAT32_ERROR)
}

/// Returns the least ranked error of several answers; infinite where there is none.
fn least(answers: &[&Answer]) -> f64 {
    answers.iter().map(|answer| ranked_error(answer)).fold(f64::INFINITY, f64::min)
}

/// Answers of one cell to one budget, with the rank of each, the methods with the least error, and this error.
struct Ranked<'a> {
    volume: &'a str,
    answers: Vec<(&'a Answer, f64)>,
    winners: Vec<&'a str>,
    least: f64,
}

impl<'a> Ranked<'a> {
    /// Ranks the answers of a cell by error. Equal errors share the mean of their ranks; methods without an answer share
    /// the last.
    fn of(result: &'a CellResult, budget: &str, methods: &[&str]) -> Self {
        let own = |a: &&Answer| a.budget == budget && methods.contains(&&*a.method);
        let answers: Vec<&Answer> = result.answers.iter().filter(own).collect();
        let errors: Vec<f64> = answers.iter().map(|answer| ranked_error(answer)).collect();
        Self {
            volume: &result.volume,
            least: least(&answers),
            winners: winners(result, budget),
            answers: answers.into_iter().zip(ranks(&errors)).collect(),
        }
    }

    fn of_method(&self, method: &str) -> Option<(&'a Answer, f64)> {
        self.answers.iter().find(|(answer, _)| answer.method == method).copied()
    }

    fn is_won_by(&self, method: &str) -> bool {
        self.winners.contains(&method)
    }
}

/// Ranks the methods within each budget, from the results of cells.
pub fn rankings(results: &[CellResult]) -> Vec<Ranking> {
    let budgets = results.iter().flat_map(|r| &r.answers).map(|a| &a.budget).unique();
    budgets.map(|budget| ranking(results, budget)).collect()
}

fn ranking(results: &[CellResult], budget: &str) -> Ranking {
    let answered = results.iter().flat_map(|result| &result.answers);
    let answered = answered.filter(|a| a.budget == budget && a.point_err_rms.is_some());
    let methods: Vec<&str> = answered.map(|answer| &*answer.method).unique().collect();
    let cells: Vec<Ranked> = results.iter().map(|result| Ranked::of(result, budget, &methods)).collect();
    let volumes: Vec<&str> = cells.iter().map(|cell| cell.volume).unique().collect();
    let of_volumes: Vec<Vec<f64>> =
        volumes.iter().map(|volume| volume_ranks(&cells, volume, &methods)).collect();
    let mean_rank = |at: usize| mean(&of_volumes.iter().map(|ranks| ranks[at]).collect::<Vec<_>>());
    let critical_difference = critical_difference(methods.len(), volumes.len());
    let rank = |(at, method): (usize, &&str)| Rank {
        mean_rank: mean_rank(at),
        critical_difference,
        ..rank(&cells, budget, method)
    };
    let mut ranks: Vec<Rank> = methods.iter().enumerate().map(rank).collect();
    ranks.sort_by(|a, b| a.mean_rank.total_cmp(&b.mean_rank));
    Ranking { budget: budget.into(), ranks, critical_difference, volumes: volumes.len() }
}

/// Returns the rank of each of several values, the least first. Equal values share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |own: &f64| {
        let smaller = values.iter().filter(|other| *other < own).count();
        let equal = values.iter().filter(|other| *other == own).count();
        smaller as f64 + 0.5 * (equal as f64 + 1.0)
    };
    values.iter().map(rank).collect()
}

/// Ranks the methods on a volume by their mean ranks in its cells.
fn volume_ranks(cells: &[Ranked], volume: &str, methods: &[&str]) -> Vec<f64> {
    let own: Vec<&Ranked> = cells.iter().filter(|cell| cell.volume == volume).collect();
    let last = methods.len() as f64;
    let of_method = |method: &&str| {
        let ranks: Vec<f64> =
            own.iter().map(|cell| cell.of_method(method).map_or(last, |(_, rank)| rank)).collect();
        // Means of equal ranks may differ in the last bits.
        (mean(&ranks) * 1e9).round()
    };
    ranks(&methods.iter().map(of_method).collect::<Vec<_>>())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn rank(cells: &[Ranked], budget: &str, method: &str) -> Rank {
    let own = cells.iter().filter_map(|cell| Some((cell, cell.of_method(method)?.0)));
    let answered: Vec<(&Ranked, &Answer)> =
        own.filter(|(_, answer)| answer.point_err_rms.is_some()).collect();
    let won = cells.iter().filter(|cell| cell.is_won_by(method)).count();
    let not_separated =
        |(cell, answer): &&(&Ranked, &Answer)| cell.is_won_by(method) || answer.separated == Some(false);
    let logarithms: Vec<f64> =
        answered.iter().map(|(cell, answer)| (ranked_error(answer) / cell.least).ln()).collect();
    let [share_lo, share_hi] = wilson(won, cells.len());
    let over_volumes = share_over_volumes(cells, method);
    let [share_volumes_lo, share_volumes_hi] = [0, 1].map(|end| over_volumes.map(|ends| ends[end]));
    Rank {
        budget: budget.into(),
        method: method.into(),
        cells: cells.len(),
        answered: answered.len(),
        won,
        share: won as f64 / cells.len() as f64,
        share_lo,
        share_hi,
        share_volumes_lo,
        share_volumes_hi,
        not_separated: answered.iter().filter(not_separated).count(),
        mean_rank: f64::NAN,
        critical_difference: None,
        ratio: (!logarithms.is_empty()).then(|| mean(&logarithms).exp()),
    }
}

/// Returns Wilson's 95 % interval of a share of `n` independent trials.
pub fn wilson(successes: usize, n: usize) -> [f64; 2] {
    let (share, n) = (successes as f64 / n as f64, n as f64);
    let centre = share + Z * Z / (2.0 * n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    [((centre - half) / scale).max(0.0), ((centre + half) / scale).min(1.0)]
}

/// Returns the 95 % interval of the share of cells that a method wins, by a bootstrap over volumes; `None`
/// for a single volume.
fn share_over_volumes(cells: &[Ranked], method: &str) -> Option<[f64; 2]> {
    let volumes = cells.iter().map(|cell| (cell.volume, cell.is_won_by(method))).into_group_map();
    // A hash map has no fixed order, and the random choices depend on it.
    let volumes: Vec<[f64; 2]> = volumes
        .into_iter()
        .sorted()
        .map(|(_, won)| [won.iter().filter(|won| **won).count() as f64, won.len() as f64])
        .collect();
    if volumes.len() < 2 {
        return None;
    }
    let mut chance = Chance::new(BOOTSTRAP_SEED, 0);
    let mut shares: Vec<f64> = (0..BOOTSTRAP_SAMPLES)
        .map(|_| {
            let drawn = (0..volumes.len()).map(|_| volumes[chance.below(volumes.len())]);
            let [won, all] = drawn.fold([0.0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
            won / all
        })
        .collect();
    shares.sort_by(f64::total_cmp);
    let tail = BOOTSTRAP_SAMPLES / 40;
    Some([shares[tail], shares[BOOTSTRAP_SAMPLES - 1 - tail]])
}

/// Returns the difference of the mean ranks of `methods` methods over `samples` samples from which they differ.
fn critical_difference(methods: usize, samples: usize) -> Option<f64> {
    let value = NEMENYI.get(methods.checked_sub(2)?).filter(|_| samples > 1)?;
    let k = methods as f64;
    Some(value * (k * (k + 1.0) / (6.0 * samples as f64)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(volume: &str, errors: &[(&str, Option<f64>, Option<bool>)]) -> CellResult {
        let answer = |(method, error, separated): &(&str, Option<f64>, Option<bool>)| Answer {
            budget: "bytes=1MiB".into(),
            method: (*method).into(),
            point_err_rms: *error,
            separated: *separated,
            ..Answer::default()
        };
        CellResult {
            volume: volume.into(),
            answers: errors.iter().map(answer).collect(),
            ..CellResult::default()
        }
    }

    #[test]
    fn intervals_are_those_of_the_literature() {
        // Wilson's interval of 15 of 50: 0.191 to 0.438.
        let [low, high] = wilson(15, 50);
        assert!((low - 0.1910).abs() < 5e-4 && (high - 0.4375).abs() < 5e-4, "{low} {high}");
        assert_eq!(wilson(0, 10)[0], 0.0);
        assert!((wilson(10, 10)[1] - 1.0).abs() < 1e-12);
        // Demšar 2006, section 3.2.2: four methods on 14 data sets, 2.569 sqrt(4 5 / (6 14)) = 1.25.
        assert!((critical_difference(4, 14).unwrap() - 1.25).abs() < 5e-3);
        assert_eq!(
            (critical_difference(1, 14), critical_difference(17, 14), critical_difference(3, 1)),
            (None, None, None)
        );
    }

    #[test]
    fn shares_ranks_and_ratios_count_every_cell() {
        let cells = [
            cell("a", &[("x", Some(0.1), None), ("y", Some(0.2), Some(true)), ("z", None, None)]),
            cell("a", &[("x", Some(0.3), Some(false)), ("y", Some(0.2), None), ("z", None, None)]),
            cell("b", &[("x", Some(0.1), None), ("y", Some(0.4), Some(true)), ("z", Some(0.8), Some(true))]),
        ];
        let rankings = rankings(&cells);
        assert_eq!((rankings.len(), rankings[0].volumes), (1, 2));
        let [x, y, z] = &rankings[0].ranks[..] else { panic!("three methods") };
        assert_eq!((&*x.method, x.cells, x.answered, x.won, x.not_separated), ("x", 3, 3, 2, 3));
        assert_eq!((&*z.method, z.answered, z.won, z.not_separated), ("z", 1, 0, 0));
        // On volume a, x and y have the mean rank 1.5 and share rank 1.5; on volume b they have 1 and 2.
        assert_eq!((x.mean_rank, y.mean_rank, z.mean_rank), (1.25, 1.75, 3.0));
        let ratio = (2.0_f64 * 1.0 * 4.0).powf(1.0 / 3.0);
        assert!((y.ratio.unwrap() - ratio).abs() < 1e-12);
        assert!((z.ratio.unwrap() - 8.0).abs() < 1e-12);
        assert_eq!([x.share_volumes_lo, x.share_volumes_hi], [Some(0.5), Some(1.0)]);
        assert!(x.critical_difference.is_some() && x.critical_difference == rankings[0].critical_difference);
    }

    #[test]
    fn methods_without_answers_take_no_part() {
        let cells =
            [cell("a", &[("x", Some(0.1), None), ("y", Some(0.2), Some(true)), ("rays", None, None)])];
        let ranking = rankings(&cells).remove(0);
        assert_eq!(ranking.ranks.iter().map(|r| &*r.method).collect::<Vec<_>>(), ["x", "y"]);
        assert_eq!((ranking.ranks[0].share_volumes_lo, ranking.critical_difference), (None, None));
        assert!(rankings(&[cell("a", &[("rays", None, None)])])[0].ranks.is_empty());
    }

    #[test]
    fn equal_errors_share_a_rank() {
        let cells = [cell(
            "a",
            &[("x", Some(0.1), None), ("y", Some(0.1), Some(false)), ("z", Some(0.2), Some(true))],
        )];
        let ranks: Vec<f64> = rankings(&cells)[0].ranks.iter().map(|r| r.mean_rank).collect();
        assert_eq!(ranks, [1.5, 1.5, 3.0]);
    }

    #[test]
    fn a_tie_counts_for_each_tied_method() {
        let cells = [
            cell("a", &[("x", Some(0.1), None), ("y", Some(0.1), Some(false)), ("z", None, None)]),
            cell("b", &[("x", Some(0.1), None), ("y", Some(0.2), Some(true)), ("z", None, None)]),
        ];
        assert_eq!(winners(&cells[0], "bytes=1MiB"), ["x", "y"]);
        assert!(winners(&cells[0], "bytes=2MiB").is_empty());
        let ranking = rankings(&cells).remove(0);
        let won: Vec<_> = ranking.ranks.iter().map(|r| (&*r.method, r.won, r.share)).collect();
        assert_eq!(won, [("x", 2, 1.0), ("y", 1, 0.5)]);
    }

    #[test]
    fn errors_of_float32_rounding_are_tied() {
        let cells = [
            cell(
                "a",
                &[("x", Some(3e-7), Some(true)), ("y", Some(1e-8), None), ("z", Some(3e-4), Some(true))],
            ),
            cell("b", &[("x", Some(0.0), None), ("y", Some(0.2), Some(true)), ("z", Some(0.1), Some(true))]),
        ];
        assert_eq!(winners(&cells[0], "bytes=1MiB"), ["x", "y"]);
        let ranking = rankings(&cells).remove(0);
        let counts: Vec<_> = ranking
            .ranks
            .iter()
            .map(|r| (&*r.method, r.won, r.not_separated, r.share, r.mean_rank))
            .collect();
        assert_eq!(counts, [("x", 2, 2, 1.0, 1.25), ("y", 1, 1, 0.5, 2.25), ("z", 0, 0, 0.0, 2.5)]);
        // The geometric means of 1 and 1, of 1 and 2e5, and of 300 and 1e5.
        for (rank, ratio) in ranking.ranks.iter().zip([1.0, 2e5_f64.sqrt(), 3e7_f64.sqrt()]) {
            assert!((rank.ratio.unwrap() / ratio - 1.0).abs() < 1e-12, "{rank:?}");
        }
    }
}
