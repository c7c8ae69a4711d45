//! `umbravox verify`, run as a user runs it, on a small table of `compare`.

use crate::common;
use crate::program::{refused, umbravox};
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
    let output = umbravox(dir.path(), &compare);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let confirmed = umbravox(dir.path(), &["verify", "table"]);
    assert!(confirmed.status.success(), "{}", String::from_utf8_lossy(&confirmed.stderr));
    let said = String::from_utf8(confirmed.stdout).unwrap();
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

/// The archived folder of a scene that needs no scan, with one changed digit: that value is refused, and no other.
#[test]
fn an_archived_result_is_confirmed_but_for_a_changed_digit() {
    if !common::has_adapter() {
        return;
    }
    let archive = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/results/random-rays/cloud");
    let dir = tempfile::tempdir().unwrap();
    for file in fs::read_dir(archive).unwrap().map(|file| file.unwrap().path()) {
        fs::copy(&file, dir.path().join(file.file_name().unwrap())).unwrap();
    }
    let path = dir.path().join("compare.csv");
    let table = fs::read_to_string(&path).unwrap();
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let column = reader.headers().unwrap().iter().position(|name| name == "point_err_rms").unwrap();
    // Samples at four voxels: an error that is large beside the tolerance.
    let error = reader.records().nth(4).unwrap().unwrap()[column].to_owned();
    // The first significant digit: on other adapters a value may differ by 2 %.
    let digit = error.find(|c| ('1'..='9').contains(&c)).unwrap();
    let other = if error[digit..].starts_with('7') { "2" } else { "7" };
    let changed = format!("{}{other}{}", &error[..digit], &error[digit + 1..]);
    fs::write(&path, table.replacen(&error, &changed, 1)).unwrap();
    let refuted = umbravox(dir.path(), &["verify", "."]);
    let said = String::from_utf8(refuted.stderr).unwrap();
    assert!(refuted.status.code() == Some(1) && said.contains(": 1 of "), "{said}");
    assert!(said.contains("point_err_rms") && said.contains(&changed), "{said}");
}
