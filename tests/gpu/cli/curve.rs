//! `umbravox probe --curve`: against closed forms and the other outputs of `probe`, and invalid command lines.

use crate::common;
use crate::program::{refused, succeed};
use std::path::Path;
use umbravox::exact::ExactField;
use umbravox::measure::light_curve::LightCurve;
use umbravox::open::{VolumeSpec, load};
use umbravox::scene::Light;
use umbravox::transfer::TransferFunction;

use glam::DVec3;

const UNIFORM: &str = r##"{"name": "fog", "points": [{"value": 0, "extinction": 0.05}]}"##;

struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

fn table(text: &str) -> Table {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names = reader.headers().unwrap().iter().map(String::from).collect();
    let numbers = |r: csv::StringRecord| r.iter().map(|cell| cell.parse().unwrap()).collect();
    Table { names, rows: reader.records().map(|r| numbers(r.unwrap())).collect() }
}

fn stdout_of(folder: &Path, args: &[&str]) -> String {
    succeed(folder, args).stdout
}

#[test]
fn uniform_matter_gives_the_exponential_under_both_lights() {
    let volume = load(&VolumeSpec::new("phantom:slab:16")).unwrap();
    let tf = TransferFunction::from_json(UNIFORM).unwrap();
    let field = ExactField::new(&volume, &tf);
    let center = volume.center_mm();
    let far = center + DVec3::new(20.0, 30.0, 500.0);
    let lights = [
        Light::Directional { toward: DVec3::new(0.3, -0.2, 0.8) },
        Light::Point { position: far },
        Light::Point { position: center + DVec3::new(0.5, 0.25, 1.0) },
    ];
    for light in lights {
        let point = center + DVec3::new(1.0, -2.0, 0.5);
        let curve = LightCurve::through(&field, &light, point).unwrap();
        assert!(curve.at(curve.point_depth_mm).distance(point) < 1e-9, "{light:?}");
        for (z, t) in curve.depth_mm.iter().zip(&curve.exact) {
            assert!((t - (-0.05 * z).exp()).abs() < 1e-12, "{light:?}: {z} {t}");
            let asked = field.transmittance_to_light(curve.at(*z), &light);
            assert!((t - asked).abs() < 1e-9, "{light:?}: {z}: {t} {asked}");
        }
        assert_eq!((curve.depth_mm[0], curve.depth_mm.last()), (0.0, Some(&curve.length_mm)));
    }
    // For a light inside the volume, depth counts from the light.
    let curve = LightCurve::through(&field, &lights[2], center).unwrap();
    assert!(curve.origin_mm.distance(center + DVec3::new(0.5, 0.25, 1.0)) < 1e-12);
}

#[test]
fn a_slab_gives_its_closed_form() {
    // 1000 on the planes 8 to 23 of 32 and 0 elsewhere: a voxel of ramp, fifteen of plateau, a voxel of ramp.
    let volume = load(&VolumeSpec::new("phantom:slab:32")).unwrap();
    let json =
        r#"{"name": "s", "points": [{"value": 0, "extinction": 0}, {"value": 1000, "extinction": 0.08}]}"#;
    let tf = TransferFunction::from_json(json).unwrap();
    let field = ExactField::new(&volume, &tf);
    let center = volume.center_mm();
    let h = volume.min_spacing_mm();
    let light = Light::Directional { toward: DVec3::Z };
    let curve = LightCurve::through(&field, &light, center).unwrap();
    for (&z, &t) in curve.depth_mm.iter().zip(&curve.exact) {
        // Position below plane 24, in voxels; the light enters at plane 31.5.
        let u = z / h - 7.5;
        let voxels = match u {
            _ if u <= 0.0 => 0.0,
            _ if u <= 1.0 => 0.5 * u * u,
            _ if u <= 16.0 => u - 0.5,
            _ if u <= 17.0 => 16.0 - 0.5 * (17.0 - u).powi(2),
            _ => 16.0,
        };
        assert!((t - (-0.08 * h * voxels).exp()).abs() < 1e-12, "{z}: {t}");
    }
    assert!((curve.length_mm - 32.0 * h).abs() < 1e-9 && (curve.point_depth_mm - 16.0 * h).abs() < 1e-9);
}

#[test]
fn the_table_has_a_column_a_method_and_the_exact_one() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("tf.json"), UNIFORM).unwrap();
    let args = [
        "probe",
        "phantom:slab:16",
        "--tf",
        "tf.json",
        "--curve",
        "0,0,0",
        "--methods",
        "none;rays;dsm:epsilon=0.06,0.01,map=32",
    ];
    let found = table(&stdout_of(dir.path(), &args));
    let methods = ["none", "rays", "dsm epsilon=0.06", "dsm epsilon=0.01"];
    assert_eq!(found.names, [&["depth_mm", "x_mm", "y_mm", "z_mm", "exact"], &methods[..]].concat());
    assert!(found.rows.len() >= 801);
    for row in &found.rows {
        let (z, exact) = (row[0], row[4]);
        assert!((exact - (-0.05 * z).exp()).abs() < 1e-12);
        assert_eq!(row[5], 1.0, "none");
        for (value, tolerance) in [(row[6], 0.002), (row[7], 0.07), (row[8], 0.02)] {
            assert!((value - exact).abs() < tolerance, "{row:?}");
        }
    }

    // `probe` without --curve gives the same transmittance at that point.
    let row = &found.rows[found.rows.len() / 2];
    std::fs::write(dir.path().join("p.txt"), format!("{} {} {}", row[1], row[2], row[3])).unwrap();
    let points = ["probe", "phantom:slab:16", "--tf", "tf.json", "--points", "p.txt", "--shadow", "rays"];
    let answer = stdout_of(dir.path(), &points);
    let answer: Vec<f64> = answer.split_whitespace().map(|w| w.parse().unwrap()).collect();
    assert!((answer[0] - row[6]).abs() < 1e-6 && (answer[1] - row[4]).abs() < 1e-9, "{answer:?}");
}

