//! Resuming of comparison tables that were interrupted.

use super::{TF, read_csv};
use crate::common;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use umbravox::measure::journal::JOURNAL;

const METHODS: &str = "none;rays;dsm:map=64,epsilon=0.06,0.02;osm:map=64";

fn command(folder: &Path, extra: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_umbravox"));
    command.current_dir(folder).args([
        "compare",
        "phantom:sphere:24",
        "--tf=tf.json",
        "--size=32x32",
        "-o",
        "out",
    ]);
    command.args(extra);
    command
}

/// Complete lines of one kind in the journal of a comparison.
fn lines(folder: &Path, kind: &str) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("out").join(JOURNAL)).unwrap_or_default();
    let whole = text.split_inclusive('\n').filter(|l| l.ends_with('\n'));
    whole.filter(|l| l.starts_with(&format!("{{\"kind\":\"{kind}\""))).map(str::to_owned).collect()
}

/// Starts a comparison and kills it when its journal has `count` lines of a kind.
fn interrupt(folder: &Path, extra: &[&str], kind: &str, count: usize) {
    std::fs::write(folder.join("tf.json"), TF).unwrap();
    let mut child = command(folder, extra).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while lines(folder, kind).len() < count {
        assert!(child.try_wait().unwrap().is_none(), "it was done before it could be interrupted");
        assert!(start.elapsed() < Duration::from_secs(120), "no line came");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

fn resume(folder: &Path, extra: &[&str]) -> String {
    let output = command(folder, &[extra, &["--resume"]].concat()).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    stderr
}

fn bytes(path: PathBuf) -> Vec<u8> {
    let mut bytes = Vec::new();
    std::fs::File::open(path).unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn rows_measured_before_the_interruption_are_not_measured_again() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let extra = ["--points=3000", "--rays=300", "--depths=150", "--repeats=2", "--methods", METHODS];
    interrupt(folder, &extra, "row", 1);
    let before = lines(folder, "row");
    assert!(before.len() < 5, "something is left to do");
    let out = folder.join("out");
    assert!(!out.join("compare.csv").exists() && out.join("picture_none.png").is_file());
    let drawn = std::fs::metadata(out.join("picture_none.exr")).unwrap().modified().unwrap();
    // An incomplete last line, as an interruption leaves it.
    let journal = bytes(out.join(JOURNAL));
    std::fs::write(out.join(JOURNAL), [&journal[..], b"{\"kind\":\"row\",\"key\":\"12"].concat()).unwrap();

    let stderr = resume(folder, &extra);
    assert!(stderr.contains(&format!("holds {} rows", before.len())), "{stderr}");
    let after = lines(folder, "row");
    assert_eq!((&after[..before.len()], after.len()), (&before[..], 5));
    let key = |line: &String| serde_json::from_str::<serde_json::Value>(line).unwrap()["key"].to_string();
    let keys: std::collections::HashSet<_> = after.iter().map(key).collect();
    assert_eq!(keys.len(), 5, "each row once");
    assert_eq!(std::fs::metadata(out.join("picture_none.exr")).unwrap().modified().unwrap(), drawn);
    let rows = read_csv(&out.join("compare.csv"));
    let kept: serde_json::Value = serde_json::from_str(&before[0]).unwrap();
    for column in ["method", "point_err_rms", "image_rmse", "tables_ms"] {
        assert_eq!(rows[0][column], kept["cells"][column].as_str().unwrap(), "{column}");
    }
    assert_eq!(rows.len(), 5);
    for row in &rows {
        assert!(!row["frame_ms"].is_empty() && !row["point_err_rms"].is_empty() && row["repeats"] == "2");
        assert!(!row["pareto"].is_empty() && row["status"] == "ok");
    }
    for file in ["compare.md", "compare.tex", "compare.json", "compare.svg", "difference_none.png"] {
        assert!(out.join(file).is_file(), "{file}");
    }

    // A complete table is written from the journal alone, unless settings differ.
    let (table, journal) = (bytes(out.join("compare.csv")), bytes(out.join(JOURNAL)));
    resume(folder, &extra);
    assert_eq!((bytes(out.join("compare.csv")), bytes(out.join(JOURNAL))), (table.clone(), journal.clone()));
    // Another scene is not mixed in, and no row is dropped.
    let refusal = |more: &[&str]| {
        let output = command(folder, &[&extra[..], more, &["--resume"]].concat()).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        stderr.lines().find(|l| l.starts_with("error: ")).unwrap().to_owned()
    };
    assert!(refusal(&["--background=#203040"]).contains("background = \"#000000\""));
    assert!(refusal(&["--light=dir:0,0,1"]).contains("light = "));
    let output = command(folder, &[&extra[..4], &["--methods=none", "--resume"]].concat()).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && stderr.contains("rays is among its rows"), "{stderr}");
    assert_eq!((bytes(out.join("compare.csv")), bytes(out.join(JOURNAL))), (table, journal));
    // A list with more methods resumes the table.
    let more = format!("{METHODS};dom:map=64");
    let order = [&extra[..4], &["--methods", more.as_str()]].concat();
    resume(folder, &order);
    assert_eq!(lines(folder, "row").len(), 6);
}

#[test]
fn rounds_go_on_where_they_stopped_and_the_row_says_so() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let extra = ["--points=50", "--rays=5", "--depths=5", "--repeats=300", "--methods=none;dsm:map=64"];
    interrupt(folder, &extra, "round", 4);
    let before = lines(folder, "round");
    assert!(before.len() < 600, "something is left to do");
    resume(folder, &extra);
    let after = lines(folder, "round");
    assert_eq!((&after[..before.len()], after.len()), (&before[..], 600));
    let rows = read_csv(&folder.join("out/compare.csv"));
    for row in &rows {
        assert_eq!((row["repeats"].as_str(), row["status"].as_str()), ("300", "ok"));
        assert!(row["note"].contains("its 300 timed rounds are from 2 runs"), "{}", row["note"]);
    }
    // A new start discards the journal.
    let output = command(folder, &[&extra[..3], &["--repeats=1", "--methods=none", "--overwrite"]].concat())
        .output()
        .unwrap();
    assert!(output.status.success());
    assert_eq!((lines(folder, "row").len(), lines(folder, "round").len()), (1, 1));
}
