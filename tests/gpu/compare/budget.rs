//! Search for settings within budgets: planted errors, bytes and times decide, and the command reports its choice.

use super::planted::{EXTINCTION, compared_within, haze, scene};
use super::{TF, read_csv};
use crate::common;
use crate::program::{refused, succeed, umbravox};
use std::collections::{HashMap, HashSet};
use std::process::Command;
use std::sync::Arc;
use std::thread::sleep;
use std::time::Duration;
use umbravox::error::Result;
use umbravox::measure::budget::Budget;
use umbravox::measure::journal::JOURNAL;
use umbravox::open::{VolumeSpec, load};
use umbravox::render::{DeviceTransfer, DisabledOptimizations, LoadedVolume};
use umbravox::report::run::Run;
use umbravox::shadow::{
    BuildContext, Entry, Key, Lookup, Marker, Method, ShadowMap, Style, Value, parse, parse_list,
};

/// Bytes that each level of the planted method adds, and its build time.
const LEVEL_BYTES: u64 = 1000;
const LEVEL_MS: f64 = 400.0;

/// Planted shadow method: each level takes more memory and time and has a smaller error, a smaller excess of
/// extinction.
static LEVELS: Entry = Entry {
    name: "levels",
    summary: "planted",
    keys: &[Key {
        name: "level",
        ..Key::whole([0, 6], "5", "planted").search(&["0", "1", "2", "3", "4", "5", "6"])
    }],
    make: |values| match values {
        [Value::Whole(level)] => Some(Box::new(Levels { level: *level, inner: parse("dsm:map=64").ok()? })),
        _ => None,
    },
    compared: "",
    curve: "",
    stability: "",
    published: None,
    style: Style { color: [1, 2, 3], marker: Marker::Star },
};

#[derive(Debug)]
struct Levels {
    level: u32,
    inner: Box<dyn Method>,
}

impl Method for Levels {
    fn entry(&self) -> &'static Entry {
        &LEVELS
    }

    fn values(&self) -> Vec<Value> {
        vec![Value::Whole(self.level)]
    }

    fn lookup(&self) -> Option<Lookup> {
        self.inner.lookup()
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let loaded = LoadedVolume::new(context.gpu(), Arc::new(context.volume.clone()))?;
        let dark = haze(EXTINCTION * f64::from(8 - self.level));
        let transfer = DeviceTransfer::new(context.gpu(), &loaded, &dark, DisabledOptimizations::NONE)?;
        sleep(Duration::from_secs_f64(1e-3 * LEVEL_MS * f64::from(self.level)));
        let mut shadow = self.inner.build(&BuildContext { transfer: &transfer, ..*context })?;
        shadow.report.bytes = LEVEL_BYTES * u64::from(self.level + 1);
        Ok(shadow)
    }
}

#[test]
fn planted_bytes_and_times_decide_and_the_closest_is_chosen() {
    let volume = Arc::new(load(&VolumeSpec::new("phantom:slab:16")).unwrap());
    let scene = scene(&volume);
    let mut methods = parse_list("none").unwrap();
    methods.push((LEVELS.make)(&[Value::Whole(2)]).unwrap());
    // Level 2 fits the bytes, level 3 the time with half a level to spare.
    let budgets = [Budget::Bytes(3 * LEVEL_BYTES + 1), Budget::Ms(3.5 * LEVEL_MS + 100.0)];
    let Some(result) = compared_within(&volume, &scene, &methods, &budgets) else { return };
    assert!(result.failures.is_empty());
    let rows = result.rows();
    let said: Vec<_> = rows.iter().map(|r| (&*r.method, r.tuned, &*r.tuned_for)).collect();
    let [bytes, ms] = ["bytes=3001", "ms=1500"].map(|b| format!("{b} point_err_rms; {b} image_rmse"));
    // A tuned method that was also requested is no second row.
    assert_eq!(
        said,
        [("none", Some(false), ""), ("levels", Some(true), &*bytes), ("levels", Some(true), &*ms)]
    );
    assert_eq!((rows[1].bytes, rows[2].bytes), (Some(3 * LEVEL_BYTES), Some(4 * LEVEL_BYTES)));
    assert!(rows[2].moving_ms().unwrap() <= 1500.0 && rows[2].build_ms_min.unwrap() >= 3.0 * LEVEL_MS);
    assert!(rows[2].point_err_rms.unwrap() < rows[1].point_err_rms.unwrap());

    // Trials: each level once, errors where a budget holds it, as large as in the rows.
    let mut tried: Vec<_> = result.trials.iter().map(|t| t.bytes.unwrap() / LEVEL_BYTES - 1).collect();
    tried.sort_unstable();
    assert!(tried.windows(2).all(|ab| ab[0] < ab[1]), "{tried:?}");
    for trial in &result.trials {
        let level = trial.bytes.unwrap() / LEVEL_BYTES - 1;
        assert!(trial.build_ms.unwrap() >= LEVEL_MS * level as f64);
        assert_eq!(trial.point_err_rms.is_some(), level <= 3, "{trial:?}");
        let row = rows[1..].iter().find(|r| r.bytes == trial.bytes);
        assert_eq!(row.map(|r| &r.tuned_for), Some(&trial.tuned_for).filter(|t| !t.is_empty()));
        if let Some(row) = row {
            let (a, b) = (row.point_err_rms.unwrap(), trial.point_err_rms.unwrap());
            assert!(
                (a - b).abs() < 1e-9 && (row.image_rmse.unwrap() - trial.image_rmse.unwrap()).abs() < 1e-9
            );
        }
    }
}

