//! Tables and rankings of README and `docs/`, which are made from the archived files in `docs/results`.
//!
//! A comment opens such a block, which ends at the next empty line:
//!
//! - `<!-- table FILE...: COLUMN, COLUMN as HEADING, ... | LABEL; LABEL; ... -->` has a line for each row,
//! - `<!-- pivot FILE...: COLUMN | LABEL; LABEL; ... -->` has one column of each file, with a line for each label,
//! - `<!-- counts FILE...: COLUMN, COUNTED | VALUE; VALUE as HEADING; ... -->` counts the values of a column, with a line for
//!   each value of the first column,
//! - `<!-- coverage FILE REFERENCE -->` counts, for each scene, the intervals of `point_err_rms` in the first file that
//!   contain its value in the second,
//! - `<!-- winners FILE as SCENES; ... -->` names the methods that win most cells of benchmarks.
//!
//! The file `FOLDER/ranking.csv-METHOD` stands for the ranking of the other methods. Its `not_separated` is empty, since
//! cells have comparisons with the best of all methods alone.
//!
//! A column is that of the CSV file, with `/` and a divisor (number or column) if need be. Further columns are `folder`
//! (of the file), `label` (method with its settings) and `setting` (with its map too). Labels or settings behind `|`
//! select rows.

use crate::readme::pages;
use itertools::Itertools as _;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use umbravox::benchmark::answer::CellResult;
use umbravox::benchmark::definition::Definition;
use umbravox::benchmark::folder::Folder;
use umbravox::benchmark::pages as benchmark_pages;
use umbravox::report::markdown::{Align, aligned_table};
use umbravox::report::number::significant;

type Row = BTreeMap<String, String>;

/// Rows of a CSV file, with the additional columns `folder`, `label` and `setting`.
fn rows(path: &Path) -> Vec<Row> {
    let name = path.file_name().unwrap().to_string_lossy();
    if let Some(method) = name.strip_prefix("ranking.csv-") {
        return ranking_without(method, path.parent().unwrap());
    }
    let mut reader =
        csv::Reader::from_path(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let folder = path.parent().and_then(Path::file_name).unwrap().to_string_lossy().into_owned();
    let rows = reader.deserialize::<Row>().map(|row| {
        let mut row = row.unwrap();
        let get = |name: &str| row.get(name).cloned().unwrap_or_default();
        let method = |settings: String| match settings.trim_matches(',') {
            "" => get("method"),
            settings => format!("{}:{settings}", get("method")),
        };
        let params = get("params").replace(' ', ",");
        let map =
            Some(get("map")).filter(|map| !map.is_empty()).map_or(String::new(), |map| format!("map={map}"));
        let (label, setting) = (method(params.clone()), method(format!("{params},{map}")));
        row.extend(
            [("folder", folder.clone()), ("label", label), ("setting", setting)]
                .map(|(k, v)| (k.to_owned(), v)),
        );
        row
    });
    rows.collect()
}

/// Rows of the ranking of an archived benchmark without one of its methods.
fn ranking_without(method: &str, folder: &Path) -> Vec<Row> {
    let mut results = archived_results(folder);
    let count = |results: &[CellResult]| results.iter().map(|cell| cell.answers.len()).sum::<usize>();
    let before = count(&results);
    results.iter_mut().for_each(|cell| cell.answers.retain(|answer| answer.method != method));
    assert!(count(&results) < before, "no method {method}");
    let made = tempfile::tempdir().unwrap();
    benchmark_pages::write(&results, "", made.path()).unwrap();
    let mut rows = rows(&made.path().join("ranking.csv"));
    let name = folder.file_name().unwrap().to_string_lossy();
    for row in &mut rows {
        row.extend([
            ("not_separated".to_owned(), String::new()),
            ("folder".into(), name.clone().into_owned()),
        ]);
    }
    rows
}

/// Rows with one of the labels or settings, in the order of the labels; all rows for an empty list.
fn selected<'a>(all: &'a [Row], labels: &str) -> Vec<&'a Row> {
    if labels.is_empty() {
        return all.iter().collect();
    }
    let of = |label: &str| {
        let found: Vec<&Row> =
            all.iter().filter(|row| row["label"] == label || row["setting"] == label).collect();
        assert!(!found.is_empty(), "no row {label}");
        found
    };
    labels.split("; ").flat_map(of).collect()
}

