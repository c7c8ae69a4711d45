//! Comparisons that are split into jobs, and merged again.

use super::{TF, read_csv};
use crate::common;
use crate::program::{succeed, umbravox};
use std::collections::HashMap;
use std::path::Path;
use umbravox::report::run::Run;

const METHODS: &str = "none;dsm:map=32,epsilon=0.06,0.02;osm:map=32,layers=4";
const EFFORT: [&str; 5] = ["--size=32x32", "--points=400", "--rays=40", "--depths=30", "--repeats=1"];

fn refused(folder: &Path, args: &[&str]) -> String {
    let output = umbravox(folder, args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {stderr}");
    let lines: Vec<_> = stderr.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(lines.len(), 1, "{stderr}");
    stderr
}

fn scenes(folder: &Path) {
    std::fs::write(folder.join("tf.json"), TF).unwrap();
    let scene =
        |name: &str, volume: &str| format!("volume = 'phantom:{volume}'\ntf = 'tf.json'\nname = '{name}'\n");
    std::fs::write(folder.join("a.toml"), scene("ball", "sphere:16")).unwrap();
    std::fs::write(folder.join("b.toml"), scene("wall", "slab:12")).unwrap();
}

fn sweep<'a>(folder: &Path, out: &'a str, more: &[&'a str]) -> String {
    let args = ["compare", "--scene=a.toml", "--scene=b.toml", "--methods", METHODS, "-o", out];
    succeed(folder, &[&args[..], &EFFORT, more].concat()).stderr
}

/// Table columns that do not depend on the speed of the machine.
fn errors(table: &Path) -> Vec<String> {
    let of = |row: &HashMap<String, String>| {
        ["scene", "method", "params", "point_err_rms", "ray_err_max", "image_rmse", "bound_held"]
            .map(|c| row[c].clone())
            .join(" ")
    };
    read_csv(table).iter().map(of).collect()
}

#[test]
fn shards_put_together_are_the_whole_table() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    scenes(folder);
    sweep(folder, "whole", &[]);
    for shard in ["1/3", "2/3", "3/3"] {
        sweep(folder, &format!("part{}", &shard[..1]), &["--shard", shard]);
    }
    let parts = ["part1", "part2", "part3"];
    let counts = parts.map(|p| read_csv(&folder.join(p).join("compare.csv")).len());
    assert_eq!(counts, [3, 3, 2]);
    // Parts may be given in any order.
    succeed(folder, &["merge", "part3", "part1", "part2", "-o", "all"]);
    let (whole, all) = (folder.join("whole"), folder.join("all"));
    assert_eq!(errors(&whole.join("compare.csv")), errors(&all.join("compare.csv")));
    let names = |folder: &Path| {
        let mut names: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|f| f.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names.retain(|name| !name.ends_with(".jsonl"));
        names
    };
    assert_eq!(names(&whole), names(&all));
    let same = |name: &str| {
        let read = |folder: &Path| std::fs::read(folder.join(name)).unwrap();
        assert!(read(&whole) == read(&all), "{name}");
    };
    for name in names(&whole).iter().filter(|n| n.starts_with("picture_") || n.starts_with("difference_")) {
        same(name);
    }
    names(&whole).iter().filter(|n| n.starts_with("nodes_") || n.ends_with(".toml")).for_each(|n| same(n));
    // The colour bar of the differences may be chosen again.
    succeed(folder, &["merge", "part1", "part2", "part3", "-o", "fixed", "--difference-max", "1"]);
    let name = names(&whole).into_iter().find(|name| name.starts_with("difference_")).unwrap();
    assert!(
        std::fs::read(folder.join("fixed").join(&name)).unwrap() != std::fs::read(all.join(name)).unwrap()
    );
    // The Pareto front is of all rows of a scene, not of one part.
    let rows = read_csv(&all.join("compare.csv"));
    let better = |a: &HashMap<String, String>, b: &HashMap<String, String>, c: &str, up: bool| {
        let [a, b] = [a, b].map(|r| r[c].parse::<f64>().unwrap_or(f64::NAN));
        if up { a > b } else { a < b }
    };
    for row in rows.iter().filter(|r| !r["pareto"].is_empty()) {
        let beaten = rows.iter().filter(|o| o["scene"] == row["scene"]).any(|other| {
            better(other, row, "fps_moving", true) && better(other, row, "point_err_rms", false)
        });
        assert_eq!(row["pareto"] == "true", !beaten, "{row:?}");
    }
    let report = std::fs::read_to_string(all.join("report.html")).unwrap();
    assert_eq!(report.matches("<tr><th scope=\"row\"").count(), 8);

    // Missing, repeated or unfinished parts, and parts of another sweep, are refused.
    let stderr = refused(folder, &["merge", "part1", "part3", "-o", "no"]);
    assert!(stderr.contains("3 of 8 rows are in none of them") && stderr.contains("--partial"), "{stderr}");
    assert!(!folder.join("no").exists());
    succeed(folder, &["merge", "part1", "part3", "--partial", "-o", "some"]);
    assert_eq!(read_csv(&folder.join("some/compare.csv")).len(), 5);
    assert!(refused(folder, &["merge", "part1", "whole", "-o", "no"]).contains("is in part1 too"));
    assert!(refused(folder, &["merge", "part1", "part2", "-o", "part1"]).contains("output folder"));
    assert!(
        refused(folder, &["merge", "part1", "part2", "part3", "-o", "all"]).contains("holds a table already")
    );
    assert!(refused(folder, &["merge", ".", "-o", "no"]).contains("run.json is missing"));
    let mut run = Run::read(&folder.join("part2")).unwrap().unwrap();
    run.finished = false;
    run.write(&folder.join("part2")).unwrap();
    assert!(refused(folder, &["merge", "part1", "part2", "-o", "no"]).contains("not finished"));
    let slow = ["compare", "--scene=a.toml", "--scene=b.toml", "--methods", METHODS, "-o", "other"];
    succeed(folder, &[&slow[..], &EFFORT, &["--shard=2/3", "--light=dir:0,0,1"]].concat());
    let stderr = refused(folder, &["merge", "part1", "other", "part3", "-o", "no"]);
    assert!(stderr.contains("its scene ball differs: light = ") && stderr.contains("other"), "{stderr}");
}

