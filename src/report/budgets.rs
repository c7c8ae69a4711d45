//! Ranks shadow methods by error within each memory or time budget, from the rows of the comparison table.
//!
//! All rows of one scene take part, whether or not a search tuned their settings. Memory budgets exclude methods that
//! store no shadow map, since these would always fit. Only the most accurate row of each method is ranked.

use super::number::significant;
use super::writers::{side_table_csv, write_files};
use crate::error::Result;
use crate::measure::budget::{Budget, ErrorMeasure, budgets_of};
use crate::measure::table::Row;
use itertools::Itertools as _;
use std::borrow::Borrow;
use std::path::{Path, PathBuf};

/// Ranking of shadow methods for one scene, one memory or time budget and one error measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer<'a> {
    /// Memory or time budget that the ranked rows of the comparison table do not exceed.
    pub budget: Budget,
    /// Error measure by which shadow methods are ranked: the smallest error is first.
    pub by: ErrorMeasure,
    /// Most accurate comparison-table row of each shadow method within the budget, with its error. Rows are sorted by
    /// error, smallest first; the list may be empty.
    pub ranked: Vec<(&'a Row, f64)>,
}

impl Answer<'_> {
    /// Whether the error of a ranked row is distinguished from the first: their 95 % intervals do not overlap. `None` for
    /// the first row, and for error measures or rows without intervals.
    pub fn is_separated(&self, place: usize) -> Option<bool> {
        let (ErrorMeasure::Points, [(first, _), ..]) = (self.by, &self.ranked[..]) else { return None };
        let (row, _) = self.ranked.get(place).filter(|_| place > 0)?;
        Some(first.point_err_rms_hi? < row.point_err_rms_lo?)
    }
}

/// Returns one ranking of shadow methods for each combination of scene, graphics adapter, picture size, budget and
/// error measure. The list is empty if no settings were tuned for a budget.
pub fn answers(rows: &[Row]) -> Vec<Answer<'_>> {
    let budgets = budgets_of(rows);
    let mut answers = Vec::new();
    for place in rows.iter().map(Row::place).unique() {
        for (budget, by) in budgets.iter().flat_map(|b| ErrorMeasure::ALL.map(|by| (*b, by))) {
            let own = rows.iter().filter(|row| row.place() == place && takes_part(row, budget));
            let mut ranked: Vec<(&Row, f64)> = Vec::new();
            for (row, error) in own.filter_map(|row| Some((row, by.error(row)?))) {
                match ranked.iter_mut().find(|(other, _)| other.method == row.method) {
                    Some(best) if key((row, error), budget) < key(*best, budget) => *best = (row, error),
                    Some(_) => {}
                    None => ranked.push((row, error)),
                }
            }
            ranked.sort_by(|a, b| {
                key(*a, budget).partial_cmp(&key(*b, budget)).unwrap_or(std::cmp::Ordering::Equal)
            });
            answers.push(Answer { budget, by, ranked });
        }
    }
    answers
}

fn takes_part(row: &Row, budget: Budget) -> bool {
    !row.has_failed() && budget.holds(row)
}

/// Sort key of a row in the ranking of shadow methods within a budget: smaller error first, then smaller memory or
/// time.
fn key((row, error): (&Row, f64), budget: Budget) -> (f64, f64) {
    (error, budget.need(row).unwrap_or(f64::INFINITY))
}