fn value<'a>(row: &'a Row, column: &str) -> &'a str {
    row.get(column).unwrap_or_else(|| panic!("no column {column}"))
}

fn number(row: &Row, column: &str) -> f64 {
    value(row, column).parse().unwrap_or_else(|_| panic!("{column} is no number"))
}

/// Text of a cell. Numbers have three digits, method names are code.
fn cell(row: &Row, expression: &str) -> String {
    let (column, divisor) = expression.split_once('/').unwrap_or((expression, "1"));
    let text = value(row, column);
    if text.is_empty() {
        return String::new();
    }
    let number = |text: &str| text.parse::<f64>().ok();
    match number(text) {
        Some(x) => {
            let divisor = number(divisor).or_else(|| number(value(row, divisor)));
            divisor.map_or_else(String::new, |divisor| significant(x / divisor, 3))
        }
        None if ["label", "setting", "method", "params"].contains(&column) => format!("`{text}`"),
        None if text == "true" => "yes".into(),
        None if text == "false" => "no".into(),
        None => text.into(),
    }
}

fn table(folder: &Path, instruction: &str) -> String {
    let (files, columns) = instruction.split_once(": ").expect("files and columns");
    let (columns, labels) = columns.split_once(" | ").unwrap_or((columns, ""));
    let columns: Vec<(&str, &str)> =
        columns.split(", ").map(|c| c.split_once(" as ").unwrap_or((c, c))).collect();
    let all: Vec<Row> = files.split(' ').flat_map(|file| rows(&folder.join(file))).collect();
    let chosen = selected(&all, labels);
    let is_text = |column: &str| {
        ["folder", "scene", "label", "setting", "method", "params", "published", "cell", "budget"]
            .contains(&column)
    };
    let headings: Vec<(String, Align)> = columns
        .iter()
        .map(|(column, heading)| {
            let name = if column == heading && !is_text(column) {
                format!("`{heading}`")
            } else {
                (*heading).to_owned()
            };
            (name, if is_text(column) { Align::Left } else { Align::Right })
        })
        .collect();
    let cells: Vec<Vec<String>> =
        chosen.iter().map(|row| columns.iter().map(|(column, _)| cell(row, column)).collect()).collect();
    aligned_table(&headings, &cells)
}

fn pivot(folder: &Path, instruction: &str) -> String {
    let (files, column) = instruction.split_once(": ").expect("files and a column");
    let (column, labels) = column.split_once(" | ").expect("a column and labels");
    let files: Vec<Vec<Row>> = files.split(' ').map(|file| rows(&folder.join(file))).collect();
    let mut headings = vec![(String::from("setting"), Align::Left)];
    headings.extend(files.iter().map(|rows| (rows[0]["folder"].clone(), Align::Right)));
    let line = |label: &str| {
        let cells = files.iter().map(|rows| match selected(rows, label)[..] {
            [row] => cell(row, column),
            _ => panic!("several rows {label}"),
        });
        [format!("`{label}`")].into_iter().chain(cells).collect()
    };
    let lines: Vec<Vec<String>> = labels.split("; ").map(line).collect();
    aligned_table(&headings, &lines)
}

