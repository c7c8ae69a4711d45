//! Comparison of scenes with several lights: rows for all together, and with `--each-light` for each alone.

use super::{read_csv, run};
use crate::common;
use std::collections::HashMap;

const TINY: [&str; 13] = [
    "compare",
    "phantom:sphere:24",
    "--size=32x32",
    "--points=600",
    "--rays=60",
    "--depths=40",
    "--repeats=1",
    "--tf",
    "tf.json",
    "-o",
    "out",
    "--methods",
    "none;rays;dsm:map=64,epsilon=0.02",
];
const FIRST: &str = "dir:0.5,0.5,0.7071";
const SECOND: &str = "point:-60,20,30,color=#ff8000,intensity=0.5";
const DARK: &str = "dir:1,0,0,intensity=0";

fn rows(lights: &[&str], flags: &[&str]) -> (tempfile::TempDir, Vec<HashMap<String, String>>) {
    let dir = tempfile::tempdir().unwrap();
    let lights = lights.iter().flat_map(|light| ["--light", light]);
    let line: Vec<_> = TINY.into_iter().chain(lights).chain(flags.iter().copied()).collect();
    run(dir.path(), &line);
    let rows = read_csv(&dir.path().join("out/compare.csv"));
    (dir, rows)
}

#[test]
fn a_row_is_of_all_lights_and_each_light_has_its_own() {
    if !common::has_adapter() {
        return;
    }
    let (dir, rows) = rows(&[FIRST, DARK, SECOND], &["--each-light"]);
    let of = |row: &HashMap<String, String>| {
        ["scene", "lights", "light", "method"].map(|column| row[column].clone()).join("|")
    };
    let named: Vec<_> = rows.iter().map(of).collect();
    let scenes = [("", "2", ""), (" light 1", "1", "1"), (" light 3", "1", "3")];
    let expected: Vec<_> = scenes
        .iter()
        .flat_map(|(scene, lights, light)| {
            ["none", "rays", "dsm"].map(|method| format!("sphere:24, haze{scene}|{lights}|{light}|{method}"))
        })
        .collect();
    assert_eq!(named, expected);

    let number = |row: usize, column: &str| rows[row][column].parse::<f64>().unwrap();
    for column in ["bytes", "bytes_used", "nodes_total"] {
        let [all, first, second] = [2, 5, 8].map(|row| number(row, column));
        assert!(first > 0.0 && second > 0.0);
        assert_eq!(all, first + second, "{column}");
    }
    for method in 0..3 {
        // The points of all lights are divided among them: their mean square lies between those of the two.
        let rms = [0, 3, 6].map(|scene| number(scene + method, "point_err_rms"));
        let (least, most) = (rms[1].min(rms[2]), rms[1].max(rms[2]));
        assert!((0.8 * least..=1.2 * most).contains(&rms[0]), "{rms:?}");
        assert_eq!(number(method, "rays_tested"), number(3 + method, "rays_tested"));
    }
    for row in [1, 2, 4, 5, 7, 8] {
        assert_eq!(rows[row]["bound_held"], "true", "{}", named[row]);
        assert!(number(row, "image_rmse") < 0.02, "{}: {}", named[row], number(row, "image_rmse"));
    }
    assert!(number(2, "bound") >= number(5, "bound").max(number(8, "bound")));
    assert!(rows[2]["left_out"].contains("light 2 of 3 (its intensity is 0)"), "{}", rows[2]["left_out"]);
    assert!(rows[0]["left_out"].contains("1 of 2 passes over the picture"), "{}", rows[0]["left_out"]);
    assert!(number(0, "image_rmse") > 0.05, "no shadows are far off");

    // Each scene can be run again by its file.
    let read = |name: &str| std::fs::read_to_string(dir.path().join("out").join(name)).unwrap();
    assert!(read("sphere-24--haze_scene.toml").contains("light = [\"dir:"));
    assert!(
        read("sphere-24--haze-light-3_scene.toml").contains("light = \"point:-60.0,20.0,30.0,color=#ff8000")
    );
    let again: serde_json::Value = serde_json::from_str(&read("run.json")).unwrap();
    let again = again["again"].as_str().unwrap();
    assert!(again.ends_with("--each-light -o again") && again.matches("--scene").count() == 1, "{again}");
}

#[test]
fn one_light_is_measured_as_if_there_could_be_no_other() {
    if !common::has_adapter() {
        return;
    }
    let (_one, one) = rows(&[FIRST], &[]);
    let (_dark, dark) = rows(&[DARK, FIRST], &[]);
    assert_eq!((one[2]["lights"].as_str(), one[2]["light"].as_str()), ("1", ""));
    for (one, dark) in one.iter().zip(&dark) {
        for column in ["ray_err_max", "point_err_rms", "image_rmse", "bytes", "map", "bound_held", "lights"] {
            assert_eq!(one[column], dark[column], "{}: {column}", one["method"]);
        }
    }
}
