//! Files of the benchmark's results: `benchmark.csv`, `ranking.csv`, `benchmark.md` and critical-difference plots.

use super::answer::{Answer, CellResult};
use super::exact::is_expected;
use super::plot::critical_difference;
use super::ranking::{FLOAT32_ERROR, Rank, Ranking, rankings, winners};
use crate::error::Result;
use crate::report::markdown::{Align, aligned_table};
use crate::report::number::significant;
use crate::report::writers::{csv, write_files};
use itertools::Itertools as _;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Row of `benchmark.csv`: the answer of a method to one budget in one cell.
#[derive(Serialize)]
struct Row<'a> {
    cell: &'a str,
    volume: &'a str,
    function: &'a str,
    points: usize,
    exact_hash: &'a str,
    revision: &'a str,
    budget: &'a str,
    method: &'a str,
    settings: &'a str,
    light_samples: Option<u32>,
    bytes: Option<u64>,
    build_ms: Option<f64>,
    frame_ms: Option<f64>,
    frames: Option<f64>,
    point_err_rms: Option<f64>,
    point_err_rms_lo: Option<f64>,
    point_err_rms_hi: Option<f64>,
    point_err_p99: Option<f64>,
    point_err_max: Option<f64>,
    image_rmse: Option<f64>,
    trials: usize,
    converged: Option<bool>,
    separated: Option<bool>,
    note: &'a str,
}

impl<'a> Row<'a> {
    fn of(result: &'a CellResult, answer: &'a Answer) -> Self {
        Self {
            cell: &result.cell,
            volume: &result.volume,
            function: &result.function,
            points: result.points,
            exact_hash: &result.exact_hash,
            revision: &result.revision,
            budget: &answer.budget,
            method: &answer.method,
            settings: &answer.settings,
            light_samples: answer.light_samples,
            bytes: answer.bytes,
            build_ms: answer.build_ms,
            frame_ms: answer.frame_ms,
            frames: answer.frames,
            point_err_rms: answer.point_err_rms,
            point_err_rms_lo: answer.point_err_rms_lo,
            point_err_rms_hi: answer.point_err_rms_hi,
            point_err_p99: answer.point_err_p99,
            point_err_max: answer.point_err_max,
            image_rmse: answer.image_rmse,
            trials: answer.trials,
            converged: answer.converged,
            separated: answer.separated,
            note: &answer.note,
        }
    }
}

/// Writes the tables and plots of the benchmark into an existing folder, from the results of cells. Returns the paths of
/// the files, and the text of `benchmark.md`.
///
/// # Errors
/// A file cannot be written.
pub fn write(results: &[CellResult], made_by: &str, folder: &Path) -> Result<(Vec<PathBuf>, String)> {
    let rankings = rankings(results);
    let rows: Vec<Row> = results.iter().flat_map(|r| r.answers.iter().map(|a| Row::of(r, a))).collect();
    let ranks: Vec<&Rank> = rankings.iter().flat_map(|r| &r.ranks).collect();
    let page = page(results, &rankings, made_by);
    let mut files = vec![
        ("benchmark.csv".to_owned(), csv(&rows)?),
        ("ranking.csv".to_owned(), csv(&ranks)?),
        ("benchmark.md".to_owned(), page.clone().into_bytes()),
    ];
    for ranking in rankings.iter().filter(|ranking| !ranking.ranks.is_empty()) {
        let plot = critical_difference(ranking);
        let stem = plot_stem(ranking);
        files.push((format!("{stem}.svg"), plot.svg(None).into_string().into_bytes()));
        files.push((format!("{stem}.png"), plot.png()?));
    }
    Ok((write_files(folder, files)?, page))
}

fn plot_stem(ranking: &Ranking) -> String {
    format!("ranks_{}", ranking.budget.replace('=', "_"))
}

fn page(results: &[CellResult], rankings: &[Ranking], made_by: &str) -> String {
    let cells = results.len();
    let mut page = format!("# Benchmark results\n\n{made_by}\n");
    let unexpected = results.iter().filter(|result| !is_expected(&result.cell, &result.exact_hash)).count();
    if unexpected > 0 {
        page += &format!(
            "\nIn {unexpected} of {cells} cells the hash of the exact transmittances is not the one that the benchmark expects.\n"
        );
    }
    page += &elapsed(results);
    page += &format!(
        "\nErrors below {floor}, which is float32 rounding, count as {floor}. A tie counts for each tied method.\n",
        floor = significant(FLOAT32_ERROR, 1)
    );
    for ranking in rankings.iter().filter(|ranking| !ranking.ranks.is_empty()) {
        page += &format!("\n## Within {}\n\n", ranking.budget);
        page += &shares(ranking);
        page += &match ranking.critical_difference {
            Some(difference) => format!(
                "\nTwo mean ranks over {} volumes differ at the 5 % level if they are at least {} apart (Nemenyi's test).\n",
                ranking.volumes,
                significant(difference, 3)
            ),
            None => String::new(),
        };
        page += &format!("\n![mean ranks]({}.png)\n", plot_stem(ranking));
        let keys: [(&str, Key); 4] = [
            ("volume", |cell| &cell.volume),
            ("transfer function", |cell| &cell.function),
            ("light", |cell| cell.light_and_view().0),
            ("view", |cell| cell.light_and_view().1),
        ];
        let differs = |key: Key| results.iter().map(key).unique().nth(1).is_some();
        for (name, key) in keys.into_iter().filter(|(_, key)| differs(*key)) {
            page += &format!("\nCells won, by {name}:\n\n{}", won_by(results, ranking, key));
        }
    }
    page
}

