//! Files named on the command line: transfer functions, scenes, rays, outputs.

use crate::program::{Printed, refused, succeed};
use std::fs;
use std::process::Command;
use std::time::Duration;

#[test]
fn bad_transfer_functions_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("tf.json");
    for (text, why) in [
        ("", "EOF"),
        ("{", "EOF"),
        ("not json", "expected"),
        ("[1, 2]", "invalid"),
        (r#"{"points": []}"#, "empty"),
        (r#"{"name": "x"}"#, "missing field `points`"),
        (r#"{"points": [{"value": 0, "opacity": 2}]}"#, "[0, 1]"),
        (r#"{"points": [{"value": 0, "opacity": "a"}]}"#, "invalid type"),
        (r#"{"points": [{"value": 0, "extinction": -1}]}"#, "negative"),
        (r#"{"points": [{"value": 0, "opacity": 0}, {"value": 1, "extinction": 0}]}"#, "one kind a file"),
        (r#"{"points": [{"value": 0, "opacity": 0, "extinction": 0}]}"#, "both"),
        (r#"{"points": [{"value": 1, "opacity": 0}, {"value": 0, "opacity": 0}]}"#, "non-decreasing"),
        (
            r#"{"points": [{"value": 1, "opacity": 0}, {"value": 1, "opacity": 0}, {"value": 1, "opacity": 0}]}"#,
            "twice",
        ),
        (r#"{"points": [{"value": 1, "opacity": 0, "colour": "x"}]}"#, "`colour`"),
        (r#"{"gamma": 2, "points": [{"value": 1, "opacity": 0}]}"#, "`gamma`"),
        (r##"{"points": [{"value": 1, "opacity": 0, "color": "#12345"}]}"##, "#rrggbb"),
        (r#"{"reference_length_mm": 0, "points": [{"value": 1, "opacity": 0}]}"#, "reference_length_mm"),
        (r#"{"points": [{"value": 1e400, "opacity": 0}]}"#, "out of range"),
    ] {
        fs::write(&path, text).unwrap();
        let error = refused(dir.path(), &["render", "phantom:slab:8", "--tf", "tf.json", "-o", "a.png"]);
        assert!(error.contains("(tf.json)") && error.contains(why), "{text}\n gave: {error}");
    }
    fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    assert!(refused(dir.path(), &["render", "--tf", "tf.json", "-o", "a.png"]).contains("UTF-8"));
    assert!(refused(dir.path(), &["render", "--tf", "gone.json", "-o", "a.png"]).contains("gone.json"));
    assert!(refused(dir.path(), &["render", "--tf", ".", "-o", "a.png"]).contains("directory"));
    assert!(refused(dir.path(), &["render", "--tf", "boen", "-o", "a.png"]).contains("neither a preset"));
}

#[test]
fn bad_scene_files_are_refused_by_key() {
    let dir = tempfile::tempdir().unwrap();
    for (text, place, why) in [
        ("fov = ", "scene.toml: line 1", ""),
        ("fov = 40\n\nfov = 50", "scene.toml: line 3", "duplicate"),
        ("fovv = 40", "scene.toml: fovv", "unknown key"),
        ("a = 1\nb = 2\nfov = 40", "scene.toml: a, b", "unknown key"),
        ("scene = 'other.toml'", "scene.toml: scene", "unknown key"),
        ("help = true", "scene.toml: help", "unknown key"),
        ("output = 'a.png'", "scene.toml: output", "unknown key"),
        ("[camera]\nfov = 40", "scene.toml: camera", "unknown key"),
        ("fov = 0", "scene.toml: fov", "179.9"),
        ("fov = nan", "scene.toml: fov", "finite"),
        ("fov = true", "scene.toml: fov", "expected a string"),
        ("eye = [1, 2]", "scene.toml: eye", "x,y,z"),
        ("eye = [1, 'x', 3]", "scene.toml: eye", "expected a string"),
        ("explain = 'yes'", "scene.toml: explain", "true or false"),
        ("shading = 'phong'", "scene.toml: shading", "'phong'"),
        ("size = '0x0'", "scene.toml: size", "WxH"),
        ("light = 'dir:0,0,0'", "scene.toml: light", "length is 0"),
        ("ambient = -1", "scene.toml: ambient", "from 0 to 1"),
        ("frame = 1.5", "scene.toml: frame", "invalid digit"),
    ] {
        fs::write(dir.path().join("scene.toml"), text).unwrap();
        let error =
            refused(dir.path(), &["render", "phantom:slab:8", "--scene", "scene.toml", "-o", "a.png"]);
        assert!(error.contains(place) && error.contains(why), "{text}\n gave: {error}");
    }
    assert!(refused(dir.path(), &["render", "--scene", "gone.toml", "-o", "a.png"]).contains("(gone.toml)"));
}

#[test]
fn flags_win_over_the_scene_file() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(
        dir.path().join("scene.toml"),
        "volume = 'gone.nii'\ntf = 'no-such'\neye = [0, 0, 0]\ntarget = '0,0,0'\nambient = 1",
    )
    .unwrap();
    fs::write(dir.path().join("rays.txt"), "-100 0 0 100 0 0\n").unwrap();
    let rays = ["probe", "--rays", "rays.txt", "--scene", "scene.toml"];
    assert!(refused(dir.path(), &rays).contains("no-such"));
    let rays = [&rays[..], &["--tf", "bone"]].concat();
    assert!(refused(dir.path(), &rays).contains("gone.nii"));
    let rays = [&rays[..], &["phantom:sphere:8"]].concat();
    assert!(refused(dir.path(), &rays).contains("eye is at the target"));
    let rays = [&rays[..], &["--eye=-50,1,1"]].concat();
    succeed(dir.path(), &rays);
}

#[test]
fn rays_are_answered_in_order_and_bad_ones_refused_by_line() {
    let dir = tempfile::tempdir().unwrap();
    // A constant extinction of ln 2 per mm in a box that is 8 voxels of 1 mm wide.
    fs::write(dir.path().join("tf.json"), r#"{"points": [{"value": 0, "opacity": 0.5}]}"#).unwrap();
    fs::write(dir.path().join("rays.txt"), "0.25 0 0 2.25 0 0\n\n0 0 900 0 0 901\n").unwrap();
    let run = ["probe", "phantom:sphere:8", "--tf", "tf.json", "--rays", "rays.txt"];
    let text = succeed(dir.path(), &run).stdout;
    let numbers: Vec<f64> = text.split_whitespace().map(|w| w.parse().unwrap()).collect();
    assert_eq!(numbers.len(), 4, "{text}");
    assert!((numbers[0] - 2.0 * std::f64::consts::LN_2).abs() < 1e-12 && (numbers[1] - 0.25).abs() < 1e-12);
    assert_eq!(numbers[2..], [0.0, 1.0]);

    // With --header the first line names the columns.
    let headed = succeed(dir.path(), &[&run[..], &["--header"]].concat()).stdout;
    assert_eq!(headed, format!("# optical_depth transmittance\n{text}"));

    fs::write(dir.path().join("rays.txt"), "0 0 0 1 1 1\n0 0 x 1 1 1\n").unwrap();
    assert!(refused(dir.path(), &run).contains("rays.txt: line 2"));
    assert!(refused(dir.path(), &["probe", "--rays", "gone.txt"]).contains("gone.txt"));
}

#[test]
fn outputs_are_refused_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    for (args, why) in [
        (&["render", "-o", "a.jpg"][..], ".png, .exr, .npy"),
        (&["render", "-o", "png"], ".png, .exr, .npy"),
        (&["render", "-o", "gone/a.png"], "no folder"),
        (&["phantom", "sphere:8", "-o", "a.nrrd"], ".nii, .nii.gz"),
        (&["phantom", "sphere:8", "-o", "gone/a.nii"], "no folder"),
    ] {
        let error = refused(dir.path(), args);
        assert!(error.contains(why), "{args:?}: {error}");
    }
    fs::create_dir(dir.path().join("a.png")).unwrap();
    assert!(refused(dir.path(), &["render", "-o", "a.png"]).contains("is a folder"));
    fs::write(dir.path().join("file"), "").unwrap();
    assert!(refused(dir.path(), &["compare", "phantom:slab:8", "-o", "file"]).contains("(file)"));
}

#[test]
fn phantoms_written_and_read_again_say_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let Printed { stdout, stderr } = succeed(dir.path(), &["phantom", "sphere:12", "-o", "s.nii.gz"]);
    assert!(stdout.is_empty() && stderr.is_empty(), "{stdout}{stderr}");
    let info = |volume: &str| -> serde_json::Value {
        serde_json::from_str(&succeed(dir.path(), &["info", volume, "--json"]).stdout).unwrap()
    };
    let (file, built_in) = (info("s.nii.gz"), info("phantom:sphere:12"));
    for key in ["dims", "affine", "value_range"] {
        assert_eq!(file[key], built_in[key], "{key}");
    }
    assert_eq!(file["affine_source"], "sform");
}

#[cfg(unix)]
#[test]
fn an_interrupted_write_leaves_nothing() {
    use std::os::unix::process::ExitStatusExt;
    let dir = tempfile::tempdir().unwrap();
    let names = || {
        let entries = fs::read_dir(dir.path()).unwrap();
        entries.map(|e| e.unwrap().file_name()).collect::<Vec<_>>()
    };
    let mut child = Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(["phantom", "thorax:400", "-o", "a.nii.gz"])
        .current_dir(dir.path())
        .spawn()
        .unwrap();
    // Waits for the final file, not the one that only tests whether the folder can be written.
    let mut before = names();
    while before.is_empty() || before != names() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be interrupted");
        before = names();
        std::thread::sleep(Duration::from_millis(20));
    }
    crate::program::signal(&child, "TERM");
    // The program ends by a signal, so that a shell ends its loop, too.
    assert_eq!(child.wait().unwrap().signal(), Some(2));
    assert_eq!(names(), [""; 0]);
}