/// Returns one text line per ranking within a budget: the best shadow method, the second best, and the ratio of their
/// errors. `name` returns the name of a comparison-table row: method, settings, and the scene if there are several.
pub fn lines(rows: &[Row], name: &dyn Fn(&Row) -> String) -> Vec<String> {
    let said = |answer: Answer| {
        let separated = answer.is_separated(1);
        let Answer { budget, by, ranked } = answer;
        let what = match by {
            ErrorMeasure::Points => "point err rms",
            ErrorMeasure::Picture => "image rmse",
        };
        let need = |row: &Row| match budget {
            Budget::Bytes(_) => {
                let mib = row.bytes.map_or(f64::NAN, |n| n as f64 / f64::from(1 << 20));
                format!("{} MiB", significant(mib, 3))
            }
            Budget::Ms(_) => format!("{} ms", significant(row.moving_ms().unwrap_or(f64::NAN), 3)),
            Budget::Frames(_) => format!("{} frames", significant(row.frames.unwrap_or(f64::NAN), 3)),
        };
        let of =
            |(row, error): (&Row, f64)| format!("{} ({}, {})", name(row), significant(error, 3), need(row));
        match ranked[..] {
            [] => None,
            [first] => Some(format!("{budget}, {what}: {}; no other method", of(first))),
            [first, second, ..] => {
                let times = significant(second.1 / first.1, 3);
                let doubt = if separated == Some(false) { " (not separated)" } else { "" };
                let (first, second) = (of(first), of(second));
                Some(format!("{budget}, {what}: {first}; then {second}, {times} times the error{doubt}"))
            }
        }
    };
    answers(rows).into_iter().filter_map(said).collect()
}

/// Row of `budgets.csv`: a comparison-table row with its rank for one budget and one error measure.
struct Ranked<'a> {
    row: &'a Row,
    answer: &'a Answer<'a>,
    rank: usize,
}

impl Borrow<Row> for Ranked<'_> {
    fn borrow(&self) -> &Row {
        self.row
    }
}

