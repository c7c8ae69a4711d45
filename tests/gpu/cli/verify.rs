//! `umbravox verify`, run as a user runs it, on a small table of `compare` and on archived tables.

use crate::common;
use crate::program::{refused, succeed, umbravox};
use std::fs;
use std::path::Path;

#[test]
fn a_table_is_confirmed_until_a_digit_of_it_changes() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let compare = [
        "compare",
        "phantom:struts:24",
        "--light",
        "dir:0.2,0.3,0.9",
        "--size",
        "24x16",
        "--methods",
        "rays;dsm:map=32;osm:layers=4,map=32",
        "--points",
        "500",
        "--rays",
        "20",
        "--depths",
        "10",
        "--repeats",
        "1",
        "-o",
        "table",
    ];
    succeed(dir.path(), &compare);
    let said = succeed(dir.path(), &["verify", "table"]).stdout;
    let count: usize = said.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(count > 60, "{said}");

    let path = dir.path().join("table/compare.csv");
    let table = fs::read_to_string(&path).unwrap();
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let column = reader.headers().unwrap().iter().position(|name| name == "shadow_rmse").unwrap();
    let error = reader.records().nth(1).unwrap().unwrap()[column].to_owned();
    let last = error.len() - 1;
    let changed = format!("{}{}", &error[..last], if error.ends_with('3') { '4' } else { '3' });
    fs::write(&path, table.replace(&error, &changed)).unwrap();
    let refuted = umbravox(dir.path(), &["verify", "table"]);
    let said = String::from_utf8(refuted.stderr).unwrap();
    assert!(refuted.status.code() == Some(1) && said.contains("1 of"), "{said}");
    assert!(said.contains("dsm") && said.contains("shadow_rmse") && said.contains(&changed), "{said}");

    fs::remove_file(dir.path().join("table/run.json")).unwrap();
    let error = refused(dir.path(), &["verify", "table"]);
    assert!(error.contains("run.json"), "{error}");
    assert!(refused(dir.path(), &["verify", "nowhere"]).contains("nowhere"));
}

/// Copies a table of `docs/results` with some of its lines, and the other files of its folder.
fn part_of_archive(folder: &str, table: &str, is_kept: impl Fn(&str) -> bool) -> tempfile::TempDir {
    let archive = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/results").join(folder);
    let dir = tempfile::tempdir().unwrap();
    for file in fs::read_dir(archive).unwrap().map(|file| file.unwrap().path()) {
        fs::copy(&file, dir.path().join(file.file_name().unwrap())).unwrap();
    }
    let text = fs::read_to_string(dir.path().join(table)).unwrap();
    let lines = text.lines().enumerate().filter(|(n, line)| *n == 0 || is_kept(line));
    let kept: Vec<&str> = lines.map(|(_, line)| line).collect();
    fs::write(dir.path().join(table), kept.join("\n") + "\n").unwrap();
    dir
}

/// Archived tables, each with one changed digit of a value: that value is refused, and no other.
#[test]
fn archived_results_are_confirmed_but_for_a_changed_digit() {
    if !common::has_adapter() {
        return;
    }
    // Samples at four voxels have an error that is large beside the tolerance.
    let of_rays = ("random-rays/cloud", "compare.csv", "rays,march=samples step=4,", "point_err_rms");
    let of_claim = ("claims/run", "claims.csv", ",15 coefficients,shadow_rmse", "shadow_rmse");
    let of_case = ("stability/llvmpipe", "stability.csv", "ordinary,dsm,", "bound");
    for (folder, table, row, column) in [of_rays, of_claim, of_case] {
        let is_kept = |line: &str| table == "compare.csv" || line.contains(row);
        let dir = part_of_archive(folder, table, is_kept);
        let path = dir.path().join(table);
        let text = fs::read_to_string(&path).unwrap();
        let line = text.lines().find(|line| line.contains(row)).unwrap();
        let value = value_of(&text, line, column);
        // The first significant digit: on other adapters a value may differ by 2 %.
        let digit = value.find(|c| ('1'..='9').contains(&c)).unwrap();
        let other = if value[digit..].starts_with('7') { "2" } else { "7" };
        let changed = format!("{}{other}{}", &value[..digit], &value[digit + 1..]);
        fs::write(&path, text.replacen(line, &line.replacen(&value, &changed, 1), 1)).unwrap();
        let refuted = umbravox(dir.path(), &["verify", "."]);
        let said = String::from_utf8(refuted.stderr).unwrap();
        assert!(refuted.status.code() == Some(1) && said.contains(": 1 of "), "{folder}: {said}");
        // A value may be printed with fewer digits.
        assert!(
            said.contains(column) && said.contains(&changed[..changed.len().min(12)]),
            "{folder}: {said}"
        );
    }
}

/// Text of a value in a line of a table: of its column, or of a figure of a claim.
fn value_of(table: &str, line: &str, column: &str) -> String {
    let fields = |line: &str| {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(line.as_bytes());
        reader.records().next().unwrap().unwrap()
    };
    let (header, values) = (fields(table.lines().next().unwrap()), fields(line));
    match header.iter().position(|name| name == column) {
        Some(place) => values[place].to_owned(),
        None => {
            let figures = values.iter().flat_map(|value| value.split("; "));
            let figure =
                figures.filter_map(|figure| figure.split_once(": ")).find(|(name, _)| *name == column);
            figure.expect("a figure").1.to_owned()
        }
    }
}

#[test]
fn tables_of_other_scenes_and_cases_are_refused() {
    if !common::has_adapter() {
        return;
    }
    let dir =
        part_of_archive("stability/llvmpipe", "stability.csv", |line| line.starts_with("ordinary,none,"));
    let path = dir.path().join("stability.csv");
    let text = fs::read_to_string(&path).unwrap();
    for (before, after, why) in
        [("ordinary", "extraordinary", "there is no such case"), ("none", "other", "unknown shadow method")]
    {
        fs::write(&path, text.replacen(before, after, 1)).unwrap();
        assert!(refused(dir.path(), &["verify", "."]).contains(why), "{after}");
    }
    let dir =
        part_of_archive("claims/run", "claims.csv", |line| line.contains(",15 coefficients,shadow_rmse"));
    let path = dir.path().join("claims.csv");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.lines().next().unwrap().to_owned() + "\n").unwrap();
    assert!(refused(dir.path(), &["verify", "."]).contains("no values"));
    fs::write(&path, text.replace("even medium", "ball")).unwrap();
    assert!(refused(dir.path(), &["verify", "."]).contains("on the scene `ball`"));
}