/// Counts of the values of one column, by those of another.
fn counts(folder: &Path, instruction: &str) -> String {
    let (files, columns) = instruction.split_once(": ").expect("files and columns");
    let (columns, values) = columns.split_once(" | ").expect("columns and values");
    let (by, counted) = columns.split_once(", ").expect("two columns");
    let values: Vec<(&str, &str)> =
        values.split("; ").map(|v| v.split_once(" as ").unwrap_or((v, v))).collect();
    let all: Vec<Row> = files.split(' ').flat_map(|file| rows(&folder.join(file))).collect();
    let line = |name: &str| {
        let own: Vec<&str> =
            all.iter().filter(|row| value(row, by) == name).map(|row| value(row, counted)).collect();
        let counts = values.iter().map(|(value, _)| own.iter().filter(|own| *own == value).count());
        let counts: Vec<usize> = counts.collect();
        assert_eq!(counts.iter().sum::<usize>(), own.len(), "{name}: a value of {counted} is not listed");
        [name.to_owned()].into_iter().chain(counts.iter().map(usize::to_string)).collect()
    };
    let lines: Vec<Vec<String>> = all.iter().map(|row| value(row, by)).unique().map(line).collect();
    let headings = values.iter().map(|(_, heading)| ((*heading).to_owned(), Align::Right));
    aligned_table(&[(by.to_owned(), Align::Left)].into_iter().chain(headings).collect::<Vec<_>>(), &lines)
}

/// Counts of the intervals of `point_err_rms` that contain the value of the same row in a second file.
fn coverage(folder: &Path, files: &str) -> String {
    let (file, reference) = files.split_once(' ').expect("two files");
    let [rows, reference] = [file, reference].map(|file| rows(&folder.join(file)));
    assert_eq!(rows.len(), reference.len());
    let is_inside = |(row, truth): (&Row, &Row)| {
        assert!(["scene", "setting"].iter().all(|column| value(row, column) == value(truth, column)));
        let [lo, hi] = ["point_err_rms_lo", "point_err_rms_hi"].map(|end| number(row, end));
        (lo..=hi).contains(&number(truth, "point_err_rms"))
    };
    let line = |scene: &str, inside: Vec<bool>| {
        let (count, all) = (inside.iter().filter(|is| **is).count(), inside.len());
        vec![
            scene.to_owned(),
            format!("{count} of {all}"),
            format!("{:.1} %", 100.0 * count as f64 / all as f64),
        ]
    };
    let pairs = || rows.iter().zip(&reference);
    let scenes = pairs().chunk_by(|(row, _)| value(row, "scene"));
    let mut lines: Vec<_> =
        scenes.into_iter().map(|(scene, pairs)| line(scene, pairs.map(is_inside).collect())).collect();
    lines.push(line("all", pairs().map(is_inside).collect()));
    let headings =
        [("scene", Align::Left), ("intervals that contain the error", Align::Right), ("share", Align::Right)];
    aligned_table(&headings.map(|(name, align)| (name.to_owned(), align)), &lines)
}

/// Table of rankings: a line for each budget of each file, with the methods that win most cells and those whose mean ranks
/// the Nemenyi test does not separate from the best.
fn winners(folder: &Path, instruction: &str) -> String {
    let of_file = |file: &str| {
        let (path, name) = file.split_once(" as ").expect("a file and a name");
        let rows = rows(&folder.join(path));
        let budgets = rows.chunk_by(|a, b| value(a, "budget") == value(b, "budget"));
        budgets.map(|rows| winners_within(name, rows)).collect::<Vec<_>>()
    };
    let lines: Vec<Vec<String>> = instruction.split("; ").flat_map(of_file).collect();
    let headings = [
        ("scenes", Align::Left),
        ("within", Align::Left),
        ("wins most", Align::Left),
        ("not separated", Align::Right),
        ("next", Align::Left),
        ("within the critical difference of the best mean rank", Align::Left),
    ];
    aligned_table(&headings.map(|(name, align)| (name.to_owned(), align)), &lines)
}