#[test]
fn a_folder_gets_the_table_and_all_plots_and_a_file_only_itself() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let ask = |more: &[&str]| {
        let args = ["probe", "phantom:slab:16", "--curve", "0,0,0", "--light", "point:40,50,300"];
        stdout_of(dir.path(), &[&args[..], more].concat())
    };
    let said = ask(&["--methods", "dsm:map=32", "-o", "out"]);
    assert!(said.contains("depth 0 at ") && said.contains("dsm epsilon=0.02: largest error 0."), "{said}");
    let file = |name: &str| dir.path().join(name);
    let csv = std::fs::read_to_string(file("out/curve.csv")).unwrap();
    assert!(csv.starts_with("depth_mm,x_mm,y_mm,z_mm,exact,dsm epsilon=0.02\n0.0,"));
    let svg = std::fs::read_to_string(file("out/curve.svg")).unwrap();
    assert!(svg.contains("light point:40,50,300") && svg.contains("dsm epsilon=0.02"));
    assert_eq!(image::open(file("out/curve.png")).unwrap().width(), 2000);
    assert!(std::fs::read(file("out/curve.pdf")).unwrap().starts_with(b"%PDF-"));
    assert_eq!(std::fs::read_dir(file("out")).unwrap().count(), 4);

    ask(&["--shadow", "osm:map=32,layers=8", "-o", "one.svg"]);
    assert!(std::fs::read_to_string(file("one.svg")).unwrap().contains("osm layers=8"));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);

    let json: serde_json::Value = serde_json::from_str(&ask(&["--methods", "none", "--json"])).unwrap();
    assert_eq!(json["depth_mm"].as_array().unwrap().len(), json["exact"].as_array().unwrap().len());
    assert_eq!(json["methods"][0]["transmittance"][0], 1.0);
}

#[test]
fn a_point_outside_is_legal_while_its_ray_meets_the_volume() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let args = ["--methods", "none", "--light", "dir:0,0,1", "--curve"];
    let along = |point: &str| {
        table(&stdout_of(dir.path(), &[&["probe", "phantom:slab:16"], &args[..], &[point]].concat()))
    };
    let (inside, outside) = (along("0,0,0"), along("0,0,-5000"));
    assert_eq!(inside.rows.len(), outside.rows.len());
    for (a, b) in inside.rows.iter().zip(&outside.rows) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    }
    let volume = ["probe", "phantom:slab:16"];
    let error = refused(dir.path(), &[&volume, &args[..], &["5000,0,0"]].concat());
    assert!(error.contains("(--curve: 5000,0,0): the light ray through it misses the volume"), "{error}");
}

#[test]
fn bad_curves_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("rays.txt"), "0 0 0 1 1 1").unwrap();
    let ask = |more: &[&str]| refused(dir.path(), &[&["probe", "phantom:slab:8"], more].concat());
    for (args, why) in [
        (&["--curve", "1,2"][..], "three numbers"),
        (&["--curve", "1,2,nan"], "finite"),
        (&["--curve", "0,0,0", "--methods", "nonsense"], "nonsense"),
        (&["--curve", "0,0,0", "--methods", "dsm:layers=3"], "layers"),
        (&["--curve", "0,0,0", "--shadow", "dsm:epsilon=7"], "epsilon"),
        (&["--curve", "0,0,0", "--rays", "rays.txt"], "cannot be used with"),
        (&["--curve", "0,0,0", "-o", "no/such/f.csv"], "no folder"),
        (&["--curve", "0,0,0", "-o", "rays.txt"], ".svg"),
        (&["--curve", "0,0,0", "-o", "curve.bmp"], ".svg"),
        (&["--curve", "1,2,3", "--light", "point:1,2,3"], "the light is at this very point"),
        (&["--rays", "rays.txt", "-o", "x"], "cannot be used with"),
        (&["--rays", "rays.txt", "--methods", "none"], "cannot be used with"),
    ] {
        let error = ask(args);
        assert!(error.contains(why), "{args:?}: {error}");
    }
}

#[test]
fn on_a_scan_the_curve_agrees_with_single_points() {
    for name in ["CT_AVM", "engine"] {
        let Some(path) = common::scan(name) else { continue };
        let volume = load(&VolumeSpec::new(path.to_string_lossy())).unwrap();
        let [low, high] = volume.value_range();
        let json = format!(
            r#"{{"name": "t", "points": [{{"value": {}, "extinction": 0}}, {{"value": {}, "extinction": 0.1}}]}}"#,
            low + 0.4 * (high - low),
            low + 0.6 * (high - low)
        );
        let tf = TransferFunction::from_json(&json).unwrap();
        let field = ExactField::new(&volume, &tf);
        let center = volume.center_mm();
        let light = Light::Directional { toward: DVec3::new(0.4, -0.5, 0.75) };
        let curve = LightCurve::through(&field, &light, center).unwrap();
        assert!(curve.exact.last().unwrap() < &0.9, "{name}: the ray meets something");
        for (z, t) in curve.depth_mm.iter().zip(&curve.exact).step_by(37) {
            let asked = field.transmittance_to_light(curve.at(*z), &light);
            assert!((t - asked).abs() < 1e-9, "{name}: {z}: {t} {asked}");
        }
    }
}