/// Changes the record of a results folder as if it had been measured on another machine.
fn moved_to(folder: &Path, adapter: &str, revision: Option<&str>) {
    let mut run = Run::read(folder).unwrap().unwrap();
    let table = std::fs::read_to_string(folder.join("compare.csv")).unwrap();
    let mut table = table.replace(&format!(",{},", run.adapter), &format!(",{adapter},"));
    if table.matches(adapter).count() == 0 {
        table = table.replace(&format!("\"{}\"", run.adapter), adapter);
    }
    std::fs::write(folder.join("compare.csv"), table).unwrap();
    run.adapter = adapter.into();
    run.revision = revision.unwrap_or(&run.revision).to_owned();
    run.write(folder).unwrap();
}

#[test]
fn adapters_keep_their_own_fronts_and_files() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let compare = |out: &str| {
        let methods = ["--methods", "none;dsm:map=32"];
        succeed(folder, &[&["compare", "phantom:sphere:16", "-o", out], &EFFORT[..], &methods].concat());
    };
    compare("one");
    compare("two");
    assert!(refused(folder, &["merge", "one", "two", "-o", "no"]).contains("is in one too"));
    moved_to(&folder.join("two"), "Planted Card", None);
    succeed(folder, &["merge", "one", "two", "-o", "both"]);
    let both = folder.join("both");
    let rows = read_csv(&both.join("compare.csv"));
    assert_eq!(rows.len(), 4);
    // On one adapter `none` and `dsm` would both be on the front; of two adapters at most two of four.
    for adapter in rows.iter().map(|r| &r["adapter"]) {
        let own = |r: &&HashMap<String, String>| r["adapter"] == *adapter && r["pareto"] == "true";
        assert_eq!(rows.iter().filter(own).count(), 2, "each adapter has its own front: {rows:?}");
    }
    for name in [
        "picture_Planted-Card_none.png",
        "Planted-Card_grid.png",
        "Planted-Card_grid.pdf",
        "compare_Planted-Card.pdf",
    ] {
        assert!(both.join(name).is_file(), "{name}");
    }
    let run = Run::read(&both).unwrap().unwrap();
    for file in std::fs::read_dir(&both).unwrap() {
        let name = file.unwrap().file_name().into_string().unwrap();
        assert!(run.files.contains(&name), "{name}");
    }
    moved_to(&folder.join("two"), "Planted Card", Some("another"));
    assert!(refused(folder, &["merge", "one", "two", "-o", "no"]).contains("it was measured by"));
}

#[test]
fn shards_with_default_settings_are_merged() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    scenes(folder);
    let sweep = |out: &str, more: &[&str]| {
        let args = ["compare", "--scene=a.toml", "--methods=none;dsm;osm:layers=4;dsm:map=32", "-o", out];
        succeed(folder, &[&args[..], &EFFORT, more].concat());
        Run::read(&folder.join(out)).unwrap().unwrap()
    };
    let methods = |run: &Run| run.rows.iter().map(|row| row.method.clone()).collect::<Vec<_>>();
    let whole = sweep("whole", &[]);
    let shards = [sweep("part1", &["--shard=1/2"]), sweep("part2", &["--shard=2/2"])];
    for run in &shards {
        assert_eq!(methods(run), methods(&whole), "the scene's map size is no part of the specification");
        assert!(run.rows.iter().all(|row| !row.chosen));
    }
    succeed(folder, &["merge", "part1", "part2", "-o", "all"]);
    let [whole, all] = ["whole", "all"].map(|name| folder.join(name).join("compare.csv"));
    assert_eq!(errors(&whole), errors(&all));
    assert!(read_csv(&all).iter().all(|row| row["method"] == "none" || !row["map"].is_empty()));
}

#[test]
fn shards_that_cannot_be_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    for shard in ["0/3", "4/3", "1", "a/b", "1/0", "1/10001"] {
        let stderr = refused(dir.path(), &["compare", "phantom:slab:8", "-o", "out", "--shard", shard]);
        assert!(stderr.contains("--shard"), "{stderr}");
    }
    for whole in ["--ablate", "--budget=bytes=1MiB"] {
        let args = ["compare", "phantom:slab:8", "-o", "out", "--shard=1/2", whole];
        assert!(refused(dir.path(), &args).contains(&whole[..8]));
    }
    if !common::has_adapter() {
        return;
    }
    let args = ["compare", "phantom:slab:8", "-o", "out", "--shard=9/9", "--methods=none;rays"];
    assert!(refused(dir.path(), &args).contains("has only 2 rows"));
    assert!(!dir.path().join("out").exists());
}