fn winners_within(name: &str, ranks: &[Row]) -> Vec<String> {
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    let method = |row: &&Row| format!("`{}`", value(row, "method"));
    let of_least = |column: &str, sign: f64| {
        ranks.iter().sorted_by(move |a, b| (sign * number(a, column)).total_cmp(&(sign * number(b, column))))
    };
    let by_share: Vec<&Row> = of_least("share", -1.0).collect();
    let first = by_share[0];
    let low = ["share_lo", "share_volumes_lo"].map(|end| number(first, end)).into_iter().fold(1.0, f64::min);
    let high = ["share_hi", "share_volumes_hi"].map(|end| number(first, end)).into_iter().fold(0.0, f64::max);
    // The next two, and those that tie with the second of them.
    let share = |place: usize| by_share.get(place).map_or(0.0, |row| number(row, "share"));
    let next =
        by_share[1..].iter().filter(|row| number(row, "share") >= share(2) && number(row, "share") > 0.0);
    let next = next.map(|row| format!("{} {} %", method(row), percent(number(row, "share"))));
    let by_rank: Vec<&Row> = of_least("mean_rank", 1.0).collect();
    let limit = number(by_rank[0], "mean_rank") + number(by_rank[0], "critical_difference");
    let same = by_rank.iter().filter(|row| number(row, "mean_rank") < limit).map(method);
    let not_separated = value(first, "not_separated").parse::<f64>();
    let not_separated =
        not_separated.map_or(String::new(), |count| format!("{} %", percent(count / number(first, "cells"))));
    vec![
        format!("{name} ({})", value(first, "cells")),
        amount(value(first, "budget")),
        format!("{} {} % ({} to {} %)", method(&first), percent(share(0)), percent(low), percent(high)),
        not_separated,
        next.collect::<Vec<_>>().join(", "),
        same.collect::<Vec<_>>().join(", "),
    ]
}

/// A budget as a reader says it.
fn amount(budget: &str) -> String {
    match budget.split_once('=') {
        Some(("bytes", size)) => size.replace("KiB", " KiB").replace("MiB", " MiB"),
        Some(("frames", number)) => format!("{number} frames of `none`"),
        _ => panic!("{budget}"),
    }
}

/// The page with the text of every block made again.
fn renewed(path: &Path, page: &str) -> String {
    let folder = path.parent().unwrap();
    let mut blocks = page.split("<!-- ");
    let mut text = blocks.next().unwrap().to_owned();
    for block in blocks {
        let (instruction, rest) = block.split_once(" -->\n").expect("the comment ends with its line");
        let made = match instruction.split_once(' ').unwrap() {
            ("table", instruction) => table(folder, instruction),
            ("pivot", instruction) => pivot(folder, instruction),
            ("counts", instruction) => counts(folder, instruction),
            ("coverage", files) => coverage(folder, files),
            ("winners", files) => winners(folder, files),
            (other, _) => panic!("{}: {other}", path.display()),
        };
        // A block that has not been made yet is empty.
        let after =
            if rest.starts_with('\n') { rest } else { rest.find("\n\n").map_or("", |end| &rest[end + 1..]) };
        text += &format!("<!-- {instruction} -->\n{made}{after}");
    }
    text
}

#[test]
fn tables_of_the_pages_are_those_of_the_archived_results() {
    LazyLock::force(&RANKINGS);
    let mut count = 0;
    for (path, page) in pages() {
        let made = renewed(&path, &page);
        count += page.matches("<!-- ").count();
        if std::env::var_os("UMBRAVOX_REWRITE").is_some() && made != page {
            fs::write(&path, &made).unwrap();
        }
        let written = fs::read_to_string(&path).unwrap();
        assert!(written == made, "{}: UMBRAVOX_REWRITE=1 writes its tables again", path.display());
    }
    assert!(count > 0, "no block found");
}

/// Results in an archived folder of the benchmark, for the cells of its `benchmark.csv`.
fn archived_results(folder: &Path) -> Vec<CellResult> {
    let rows = rows(&folder.join("benchmark.csv"));
    let archived: BTreeSet<&str> = rows.iter().map(|row| value(row, "cell")).collect();
    let (results, _) = Folder::archived(folder).unwrap().expect("a folder of the benchmark");
    let cells = Definition::frozen().unwrap().cells();
    let cells = cells.iter().filter(|cell| archived.contains(&*cell.name));
    cells.map(|cell| results.result(cell).unwrap().expect("a file of the cell")).collect()
}

