//! `umbravox claims`, run as a user runs it: one paper on a small scene.

use crate::common;
#[cfg(unix)]
use crate::program::interrupted;
use crate::program::{refused, succeed};
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use umbravox::replication::claims::all;

const SCENE: &str =
    "volume = \"phantom:sphere:16\"\ntf = \"engine\"\nsize = \"32x32\"\nstep = 1\nlight = \"dir:1,-0.6,0\"\n";

#[test]
fn claims_of_one_paper_on_a_given_scene() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("ball.toml"), SCENE).unwrap();
    let args =
        ["claims", "--paper", "neumann", "--scene", "ball.toml", "--repeats", "1", "-o", "out", "--json"];
    let json = succeed(dir.path(), &args).stdout;

    let mut reader = csv::Reader::from_path(dir.path().join("out/claims.csv")).unwrap();
    let columns = "paper,where,claim,claimed,measured,holds,scene,note";
    assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>().join(","), columns);
    let rows: Vec<HashMap<String, String>> = reader.deserialize().map(|r| r.unwrap()).collect();
    let claims = all().unwrap().into_iter().filter(|c| c.paper == "Kim and Neumann 2001").count();
    assert_eq!(rows.len(), claims, "a row a claim and scene");
    for row in &rows {
        assert_eq!(row["paper"], "Kim and Neumann 2001");
        assert!(["yes", "partly", "no", ""].contains(&row["holds"].as_str()), "{row:?}");
        let tried = !row["holds"].is_empty();
        assert_eq!(tried, !row["measured"].is_empty(), "{row:?}");
        assert!(!tried || row["scene"].starts_with("ball"), "{row:?}");
        assert!(!row["note"].is_empty(), "{row:?}");
    }
    let of = |claim: &str| rows.iter().find(|r| r["claim"].contains(claim)).unwrap();
    let kappa = of("kappa");
    assert!(kappa["measured"].contains("kappa: 5.5") && kappa["holds"] == "yes", "{kappa:?}");
    assert_eq!(of("memory requirement")["holds"], "no", "all maps are kept");

    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json.as_array().unwrap().len(), rows.len());
    assert_eq!(json[0]["where"], rows[0]["where"]);
    let page = fs::read_to_string(dir.path().join("out/claims.md")).unwrap();
    assert!(page.contains("## Kim and Neumann 2001") && page.contains("phantom:sphere:16"), "{page}");
    assert_eq!(fs::read_dir(dir.path().join("out")).unwrap().count(), 2);
}

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_the_rows_of_finished_scenes() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    write_two_scenes(dir.path());
    // The second scene takes long enough for the signal to come in time.
    fs::write(dir.path().join("step.toml"), SCENE.replace("sphere", "step").replace("32x32", "256x256"))
        .unwrap();
    let scenes = ["--scene", "ball.toml", "--scene", "step.toml", "--repeats", "1", "-o", "out"];
    // A scene has two exact pictures; the third is the first of the second scene.
    let args = [&["claims", "--paper", "neumann"], &scenes[..]].concat();
    let said = interrupted(dir.path(), &args, |said| said.matches("exact picture").count() > 2);
    assert!(said.contains("claims are tested on 1 of 2 scenes") && said.contains("not on step"), "{said}");
    let rows = fs::read_to_string(dir.path().join("out/claims.csv")).unwrap();
    assert!(rows.contains(",ball") && !rows.contains(",step"), "{rows}");
}

/// Writes scene files `ball.toml` and `step.toml` into a folder.
fn write_two_scenes(folder: &Path) {
    fs::write(folder.join("ball.toml"), SCENE).unwrap();
    fs::write(folder.join("step.toml"), SCENE.replace("sphere", "step")).unwrap();
}

/// Returns the number of steps of a run that printed its progress; `None` if it had none.
fn steps_in_total(messages: &str) -> Option<&str> {
    let (_, rest) = messages.split_once("progress: 0/")?;
    rest.split_whitespace().next()
}

#[test]
fn finished_scenes_are_not_measured_again() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    write_two_scenes(dir.path());
    let ball = ["claims", "--paper", "neumann", "--repeats", "1", "-o", "out", "--scene", "ball.toml"];
    let alone = succeed(dir.path(), &ball).stderr;
    let read = |file: &str| fs::read_to_string(dir.path().join("out").join(file)).unwrap();
    let first = read("claims.csv");
    // A second scene is added to the finished one.
    let both = [&ball[..], &["--scene", "step.toml", "--resume"]].concat();
    let said = succeed(dir.path(), &both).stderr;
    assert!(said.contains(" rows"), "{said}");
    assert!(steps_in_total(&alone).is_some());
    assert_eq!(steps_in_total(&said), steps_in_total(&alone), "only the second scene is measured: {said}");
    let rows = read("claims.csv");
    assert!(first.lines().all(|line| rows.lines().any(|row| row == line)), "{rows}");
    assert!(rows.lines().count() > first.lines().count() && rows.contains(",step"), "{rows}");
    let said = succeed(dir.path(), &both).stderr;
    assert_eq!(steps_in_total(&said), None, "nothing is left to measure: {said}");
    assert_eq!(read("claims.csv"), rows);
    // Other scenes and settings are not mixed in.
    let refusal = |args: &[&str]| refused(dir.path(), &[args, &["--resume"]].concat());
    assert!(refusal(&ball).contains("is among its rows and not requested"));
    let more = [&ball[..4], &["2"], &ball[5..], &["--scene", "step.toml"]].concat();
    assert!(refusal(&more).contains("times are medians of 1. Now: "));
    fs::write(dir.path().join("ball.toml"), SCENE.replace("engine", "bone")).unwrap();
    assert!(refusal(&both[..both.len() - 1]).contains("the scene ball has changed"));
}

#[test]
fn bad_command_lines_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("ball.toml"), SCENE).unwrap();
    for (args, why) in [
        (vec!["--paper", "lokovic", "-o", "out"], "known papers: Kim and Neumann 2001"),
        (vec!["--scene", "none.toml", "-o", "out"], "none.toml"),
        (vec!["--scene", "ball.toml", "--scene", "ball.toml", "-o", "out"], "two scenes are named ball"),
        (vec!["-o", "ball.toml"], "not a folder"),
        (vec!["--repeats", "0", "-o", "out"], "--repeats"),
    ] {
        let error = refused(dir.path(), &[vec!["claims"], args].concat());
        assert!(error.contains(why), "{error}");
    }
}