#[test]
fn impossible_budgets_are_reported() {
    let volume = Arc::new(load(&VolumeSpec::new("phantom:slab:8")).unwrap());
    let methods = parse_list("none;osm:map=16").unwrap();
    let budgets = [Budget::Bytes(5)];
    let Some(result) = compared_within(&volume, &scene(&volume), &methods, &budgets) else { return };
    assert!(
        result.notes.iter().any(|n| n.starts_with("osm: no settings within bytes=5; the least")),
        "{:?}",
        result.notes
    );
    assert!(result.rows().iter().all(|r| r.tuned == Some(false)) && result.rows().len() == 2);
    assert!(!result.trials.is_empty());
}

/// Reads a CSV table with other columns than `compare.csv`.
fn read_any(path: &std::path::Path) -> Vec<HashMap<String, String>> {
    csv::Reader::from_path(path).unwrap().deserialize().map(|row| row.unwrap()).collect()
}

fn command(folder: &std::path::Path, extra: &[&str]) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_umbravox"));
    command.current_dir(folder).args([
        "compare",
        "phantom:sphere:16",
        "--tf=tf.json",
        "--size=24x24",
        "-o",
        "out",
    ]);
    command.args([
        "--points=300",
        "--rays=20",
        "--depths=20",
        "--repeats=1",
        "--methods=none;rays;osm:map=64",
    ]);
    command.args(extra).output().unwrap()
}

#[test]
fn the_command_writes_trials_and_answers_and_goes_on_with_them() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    std::fs::write(folder.join("tf.json"), TF).unwrap();
    let budgets = ["--budget=bytes=64KiB,256KiB", "--budget", "ms=400,frames=400"];
    let output = command(folder, &budgets);
    let (stdout, stderr) =
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert!(output.status.success(), "{stderr}");
    assert!(
        stdout.contains("Closest within each budget") && stdout.contains("- bytes=64KiB, point err rms: osm"),
        "{stdout}"
    );
    assert!(stdout.contains("- ms=400, image rmse: "), "{stdout}");
    assert!(stdout.contains("- frames=400, image rmse: "), "{stdout}");
    let out = folder.join("out");
    let rows = read_csv(&out.join("compare.csv"));
    for (budget, most) in [("bytes=64KiB", 64 << 10), ("bytes=256KiB", 256 << 10)] {
        let chosen: Vec<_> = rows.iter().filter(|r| r["tuned_for"].contains(budget)).collect();
        assert!((1..=2).contains(&chosen.len()), "a row for each error, or one for both");
        for row in chosen {
            assert!(
                row["tuned"] == "true"
                    && row["bytes"].parse::<u64>().unwrap() <= most
                    && row["method"] == "osm"
            );
        }
    }
    assert!(rows.iter().all(|r| !r["tuned"].is_empty() && r["status"] == "ok"));
    let number = |row: &HashMap<String, String>, column: &str| row[column].parse::<f64>().ok();
    let moving_ms = |row: &HashMap<String, String>| Some(number(row, "build_ms")? + number(row, "frame_ms")?);
    let none_ms = moving_ms(rows.iter().find(|row| row["method"] == "none").unwrap()).unwrap();
    for row in &rows {
        let expected = moving_ms(row).unwrap() / none_ms;
        assert!((number(row, "frames").unwrap() / expected - 1.0).abs() < 1e-3, "{}", row["params"]);
    }
    let trials = read_any(&out.join("trials.csv"));
    let mut settings: Vec<_> = trials.iter().map(|t| (&t["params"], &t["map"])).collect();
    settings.sort_unstable();
    settings.dedup();
    assert!(trials.len() > 10 && settings.len() == trials.len(), "each setting once");
    // No other trial within the budget has a smaller error than the chosen one.
    assert!(trials.iter().all(|t| number(t, "frames").is_some_and(|frames| frames > 0.0)));
    for (budget, most) in [("bytes=64KiB", 65536.0), ("bytes=256KiB", 262_144.0)] {
        for by in ["point_err_rms", "image_rmse"] {
            let chosen = trials.iter().find(|t| t["tuned_for"].contains(&format!("{budget} {by}"))).unwrap();
            let within = trials.iter().filter(|t| number(t, "bytes").is_some_and(|n| 0.0 < n && n <= most));
            let least = within.filter_map(|t| number(t, by)).reduce(f64::min).unwrap();
            assert_eq!(number(chosen, by), Some(least), "{budget} {by}");
        }
    }
    let ranked = read_any(&out.join("budgets.csv"));
    assert!(ranked.iter().any(|r| r["budget"] == "bytes=64KiB" && r["rank"] == "1" && r["method"] == "osm"));
    assert!(
        ranked.iter().all(|r| !r["budget"].starts_with("bytes") || r["method"] != "rays"),
        "it stores nothing"
    );

    // Resuming repeats no trial, and chooses the same settings.
    let journal = std::fs::read(out.join(JOURNAL)).unwrap();
    let (before, answers) =
        (std::fs::read(out.join("trials.csv")).unwrap(), std::fs::read(out.join("budgets.csv")).unwrap());
    assert!(command(folder, &[&budgets[..], &["--resume"]].concat()).status.success());
    assert_eq!(std::fs::read(out.join(JOURNAL)).unwrap(), journal);
    assert_eq!(
        (std::fs::read(out.join("trials.csv")).unwrap(), std::fs::read(out.join("budgets.csv")).unwrap()),
        (before, answers)
    );
}