/// Whether two texts with commas are the same but for the last digits of numbers, which differ between systems.
fn is_same(a: &str, b: &str) -> bool {
    let fields = |text: &str| text.split([',', '\n']).map(str::to_owned).collect::<Vec<String>>();
    let (a, b) = (fields(a), fields(b));
    let is_close = |(a, b): (&String, &String)| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(x), Ok(y)) => (x - y).abs() <= 1e-12 * x.abs(),
        _ => a == b,
    };
    a.len() == b.len() && a.iter().zip(&b).all(is_close)
}

/// Runs [`check_rankings`] once, before the tables of the pages, which are made from its files.
static RANKINGS: LazyLock<()> = LazyLock::new(check_rankings);

#[test]
fn archived_rankings_are_those_of_their_cells() {
    LazyLock::force(&RANKINGS);
}

/// Compares archived rankings with those that the program makes of the archived cells. With `UMBRAVOX_REWRITE` it writes
/// them and their plots again.
fn check_rankings() {
    let is_rewritten = std::env::var_os("UMBRAVOX_REWRITE").is_some();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/results/benchmark");
    for folder in ["all", "doubled", "sky", "sun", "time", "vtk"].map(|name| root.join(name)) {
        let page = fs::read_to_string(folder.join("benchmark.md")).unwrap();
        let made_by = page.split("\n\n").nth(1).expect("a paragraph on the run");
        let made = tempfile::tempdir().unwrap();
        let (files, _) = benchmark_pages::write(&archived_results(&folder), made_by, made.path()).unwrap();
        for plot in files.iter().filter(|file| file.extension().is_some_and(|ending| ending == "png")) {
            let archived = folder.join(plot.file_name().unwrap());
            if is_rewritten {
                fs::copy(plot, &archived).unwrap();
            }
            assert!(archived.is_file(), "{}: UMBRAVOX_REWRITE=1 draws it", archived.display());
        }
        for name in ["ranking.csv", "benchmark.md"] {
            let [path, made] = [folder.as_path(), made.path()].map(|folder| folder.join(name));
            let made = fs::read_to_string(made).unwrap();
            if is_rewritten {
                fs::write(&path, &made).unwrap();
            }
            let written = fs::read_to_string(&path).unwrap();
            assert!(is_same(&written, &made), "{}: UMBRAVOX_REWRITE=1 writes it again", path.display());
        }
    }
}

#[test]
fn blocks_are_renewed_and_the_text_around_them_stays() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "method,params,map,bytes\ndsm,epsilon=0.02 near=0,64,2048\n")
        .unwrap();
    let table = "| method                   | KiB |\n| ------------------------ | --: |\n\
                 | `dsm:epsilon=0.02,near=0` | 2.00 |\n";
    let instruction = "<!-- table a.csv: label as method, bytes/1024 as KiB -->\n";
    let page = folder.path().join("page.md");
    let lines = |text: &str| text.replace(['-', ' '], "");
    for old in ["", table, "| an old table |\n"] {
        let made = renewed(&page, &format!("before\n\n{instruction}{old}\nafter\n\nend\n"));
        assert_eq!(lines(&made), lines(&format!("before\n\n{instruction}{table}\nafter\n\nend\n")));
    }
    assert_eq!(
        lines(&renewed(&page, &format!("{instruction}{table}"))),
        lines(&format!("{instruction}{table}"))
    );
    let pivot = "<!-- pivot a.csv: bytes | dsm:epsilon=0.02,near=0,map=64 -->\n";
    assert!(renewed(&page, pivot).contains("`dsm:epsilon=0.02,near=0,map=64`"));
}
