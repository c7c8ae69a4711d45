//! `umbravox benchmark`, run as a user runs it, on one cell of the frozen benchmark.

use crate::common;
use crate::program::{refused, succeed, umbravox};
use std::collections::HashMap;
use std::fs;
use std::path::Path;

/// External program that answers that no light is lost.
const UNSHADOWED: &str = r#"one=sed 's/.*/1/' "$UMBRAVOX_POINTS" > "$UMBRAVOX_TRANSMITTANCES""#;
const ARGUMENTS: [&str; 9] = [
    "benchmark",
    "-o",
    "out",
    "--methods",
    "osm,moments",
    "--budget",
    "bytes=256KiB",
    "--external",
    UNSHADOWED,
];

fn benchmark(folder: &Path, cells: &str) -> String {
    succeed(folder, &[&ARGUMENTS[..], &["--cells", cells]].concat());
    fs::read_to_string(folder.join("out/benchmark.csv")).unwrap()
}

fn rows(csv: &str) -> Vec<HashMap<String, String>> {
    csv::Reader::from_reader(csv.as_bytes()).deserialize().map(|row| row.unwrap()).collect()
}

#[test]
fn a_cell_ranks_methods_and_programs_and_resumes_to_the_same_errors() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    #[cfg(unix)]
    {
        // A run that is killed leaves nothing that the next one takes for a result.
        let arguments = [&ARGUMENTS[..], &["--cells", "cloud-dense-front-front"]].concat();
        let begun = |messages: &str| messages.contains("cloud-dense-front-front");
        let (status, messages) = crate::program::ended_by("KILL", dir.path(), &arguments, begun);
        assert_eq!(status, None, "{messages}");
        assert_eq!(fs::read_dir(dir.path().join("out/cells")).unwrap().count(), 0);
    }
    let first = benchmark(dir.path(), "cloud-dense-front-front");
    let table = rows(&first);
    let methods: Vec<_> = table.iter().map(|row| &*row["method"]).collect();
    assert_eq!(methods, ["osm", "moments", "one"]);
    let error = |method: &str| -> f64 {
        let row = table.iter().find(|row| row["method"] == method).unwrap();
        let [low, error, high] =
            ["_lo", "", "_hi"].map(|end| row[&format!("point_err_rms{end}")].parse().unwrap());
        assert!(low < error && error < high && row["points"] == "20000", "{row:?}");
        error
    };
    assert!(error("osm") < 0.2 && error("moments") < 0.1 && error("one") > 0.4);
    for row in table.iter().filter(|row| row["method"] != "one") {
        assert!(row["bytes"].parse::<u64>().unwrap() <= 256 << 10, "{row:?}");
        assert!(row["settings"].starts_with(&row["method"]) && row["trials"] != "0", "{row:?}");
    }
    let ranks = rows(&fs::read_to_string(dir.path().join("out/ranking.csv")).unwrap());
    let last = ranks.iter().find(|row| row["method"] == "one").unwrap();
    assert_eq!((&*last["mean_rank"], &*last["won"], &*last["cells"]), ("3.0", "0", "1"));
    assert!(dir.path().join("out/ranks_bytes_256KiB.png").is_file());

    // A cell without its file is measured again, to the last digit.
    let cell = dir.path().join("out/cells/cloud-dense-front-front.json");
    let recorded = fs::read_to_string(&cell).unwrap();
    fs::remove_file(&cell).unwrap();
    let untimed = |csv: &str| -> Vec<_> {
        let without_time = |mut row: HashMap<String, String>| {
            row.remove("frame_ms");
            row
        };
        rows(csv).into_iter().map(without_time).collect()
    };
    assert_eq!(untimed(&benchmark(dir.path(), "cloud-dense-front-front")), untimed(&first));
    verifies_and_finds_a_changed_digit(dir.path());
    fs::write(&cell, recorded.replace("\"one\"", "\"recorded\"")).unwrap();
    assert!(
        benchmark(dir.path(), "cloud-dense-front-front").contains(",recorded,"),
        "a file is not measured again"
    );

    // Another view takes the settings of the same light, whose search starts from the first cell.
    let beside = rows(&benchmark(dir.path(), "cloud-dense-side-*"));
    let of = |cell: &str| beside.iter().find(|row| row["cell"] == cell && row["method"] == "osm").unwrap();
    let trials = |row: &HashMap<String, String>| row["trials"].parse::<usize>().unwrap();
    let [front, close] = ["cloud-dense-side-front", "cloud-dense-side-close"].map(of);
    assert!(trials(front) < trials(&table[0]) && trials(close) == 0, "{beside:?}");
    assert_eq!((&front["settings"], &front["bytes"]), (&close["settings"], &close["bytes"]));
    assert_ne!(front["point_err_rms"], close["point_err_rms"]);

    let other = [&ARGUMENTS[..5], &["--budget", "bytes=64KiB", "--cells", "cloud-*"]].concat();
    let error = refused(dir.path(), &other);
    assert!(error.contains("out") && error.contains("other methods, budgets"), "{error}");
    measures_again_without_a_search(dir.path(), front);
}

