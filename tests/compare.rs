//! `umbravox compare`, run as a user runs it, on a tiny phantom.

mod cli;

use cli::{refused, umbravox};
use std::collections::HashMap;
use std::path::Path;
use umbravox::gpu::Gpu;
use umbravox::measure::table::COLUMNS;

const TINY: [&str; 13] = [
    "compare",
    "phantom:sphere:24",
    "--size=32x32",
    "--points=500",
    "--rays=50",
    "--depths=40",
    "--repeats=1",
    "--tf",
    "tf.json",
    "-o",
    "out",
    "--methods",
    "none;rays;dsm:map=64,epsilon=0.06,0.02;dsm:map=64,prefilter=5",
];

/// Extinction that rises slowly with the value, and not at once to opaque.
const TF: &str =
    r#"{"name": "haze", "points": [{"value": 200, "extinction": 0}, {"value": 1000, "extinction": 0.1}]}"#;

fn no_adapter(test: &str) -> bool {
    let missing = Gpu::open(None).is_err();
    if missing {
        println!("skipped: {test}: there is no graphics adapter");
    }
    missing
}

/// Runs in `folder` and gives stdout.
fn run(folder: &Path, args: &[&str]) -> String {
    std::fs::write(folder.join("tf.json"), TF).unwrap();
    let output = umbravox(folder, args);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {stderr}");
    assert!(stderr.contains("compare.csv") && !stderr.contains("failed"), "{stderr}");
    String::from_utf8(output.stdout).unwrap()
}

fn read_csv(path: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), COLUMNS);
    reader.deserialize().map(|row| row.unwrap()).collect()
}

#[test]
fn the_table_has_a_row_a_setting_and_every_file_is_there() {
    if no_adapter("compare") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let stdout = run(dir.path(), &TINY);
    assert_eq!(stdout.lines().filter(|l| l.starts_with('|')).count(), 2 + 5, "{stdout}");

    let out = dir.path().join("out");
    let rows = read_csv(&out.join("compare.csv"));
    let named: Vec<_> = rows.iter().map(|r| format!("{} {}", r["method"], r["params"])).collect();
    let expected = ["none ", "rays ", "dsm epsilon=0.06", "dsm epsilon=0.02", "dsm epsilon=0.02 prefilter=5"];
    assert_eq!(named, expected);
    let number = |row: usize, column: &str| rows[row][column].parse::<f64>().unwrap();
    for (i, row) in rows.iter().enumerate() {
        assert_eq!((row["scene"].as_str(), row["width"].as_str()), ("sphere:24, haze", "32"));
        assert!(number(i, "frame_ms") > 0.0 && number(i, "fps_moving") > 0.0);
        assert!(number(i, "image_rmse") < 0.2);
        assert!(number(i, "point_err_rms") <= number(i, "point_err_max"));
    }
    // What promises something keeps it; what promises nothing says so.
    let held: Vec<_> = rows.iter().map(|r| r["bound_held"].as_str()).collect();
    assert_eq!(held, ["", "yes", "yes", "yes", "yes"]);
    assert_eq!((rows[0]["bound"].as_str(), rows[0]["bytes"].as_str()), ("", "0"));
    for (row, epsilon) in [(2, 0.06), (3, 0.02)] {
        assert!((epsilon..epsilon + 0.005).contains(&number(row, "bound")));
        assert!(number(row, "build_ms") > 0.0 && number(row, "nodes_total") > 0.0);
        assert!(number(row, "point_err_rms") < 0.5 * number(0, "point_err_rms"));
    }
    assert!(number(1, "ray_err_max") < 0.01, "rays are close to exact");
    assert!(number(0, "ray_err_max") > 0.5, "no shadows are not");
    assert!(rows[0]["left_out"].contains("shadow pass"));

    let mut names: Vec<_> =
        std::fs::read_dir(&out).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let dsm = ["dsm-map-64-epsilon-0.02", "dsm-map-64-epsilon-0.02-prefilter-5", "dsm-map-64-epsilon-0.06"];
    let mut files: Vec<String> =
        ["csv", "json", "md", "png", "svg", "tex"].map(|e| format!("compare.{e}")).into();
    files.extend(["compare_bytes.png", "compare_bytes.svg", "pictures.md", "report.html"].map(String::from));
    files.extend(["none", "rays"].iter().chain(&dsm).map(|slug| format!("picture_{slug}.png")));
    files.extend(["none"].iter().chain(&dsm).map(|slug| format!("difference_{slug}.png")));
    files.sort();
    assert_eq!(names, files);

    // A row of the table, two plots; a picture a row, errors of all but `rays`, and nodes of the deep shadow maps.
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(report.matches("<tr><th scope=\"row\"").count(), 5);
    assert_eq!(report.matches("<svg ").count(), 2 + 3);
    assert_eq!(report.matches("<img ").count(), 5 + 4 + 3);
    let total = format!("<figcaption>{} nodes in ", rows[3]["nodes_total"]);
    assert!(report.contains(&total), "{total}");
}

#[test]
fn json_on_stdout_is_the_file() {
    if no_adapter("compare --json") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let stdout = run(dir.path(), &[&TINY[..11], &["--methods", "none", "--json"]].concat());
    assert_eq!(stdout, std::fs::read_to_string(dir.path().join("out/compare.json")).unwrap());
    let rows: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(rows[0]["method"], "none");
}

#[test]
fn a_map_that_no_sample_needs_is_not_built() {
    if no_adapter("compare --ambient 1") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), &[&TINY[..11], &["--methods", "dsm:map=64", "--ambient=1"]].concat());
    let rows = read_csv(&dir.path().join("out/compare.csv"));
    assert_eq!((rows[0]["build_ms"].as_str(), rows[0]["bytes"].as_str()), ("0.0", "0"));
    assert_eq!((rows[0]["point_err_rms"].as_str(), rows[0]["bound_held"].as_str()), ("", ""));
    assert!(rows[0]["left_out"].contains("shadow map (ambient 1)"), "{}", rows[0]["left_out"]);
}

#[test]
fn bad_methods_are_refused_before_anything_is_made() {
    let dir = tempfile::tempdir().unwrap();
    for (methods, why) in [
        ("nonsense", "nonsense"),
        ("none;dsm:epsilon=2", "epsilon"),
        ("dsm:layers=3", "layers"),
        ("rays:map=512", "no keys"),
        ("", "NAME"),
    ] {
        let args = ["compare", "phantom:slab:8", "-o", "out", "--methods", methods];
        let error = refused(dir.path(), &args);
        assert!(error.contains("--methods") && error.contains(why), "{methods}: {error}");
    }
    for flag in ["--repeats=0", "--points=0", "--rays=0", "--depths=1"] {
        refused(dir.path(), &["compare", "phantom:slab:8", "-o", "out", flag]);
    }
}