/// Returns the sentence about the time that all cells took; nothing where a result does not tell it.
fn elapsed(results: &[CellResult]) -> String {
    let seconds: Option<Vec<f64>> = results.iter().map(|result| result.elapsed_s).collect();
    let Some(seconds) = seconds.filter(|seconds| !seconds.is_empty()) else { return String::new() };
    let longest = seconds.iter().copied().fold(0.0, f64::max);
    let hours = significant(seconds.iter().sum::<f64>() / 3600.0, 2);
    format!("\nTimes of the cells sum to {hours} hours; the longest takes {} s.\n", significant(longest, 3))
}

/// Function that returns what cells are counted by.
type Key = fn(&CellResult) -> &str;

/// Returns the table of all methods within one budget.
fn shares(ranking: &Ranking) -> String {
    let headings = [
        ("method", Align::Left),
        ("answered", Align::Right),
        ("won", Align::Right),
        ("share (95 %, cells)", Align::Right),
        ("95 %, volumes", Align::Right),
        ("won or not separated", Align::Right),
        ("mean rank", Align::Right),
        ("error / least", Align::Right),
    ];
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    let over_volumes = |(low, high): (f64, f64)| format!("{} to {}", percent(low), percent(high));
    let row = |r: &Rank| {
        vec![
            format!("`{}`", r.method),
            r.answered.to_string(),
            r.won.to_string(),
            format!("{} % ({} to {})", percent(r.share), percent(r.share_lo), percent(r.share_hi)),
            r.share_volumes_lo.zip(r.share_volumes_hi).map_or(String::new(), over_volumes),
            r.not_separated.to_string(),
            format!("{:.2}", r.mean_rank),
            r.ratio.map_or(String::new(), |ratio| significant(ratio, 3)),
        ]
    };
    aligned_table(&headings.map(|(h, a)| (h.to_owned(), a)), &ranking.ranks.iter().map(row).collect_vec())
}

/// Returns a table with the number of cells that each method wins, for each value of a key of the cells.
fn won_by(results: &[CellResult], ranking: &Ranking, key: Key) -> String {
    let values: Vec<&str> = results.iter().map(key).unique().collect();
    let of_cells: Vec<(&str, Vec<&str>)> =
        results.iter().map(|result| (key(result), winners(result, &ranking.budget))).collect();
    let mut headings = vec![("method".to_owned(), Align::Left)];
    headings.extend(values.iter().map(|value| ((*value).to_owned(), Align::Right)));
    let row = |rank: &Rank| {
        let count = |value: &&str| {
            let is_own = |(of, winners): &&(&str, Vec<&str>)| of == value && winners.contains(&&*rank.method);
            of_cells.iter().filter(is_own).count().to_string()
        };
        [vec![format!("`{}`", rank.method)], values.iter().map(count).collect()].concat()
    };
    aligned_table(&headings, &ranking.ranks.iter().map(row).collect_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_count_ties_for_each_tied_method() {
        let answer = |(method, error): (&str, f64)| Answer {
            budget: "bytes=1MiB".into(),
            method: method.into(),
            point_err_rms: Some(error),
            ..Answer::default()
        };
        let cell = |function: &str, errors: [f64; 2]| CellResult {
            cell: format!("a-{function}-back-{}", if function == "thin" { "front" } else { "close" }),
            volume: "a".into(),
            function: function.into(),
            elapsed_s: Some(1800.0),
            answers: ["x", "y"].into_iter().zip(errors).map(answer).collect(),
            ..CellResult::default()
        };
        let results = [cell("thin", [0.1, 0.1]), cell("thin", [0.1, 0.2]), cell("surface", [1e-9, 3e-7])];
        let ranking = rankings(&results).remove(0);
        assert_eq!(ranking.ranks.iter().map(|rank| rank.won).collect_vec(), [3, 2]);
        let table = won_by(&results, &ranking, |result| &result.function);
        let rows = table.lines().map(|line| line.replace(' ', "")).collect_vec();
        assert_eq!(rows[2..], ["|`x`|2|1|", "|`y`|1|1|"]);
        let page = page(&results, &[ranking], "");
        for part in [
            "Errors below 1e-6,",
            "Times of the cells sum to 1.5 hours; the longest takes 1800 s.",
            "by view:\n\n| method | front | close |",
        ] {
            assert!(page.contains(part), "{part}: {page}");
        }
        assert!(!page.contains("by light"), "all cells have one light");
    }
}