#[test]
fn a_tuned_folder_is_recorded_gone_on_with_merged_and_removed_whole() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    std::fs::write(folder.join("tf.json"), TF).unwrap();
    let status = |args: &[&str]| {
        let common = ["--points=300", "--rays=20", "--depths=20", "--repeats=1", "--size=24x24"];
        let scene = ["compare", "phantom:sphere:16", "--tf=tf.json"];
        let output = umbravox(folder, &[&scene[..], &common, args].concat());
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let tuned = |out: &str, methods: &str, more: &[&str]| {
        status(&[&["-o", out, "--methods", methods, "--budget=bytes=64KiB"], more].concat())
    };
    let files = |out: &str| -> Vec<String> {
        let names = std::fs::read_dir(folder.join(out)).unwrap();
        names.map(|f| f.unwrap().file_name().into_string().unwrap()).collect()
    };
    assert_eq!(tuned("one", "none;osm:map=64", &[]).0, Some(0));
    let run = Run::read(&folder.join("one")).unwrap().unwrap();
    assert!(run.rows.iter().filter(|r| r.chosen).count() >= 1, "{:?}", run.rows);
    assert!(run.again.contains("--budget bytes=64KiB"), "{}", run.again);
    assert!(files("one").iter().all(|name| run.files.contains(name)), "{:?}", files("one"));

    // A table can be resumed with the same budget or more budgets, but not without.
    let (code, stderr) = status(&["-o", "one", "--methods=none;osm:map=64", "--resume"]);
    assert!(code == Some(2) && stderr.contains("tuned within bytes=64KiB"), "{stderr}");
    let (code, stderr) = tuned("one", "none;osm:map=64", &["--budget=bytes=32KiB", "--resume"]);
    assert_eq!(code, Some(0), "{stderr}");
    let run = Run::read(&folder.join("one")).unwrap().unwrap();
    assert!(files("one").iter().all(|name| run.files.contains(name)), "{:?}", files("one"));

    // Methods tuned in separate runs merge into one table; other budgets do not.
    assert_eq!(tuned("two", "dom:layers=2,map=64", &["--budget=bytes=32KiB"]).0, Some(0));
    succeed(folder, &["merge", "one", "two", "-o", "all"]);
    let [one, two, all] =
        ["one", "two", "all"].map(|out| read_any(&folder.join(out).join("trials.csv")).len());
    assert_eq!(one + two, all);
    let ranked = read_any(&folder.join("all/budgets.csv"));
    let methods: HashSet<_> =
        ranked.iter().filter(|r| r["budget"] == "bytes=64KiB").map(|r| r["method"].as_str()).collect();
    assert_eq!(methods, HashSet::from(["osm", "dom"]));
    assert_eq!(tuned("three", "dom:layers=2,map=64", &[]).0, Some(0));
    let stderr = refused(folder, &["merge", "one", "three", "-o", "no"]);
    assert!(stderr.contains("it is tuned within bytes=64KiB, not bytes=64KiB, bytes=32KiB"), "{stderr}");

    // As if the first run had ended before it recorded its choice: its pictures still belong to the table.
    let mut run = Run::read(&folder.join("one")).unwrap().unwrap();
    run.rows.retain(|r| !r.chosen);
    run.files = run.file_names();
    run.write(&folder.join("one")).unwrap();
    let (code, stderr) = status(&["-o", "one", "--methods=none", "--overwrite"]);
    assert_eq!(code, Some(0), "{stderr}");
    let left = files("one");
    assert!(!left.iter().any(|name| name.starts_with("picture_osm") || name == "trials.csv"), "{left:?}");
}

#[test]
fn bad_budgets_are_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("tf.json"), TF).unwrap();
    for bad in ["2MiB", "bytes=0", "ms=fast", "texels=5"] {
        let output = command(dir.path(), &["--budget", bad]);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{bad}: {stderr}");
        assert!(stderr.starts_with("error: bad budget (--budget") && stderr.lines().count() == 1, "{stderr}");
    }
    let without =
        ["compare", "phantom:sphere:16", "--tf=tf.json", "--methods=osm:map=64", "--budget=frames=3"];
    let output = umbravox(dir.path(), &[&without[..], &["-o", "out"]].concat());
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && stderr.contains("needs the method none"), "{stderr}");
    assert!(!dir.path().join("out").exists());
}