/// Confirms the recorded errors, and finds a changed digit in the result of a cell and in a table.
fn verifies_and_finds_a_changed_digit(folder: &Path) {
    let cell = folder.join("out/cells/cloud-dense-front-front.json");
    let recorded = fs::read_to_string(&cell).unwrap();
    let verify = || umbravox(folder, &["verify", "out"]);
    let confirmed = verify();
    assert!(confirmed.status.success(), "{}", String::from_utf8_lossy(&confirmed.stderr));
    let osm = recorded.find("point_err_rms\": 0.").unwrap() + "point_err_rms\": 0.".len();
    let digit = if &recorded[osm + 3..osm + 4] == "7" { "8" } else { "7" };
    fs::write(&cell, [&recorded[..osm + 3], digit, &recorded[osm + 4..]].concat()).unwrap();
    let refuted = verify();
    let said = String::from_utf8_lossy(&refuted.stderr).into_owned();
    assert!(refuted.status.code() == Some(1) && said.contains("point_err_rms is"), "{said}");
    // So is one of a table.
    fs::write(&cell, &recorded).unwrap();
    let path = folder.join("out/benchmark.csv");
    let table = fs::read_to_string(&path).unwrap();
    fs::write(&path, table.replacen(",20000,", ",20001,", 1)).unwrap();
    let refuted = verify();
    let said = String::from_utf8_lossy(&refuted.stderr).into_owned();
    assert!(refuted.status.code() == Some(1) && said.contains("benchmark.csv"), "{said}");
    fs::write(&path, &table).unwrap();
}

/// Measures a cell with the settings of an earlier run, beside a method that this run has not.
fn measures_again_without_a_search(folder: &Path, earlier: &HashMap<String, String>) {
    let cells = "cloud-dense-side-front";
    let budget = ["--budget", "bytes=256KiB", "--methods", "osm,beer"];
    let arguments =
        [&["benchmark", "-o", "again", "--settings", "out", "--cells", cells], &budget[..]].concat();
    succeed(folder, &arguments);
    let table = rows(&fs::read_to_string(folder.join("again/benchmark.csv")).unwrap());
    let again = table.iter().find(|row| row["method"] == "osm").unwrap();
    for column in ["settings", "bytes", "point_err_rms", "trials", "converged"] {
        assert_eq!(again[column], earlier[column], "{column}");
    }
    assert!(table.iter().any(|row| row["method"] == "beer" && row["trials"] != "0"), "{table:?}");
}

#[test]
fn settings_within_a_time_hold_it_when_they_are_timed_again() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let cell = ["--cells", "cloud-thin-front-front", "--methods", "osm,beer", "--budget", "frames=30"];
    succeed(dir.path(), &[&["benchmark", "-o", "out"][..], &cell].concat());
    let table = rows(&fs::read_to_string(dir.path().join("out/benchmark.csv")).unwrap());
    for row in &table {
        let [build_ms, frame_ms, frames, error] = ["build_ms", "frame_ms", "frames", "point_err_rms"]
            .map(|column| row[column].parse::<f64>().unwrap());
        assert!(build_ms > 0.0 && frame_ms > 0.0 && error < 0.1, "{row:?}");
        assert!(frames > 1.0 && frames <= 33.0 && (frames <= 30.0) == row["note"].is_empty(), "{row:?}");
    }
    assert_eq!(table.len(), 2);
}

