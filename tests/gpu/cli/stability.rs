//! `umbravox stability`, run as a user runs it, on a few cases.

use crate::common;
#[cfg(unix)]
use crate::program::interrupted;
use crate::program::{refused, succeed, umbravox};
use std::collections::HashMap;

#[test]
fn picked_cases_give_a_row_a_method() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let output = umbravox(
        dir.path(),
        &[
            "stability",
            "-o",
            "out",
            "--case",
            "grid-one-brick,nan,epsilon-0.5",
            "--methods",
            "none;dsm:map=32",
            "--json",
        ],
    );
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");

    let mut reader = csv::Reader::from_path(dir.path().join("out/stability.csv")).unwrap();
    let columns = "case,method,params,status,ray_err_max,bound,monotone_violations,out_of_range,non_finite,build_ms,bytes,note";
    assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>().join(","), columns);
    let rows: Vec<HashMap<String, String>> = reader.deserialize().map(|r| r.unwrap()).collect();
    let named: Vec<_> =
        rows.iter().map(|r| format!("{} {} {}", r["case"], r["method"], r["params"])).collect();
    let expected = [
        "grid-one-brick none ",
        "grid-one-brick dsm epsilon=0.02 map=32",
        "nan none ",
        "nan dsm epsilon=0.02 map=32",
        "epsilon-0.5 dsm epsilon=0.5 map=32",
    ];
    assert_eq!(named, expected);
    for row in &rows {
        assert_eq!((row["status"].as_str(), row["non_finite"].as_str()), ("ok", "0"), "{row:?}");
        let error: f64 = row["ray_err_max"].parse().unwrap();
        match row["bound"].parse::<f64>() {
            Ok(bound) => assert!(error < 2.0 * bound && row["bytes"] != "0", "{row:?}"),
            Err(_) => assert!(row["method"] == "none" && error > 0.2 && row["bytes"] == "0", "{row:?}"),
        }
    }

    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json.as_array().unwrap().len(), rows.len());
    let summary = std::fs::read_to_string(dir.path().join("out/stability.md")).unwrap();
    assert!(summary.contains("5 rows: 5 ok"), "{summary}");
    assert_eq!(std::fs::read_dir(dir.path().join("out")).unwrap().count(), 2);
}

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_the_rows_of_finished_cases() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    // The third line announces the second case, so the first one is finished.
    let is_ready = |said: &str| said.lines().filter(|line| line.starts_with("progress: ")).count() >= 3;
    let args = ["stability", "-o", "out", "--methods", "none;dsm:map=32"];
    let said = interrupted(dir.path(), &args, is_ready);
    assert!(said.contains("progress: 0/") && said.contains("ordinary case"), "{said}");
    assert!(said.contains("about ") && said.contains(" left, "), "{said}");
    assert!(said.contains("error: interrupted (out): ") && said.contains("cases are tested"), "{said}");
    assert!(said.contains("--resume") && said.contains("nan"), "the hint names the missing cases: {said}");
    let rows = csv::Reader::from_path(dir.path().join("out/stability.csv")).unwrap().into_records().count();
    assert!(rows > 0, "{said}");
}

#[test]
fn finished_cases_are_not_tested_again() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let args = ["stability", "-o", "out", "--methods", "none;dsm:map=32", "--case", "grid-one-brick,nan"];
    succeed(dir.path(), &args);
    let read = |file: &str| std::fs::read_to_string(dir.path().join("out").join(file)).unwrap();
    let (whole, page) = (read("stability.csv"), read("stability.md"));
    // As after an interruption: the second case is missing.
    let first: Vec<&str> = whole.lines().filter(|line| !line.starts_with("nan,")).collect();
    std::fs::write(dir.path().join("out/stability.csv"), first.join("\n") + "\n").unwrap();
    let resumed = || succeed(dir.path(), &[&args[..], &["--resume"]].concat()).stderr;
    let said = resumed();
    assert!(said.contains("holds 2 rows"), "{said}");
    assert!(
        !said.contains("grid-one-brick") && said.contains("nan"),
        "only the second case is tested: {said}"
    );
    let again = read("stability.csv");
    assert_eq!(again.lines().take(3).collect::<Vec<_>>(), first, "rows of the first case stay");
    assert_eq!(again.lines().count(), whole.lines().count());
    // A complete table is written anew without a measurement.
    assert!(!resumed().contains("ordinary case"));
    assert_eq!(read("stability.csv"), again);
    // Other settings, and another adapter, are not mixed in.
    let refusal = |args: &[&str]| refused(dir.path(), &[args, &["--resume"]].concat());
    let other = ["stability", "-o", "out", "--methods", "dsm:map=64", "--case", "grid-one-brick,nan"];
    assert!(refusal(&other).contains("none in case grid-one-brick is among its rows and not requested"));
    std::fs::write(dir.path().join("out/stability.md"), page.replace("Adapter ", "Adapter another "))
        .unwrap();
    assert!(refusal(&args).contains("it was measured with: Adapter another "));
    assert!(refused(dir.path(), &args).contains("it holds stability.csv already"));
    let both = refused(dir.path(), &[&args[..], &["--resume", "--overwrite"]].concat());
    assert!(both.contains("--overwrite"), "{both}");
}

#[test]
fn bad_command_lines_are_refused_before_anything_is_made() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("file"), "x").unwrap();
    let refuse = |args: &[&str]| refused(dir.path(), &[&["stability"], args].concat());
    assert!(refuse(&["-o", "out", "--case", "nonsense"]).contains("light-inside"), "it says what there is");
    assert!(refuse(&["-o", "out", "--methods", "dsm:epsilon=2"]).contains("--methods"));
    assert!(refuse(&["-o", "file"]).contains("not a folder"));
    let held = dir.path().join("held");
    std::fs::create_dir(&held).unwrap();
    std::fs::write(held.join("stability.csv"), "case\n").unwrap();
    assert!(refuse(&["-o", "held"]).contains("it holds stability.csv already"));
    std::fs::write(held.join("claims.csv"), "paper\n").unwrap();
    assert!(refused(dir.path(), &["claims", "-o", "held"]).contains("it holds claims.csv already"));
    assert_eq!(std::fs::read_to_string(held.join("claims.csv")).unwrap(), "paper\n");
    assert!(refuse(&[]).contains("--output"));
}