/// Writes `budgets.csv` (ranking of shadow methods within each budget) and `trials.csv` (settings that the search
/// within a budget tried) into an existing folder. Writes nothing if no settings were tuned for a budget. Returns the
/// paths of the written files.
///
/// # Errors
/// A file cannot be written.
pub fn write_budgets(rows: &[Row], trials: &[Row], folder: &Path) -> Result<Vec<PathBuf>> {
    let answers = answers(rows);
    if answers.is_empty() && trials.is_empty() {
        return Ok(Vec::new());
    }
    let mut ranked = Vec::new();
    for answer in &answers {
        let ranks = answer.ranked.iter().zip(1..);
        ranked.extend(ranks.map(|((row, _), rank)| Ranked { row, answer, rank }));
    }
    let budgets = side_table_csv("budgets.csv", &ranked, |Ranked { answer, rank, .. }, name| match name {
        "budget" => Some(answer.budget.to_string()),
        "by" => Some(answer.by.column().into()),
        "rank" => Some(rank.to_string()),
        "separated" => Some(answer.is_separated(rank - 1).map_or(String::new(), |is| is.to_string())),
        _ => None,
    })?;
    let trials = side_table_csv("trials.csv", trials, |_, _| None)?;
    write_files(folder, [("budgets.csv", budgets), ("trials.csv", trials)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, params: &str, bytes: u64, ms: f64, errors: [f64; 2], tuned_for: &str) -> Row {
        Row {
            scene: "planted".into(),
            method: method.into(),
            params: params.into(),
            bytes: Some(bytes),
            build_ms: Some(0.25 * ms),
            frame_ms: Some(0.75 * ms),
            point_err_rms: Some(errors[0]),
            image_rmse: Some(errors[1]),
            tuned: Some(!tuned_for.is_empty()),
            tuned_for: tuned_for.into(),
            ..Row::default()
        }
    }

    fn planted() -> Vec<Row> {
        vec![
            row("none", "", 0, 10.0, [0.5, 0.4], ""),
            row("rays", "", 0, 1000.0, [0.0, 0.0], ""),
            row("dsm", "epsilon=0.06", 100, 40.0, [0.03, 0.01], "bytes=100 point_err_rms"),
            row("dsm", "epsilon=0.005", 400, 60.0, [0.01, 0.02], "ms=60 point_err_rms"),
            row("osm", "layers=8", 100, 30.0, [0.02, 0.03], "bytes=100 point_err_rms; bytes=100 image_rmse"),
            row("osm", "layers=64", 800, 35.0, [0.015, f64::NAN], ""),
            row("dom", "layers=3", 99, 70.0, [0.02, 0.001], ""),
            row("bom", "layers=3", 50, 61.0, [f64::NAN, 0.009], ""),
        ]
    }

    #[test]
    fn methods_are_ranked_within_each_budget() {
        let rows = planted();
        let got: Vec<_> = answers(&rows)
            .iter()
            .map(|a| {
                (a.budget.to_string(), a.by, a.ranked.iter().map(|(r, _)| &*r.method).collect::<Vec<_>>())
            })
            .collect();
        let expected = [
            // Equally close: dom needs less; `rays` stores nothing and does not take part.
            ("bytes=100", ErrorMeasure::Points, vec!["dom", "osm", "dsm"]),
            ("bytes=100", ErrorMeasure::Picture, vec!["dom", "bom", "dsm", "osm"]),
            ("ms=60", ErrorMeasure::Points, vec!["dsm", "osm", "none"]),
            ("ms=60", ErrorMeasure::Picture, vec!["dsm", "osm", "none"]),
        ];
        assert_eq!(got.len(), expected.len());
        for (got, (budget, by, ranked)) in got.into_iter().zip(expected) {
            assert_eq!(got, (budget.to_owned(), by, ranked));
        }
        let name = |row: &Row| format!("{} {}", row.method, row.params).trim().to_owned();
        let lines = lines(&rows, &name);
        assert!(lines[2].starts_with(
            "ms=60, point err rms: dsm epsilon=0.005 (0.0100, 60.0 ms); then osm layers=64 (0.0150"
        ));
        assert!(lines[2].ends_with("1.50 times the error"), "{lines:?}");
    }

    #[test]
    fn overlapping_intervals_are_not_separated() {
        let mut rows = planted();
        for row in &mut rows {
            let error = row.point_err_rms.filter(|e| e.is_finite());
            [row.point_err_rms_lo, row.point_err_rms_hi] = [0.9, 1.1].map(|factor| Some(error? * factor));
        }
        let separated = |rows: &[Row], place: usize| answers(rows)[0].is_separated(place);
        // dom and osm 0.018 to 0.022, dsm 0.027 to 0.033.
        assert_eq!([0, 1, 2, 3].map(|place| separated(&rows, place)), [None, Some(false), Some(true), None]);
        assert_eq!(answers(&rows)[1].is_separated(1), None, "pictures have no intervals");
        let lines = lines(&rows, &|row| row.method.clone());
        assert!(lines[0].ends_with("1.00 times the error (not separated)"), "{lines:?}");
        let folder = tempfile::tempdir().unwrap();
        let paths = write_budgets(&rows, &[], folder.path()).unwrap();
        let text = std::fs::read_to_string(&paths[0]).unwrap();
        let starts = [",1,,dom,", ",2,false,osm,", ",3,true,dsm,"];
        assert!(text.lines().skip(1).zip(starts).all(|(line, start)| line.contains(start)), "{text}");
    }

    #[test]
    fn ranking_ignores_other_scenes_and_failures() {
        let mut rows = planted();
        rows[6].scene = "another".into();
        rows[4].set_failed(&"planted");
        let answers = answers(&rows);
        assert_eq!(answers.len(), 2 * 4);
        assert_eq!(answers[0].ranked.iter().map(|(r, _)| &*r.method).collect::<Vec<_>>(), ["dsm"]);
        assert_eq!(answers[4].ranked[0].0.method, "dom");
        assert!(answers[6].ranked.is_empty(), "it takes 70 ms");
        rows.iter_mut().for_each(|r| r.tuned_for.clear());
        assert!(super::answers(&rows).is_empty());
        let folder = tempfile::tempdir().unwrap();
        assert!(write_budgets(&rows, &[], folder.path()).unwrap().is_empty());
        let paths = write_budgets(&planted(), &[Row::default()], folder.path()).unwrap();
        let text = std::fs::read_to_string(&paths[0]).unwrap();
        assert_eq!(text.lines().count(), 1 + 3 + 4 + 3 + 3);
        assert!(
            text.lines().nth(1).unwrap().starts_with("planted,,bytes=100,point_err_rms,1,,dom,layers=3,")
        );
    }
}