#[test]
fn shards_that_run_at_once_share_a_folder() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let cells = "cloud-thin-front-front,cloud-dense-front-front,cloud-surface-front-front";
    let shared = ["benchmark", "-o", "out", "--cells", cells, "--methods", "beer", "--budget", "bytes=16KiB"];
    let shard = &|part: &str| succeed(dir.path(), &[&shared[..], &["--shard", part]].concat()).stdout;
    let said = std::thread::scope(|scope| {
        let jobs = ["1/2", "2/2"].map(|part| scope.spawn(move || shard(part)));
        jobs.map(|job| job.join().unwrap())
    });
    assert!(
        said.concat().contains(": 1 cells are measured") && said.concat().contains(": 2 cells"),
        "{said:?}"
    );
    assert!(!dir.path().join("out/benchmark.csv").exists(), "a shard writes no tables");

    // The command without a shard writes the tables, and measures no cell again.
    let recorded = || {
        let files = fs::read_dir(dir.path().join("out/cells")).unwrap().map(|file| file.unwrap().path());
        files.map(|path| (fs::metadata(&path).unwrap().modified().unwrap(), path)).collect::<Vec<_>>()
    };
    let before = recorded();
    succeed(dir.path(), &shared);
    let table = rows(&fs::read_to_string(dir.path().join("out/benchmark.csv")).unwrap());
    let named: Vec<_> = table.iter().map(|row| &*row["cell"]).collect();
    assert_eq!(named, ["cloud-thin-front-front", "cloud-dense-front-front", "cloud-surface-front-front"]);
    assert_eq!(recorded(), before);
}

/// The exported transmittances are those that answers are compared with, and the exported scene is one to draw.
#[test]
fn exported_cells_have_the_exact_answers_of_their_points() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let name = "cloud-thin-lamp-front";
    let run = |more: &[&str]| {
        succeed(dir.path(), more);
    };
    run(&["benchmark", "--cells", name, "--export", "exported"]);
    let [exact, points] = ["exact.txt", "points.txt"]
        .map(|file| fs::read_to_string(dir.path().join("exported").join(name).join(file)).unwrap());
    assert_eq!((exact.lines().count(), points.lines().count()), (20_000, 20_000));

    let copied = format!("one=cut -d ' ' -f 1 exported/{name}/exact.txt > \"$UMBRAVOX_TRANSMITTANCES\"");
    let same = format!("same=cmp exported/{name}/points.txt \"$UMBRAVOX_POINTS\"");
    let programs = ["--external", &copied, "--external", &same];
    let budget = ["--methods", "osm", "--budget", "bytes=1KiB"];
    run(&[&["benchmark", "--cells", name, "-o", "out"], &programs[..], &budget].concat());
    let table = rows(&fs::read_to_string(dir.path().join("out/benchmark.csv")).unwrap());
    let [one, same] = ["one", "same"].map(|of| table.iter().find(|row| row["method"] == of).unwrap());
    assert_eq!((&*one["point_err_rms"], &*one["point_err_max"]), ("0.0", "0.0"));
    assert!(same["note"].contains("neither"), "the points are the same: {same:?}");
    let scene = format!("exported/{name}/scene.toml");
    run(&["render", "--scene", &scene, "--size", "16x16", "-o", "picture.png"]);
}

#[test]
fn a_program_that_fails_is_noted_and_the_others_go_on() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let arguments = [
        "benchmark",
        "-o",
        "out",
        "--cells",
        "fur-thin-front-front",
        "--methods",
        "rays",
        "--budget",
        "bytes=1KiB",
        "--external",
        "broken=echo no memory >&2; exit 3",
        "--external",
        r#"short=echo 1 > "$UMBRAVOX_TRANSMITTANCES""#,
        "--external",
        "silent=true",
        "--external",
        r#"painter=sed s/.*/1/ "$UMBRAVOX_POINTS" > "$UMBRAVOX_TRANSMITTANCES"; echo no > "$UMBRAVOX_PICTURE""#,
    ];
    succeed(dir.path(), &arguments);
    let table = rows(&fs::read_to_string(dir.path().join("out/benchmark.csv")).unwrap());
    let notes: HashMap<_, _> = table.iter().map(|row| (&*row["method"], &*row["note"])).collect();
    assert!(notes["broken"].contains("no memory") && notes["broken"].contains('3'), "{notes:?}");
    assert!(notes["short"].contains("1 lines for 20000 points"), "{notes:?}");
    assert!(notes["silent"].contains("neither"), "{notes:?}");
    assert!(notes["painter"].contains("picture.exr"), "{notes:?}");
    for row in &table {
        // `rays` store nothing.
        assert_eq!(row["point_err_rms"].is_empty(), row["method"] != "painter", "{row:?}");
        assert!(row["image_rmse"].is_empty(), "{row:?}");
    }
}
