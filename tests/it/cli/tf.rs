//! `tf list`, `tf export` and `tf convert`, and transfer-function files of other programs on the command line.

use crate::common;
use crate::program::{Printed, refused, succeed};
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use umbravox::transfer::TransferFunction;
use umbravox::transfer::presets::PRESETS;

const VP: &str = "1\n1\n0.9\n0.1\n0.2\n10\n6 -100 0 300 0.25 900 1\n4 0 1 255 1\n8 -100 0 0 0 900 1 1 1\n";
const PARAVIEW: &str = r#"[{"ColorSpace": "Lab", "Name": "Bones",
    "Points": [-100, 0, 0.5, 0, 300, 0.25, 0.5, 0, 900, 1, 0.5, 0], "RGBPoints": [-100, 0, 0, 0, 900, 1, 1, 1]}]"#;

/// Optical depth of one ray across a volume, by `umbravox probe`.
fn depth(folder: &Path, args: &[&str]) -> (f64, String) {
    fs::write(folder.join("rays.txt"), "-500 1 2 500 2 1\n").unwrap();
    let Printed { stdout: out, stderr: err } =
        succeed(folder, &[&["probe"], args, &["--rays", "rays.txt"]].concat());
    let line = out.lines().find(|l| l.starts_with(|c: char| c.is_ascii_digit())).unwrap().to_owned();
    (line.split_whitespace().next().unwrap().parse().unwrap(), err)
}

#[test]
fn presets_are_listed_and_exported() {
    let dir = tempfile::tempdir().unwrap();
    let text = succeed(dir.path(), &["tf", "list"]).stdout;
    let json: serde_json::Value =
        serde_json::from_str(&succeed(dir.path(), &["tf", "list", "--json"]).stdout).unwrap();
    assert_eq!(json.as_array().unwrap().len(), PRESETS.len());
    for (preset, listed) in PRESETS.iter().zip(json.as_array().unwrap()) {
        assert!(text.contains(preset.about) && listed["name"] == preset.name, "{}", preset.name);
        assert_eq!(listed["points"], preset.transfer_function().points.len());
        let path = dir.path().join(format!("{}.json", preset.name));
        let Printed { stdout: out, stderr: err } =
            succeed(dir.path(), &["tf", "export", preset.name, "-o", path.to_str().unwrap()]);
        assert_eq!((out.as_str(), err.as_str()), ("", ""));
        assert_eq!(TransferFunction::read(&path).unwrap(), preset.transfer_function());
    }
    // A preset and its exported file are equal on every volume: in HU, in fractions, of strands.
    for (volume, preset) in
        [("phantom:thorax:16", "bone"), ("phantom:thorax:16", "engine"), ("phantom:thorax:16", "uniform")]
    {
        let file = format!("{preset}.json");
        let [of_file, of_preset] =
            [file.as_str(), preset].map(|tf| depth(dir.path(), &[volume, "--tf", tf]).0);
        assert!(of_preset > 0.0 && of_file == of_preset, "{preset}: {of_file} {of_preset}");
    }
}

#[test]
fn files_of_other_programs_are_converted_and_reported() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.vp"), VP).unwrap();
    fs::write(dir.path().join("b.json"), PARAVIEW).unwrap();
    let Printed { stdout: out, stderr: err } =
        succeed(dir.path(), &["tf", "convert", "a.vp", "-o", "a.json", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((json["from"].as_str(), json["to"].as_str()), (Some("vp"), Some("umbravox")));
    assert_eq!(json["warnings"].as_array().unwrap().len(), 2);
    assert!(err.lines().all(|l| l.starts_with("warning: ")) && err.contains("shading was skipped"), "{err}");
    let own = TransferFunction::read(&dir.path().join("a.json")).unwrap();
    assert!((own.amount(100.0) - 0.125).abs() < 1e-9 && own.name == "a");
    // The foreign file itself gives the same function and the same warnings.
    let converted = depth(dir.path(), &["phantom:thorax:16", "--tf", "a.json"]);
    let (itself, said) = depth(dir.path(), &["phantom:thorax:16", "--tf", "a.vp"]);
    assert!(itself > 0.0 && itself == converted.0, "{itself} {}", converted.0);
    assert_eq!(said.lines().filter(|l| l.starts_with("warning: ")).count(), 2, "{said}");
    let (paraview, said) = depth(dir.path(), &["phantom:thorax:16", "--tf", "b.json"]);
    assert!(
        (paraview / itself - 1.0).abs() < 1e-12 && said.contains("L*a*b*"),
        "{paraview} {itself}: {said}"
    );
    for (to, output) in [("paraview", "c.json"), ("vp", "c.vp")] {
        succeed(dir.path(), &["tf", "convert", "a.json", "--to", to, "-o", output]);
        let (again, _) = depth(dir.path(), &["phantom:thorax:16", "--tf", output]);
        assert!((again / itself - 1.0).abs() < 2e-3, "{to}: {again} {itself}");
    }
    succeed(dir.path(), &["tf", "export", "engine", "--range", "-10,300", "-o", "e.vp"]);
    let engine = fs::read_to_string(dir.path().join("e.vp")).unwrap();
    assert!(engine.lines().nth(6).unwrap().starts_with("16 27.19"), "0.12 of -10 to 300 is 27.2: {engine}");
}

#[test]
fn bad_conversions_are_refused_and_leave_nothing() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.vp"), VP).unwrap();
    fs::write(dir.path().join("broken.vp"), "1\n1\n").unwrap();
    for (args, why) in [
        (&["tf"][..], "requires a subcommand"),
        (&["tf", "export", "boen", "-o", "a.json"], "none of that name"),
        (&["tf", "export", "bone", "-o", "a.txt"], ".json"),
        (&["tf", "export", "bone", "-o", "gone/a.json"], "no folder"),
        (&["tf", "export", "bone", "-o", "a.vp.json"], "not written"),
        (&["tf", "export", "bone", "-o", "a.json", "--to", "inviwo"], "invalid value"),
        (&["tf", "export", "bone", "-o", "a.json", "--range", "1,2"], "not `fraction`"),
        (&["tf", "export", "engine", "-o", "b.vp"], "--range"),
        (&["tf", "export", "engine", "-o", "b.vp", "--range", "2,1"], "the second greater"),
        (&["tf", "convert", "gone.vp", "-o", "a.json"], "No such file"),
        (&["tf", "convert", "broken.vp", "-o", "a.json"], "line 3"),
        (&["render", "--tf", "broken.vp", "-o", "a.png"], "line 3"),
        (&["render", "--opacity-scale", "0", "-o", "a.png"], "from 0.000001 to 1000000"),
        (&["render", "--units", "HU", "-o", "a.png"], "invalid value"),
    ] {
        let error = refused(dir.path(), args);
        assert!(error.contains(why), "{args:?}: {error}");
    }
}

#[test]
fn opacity_scale_is_a_factor_of_optical_depth() {
    let dir = tempfile::tempdir().unwrap();
    for tf in ["bone", "ct", "hair"] {
        let (one, _) = depth(dir.path(), &["phantom:thorax:16", "--tf", tf]);
        for factor in [0.125, 3.0] {
            let scale = factor.to_string();
            let args = ["phantom:thorax:16", "--tf", tf, "--opacity-scale", &scale];
            let (scaled, _) = depth(dir.path(), &args);
            assert!((scaled / one / factor - 1.0).abs() < 1e-12, "{tf} {factor}: {scaled} {one}");
            // The flag also works as a key of a scene file.
            let text =
                format!("volume = 'phantom:thorax:16'\ntf = '{tf}'\nopacity-scale = {factor}\nunits = 'hu'");
            fs::write(dir.path().join("s.toml"), text).unwrap();
            assert_eq!(depth(dir.path(), &["--scene", "s.toml"]).0, scaled);
        }
    }
}

/// A gradient opacity by flag, scene file, file of this program or of 3D Slicer is one function; `none` removes it.
#[test]
fn gradient_opacity_is_given_in_every_way() {
    let dir = tempfile::tempdir().unwrap();
    const VOLUME: &str = "phantom:thorax:16";
    let with = |more: &[&str]| depth(dir.path(), &[&[VOLUME][..], more].concat());
    let (plain, said) = with(&["--tf", "bone"]);
    assert!(!said.contains("gradient opacity"), "{said}");
    let opacity = "0:0.25,300:1";
    let (by_flag, said) = with(&["--tf", "bone", "--gradient-opacity", opacity]);
    assert!(by_flag < 0.95 * plain && by_flag > 0.25 * plain, "{by_flag} {plain}");
    assert!(said.contains("note: gradient opacity 0:0.25,300:1"), "{said}");
    let scene = format!("volume = '{VOLUME}'\ntf = 'bone'\ngradient-opacity = '{opacity}'");
    fs::write(dir.path().join("s.toml"), scene).unwrap();
    assert_eq!(depth(dir.path(), &["--scene", "s.toml"]).0, by_flag);
    assert_eq!(depth(dir.path(), &["--scene", "s.toml", "--gradient-opacity", "none"]).0, plain);

    let bone = PRESETS.iter().find(|p| p.name == "bone").unwrap().transfer_function();
    let file = bone.clone().with_gradient_opacity(opacity.parse().unwrap());
    file.write(&dir.path().join("own.json")).unwrap();
    assert_eq!(with(&["--tf", "own.json"]).0, by_flag);
    assert_eq!(with(&["--tf", "own.json", "--gradient-opacity", "none"]).0, plain);

    let faint = VP.replace("4 0 1 255 1", "4 0 0.25 255 1");
    for (name, text) in [("plain.vp", VP), ("faint.vp", &faint)] {
        fs::write(dir.path().join(name), text).unwrap();
    }
    let [plain, slicer] = ["plain.vp", "faint.vp"].map(|tf| with(&["--tf", tf]).0);
    assert!(slicer < 0.99 * plain && slicer > 0.25 * plain, "{slicer} {plain}");
    let by_voxel = with(&["--tf", "plain.vp", "--gradient-opacity", "0:0.25,255:1,per=voxel"]).0;
    assert_eq!(by_voxel, slicer);
    let by_mm = with(&["--tf", "plain.vp", "--gradient-opacity", "0:0.25,255:1"]).0;
    assert!((by_mm - slicer).abs() > 1e-3, "voxels of thorax:16 are wider than 1 mm");
    for output in ["a.json", "a.vp"] {
        succeed(dir.path(), &["tf", "convert", "faint.vp", "-o", output]);
        let again = with(&["--tf", output]).0;
        assert!((again / slicer - 1.0).abs() < 2e-3, "{output}: {again} {slicer}");
    }
    let said = succeed(dir.path(), &["tf", "convert", "faint.vp", "--to", "paraview", "-o", "p.json"]).stderr;
    assert!(said.contains("gradient opacity was left out"), "{said}");
}

#[test]
fn gradient_opacity_is_refused_where_it_has_no_counterpart() {
    let dir = tempfile::tempdir().unwrap();
    succeed(dir.path(), &["phantom", "slab:8", "-o", "labels.nii.gz"]);
    let bone = PRESETS.iter().find(|p| p.name == "bone").unwrap().transfer_function();
    let own = bone.with_gradient_opacity("0:0,5:1".parse().unwrap());
    own.write(&dir.path().join("own.json")).unwrap();
    let opacity = ["--gradient-opacity", "0:0,5:1"];
    fs::write(dir.path().join("rays.txt"), "-5 1 2 5 2 1\n").unwrap();
    let refuse = |args: &[&str], why: &str| {
        let error = refused(dir.path(), args);
        assert!(error.contains(why), "{args:?}: {error}");
    };
    let phantom = "phantom:slab:8";
    refuse(&[&["export", phantom, "-o", "a.html"], &opacity[..]].concat(), "pages show no gradient opacity");
    refuse(
        &[&["export", phantom, "--ambient", "0", "--mitsuba", "out"], &opacity[..]].concat(),
        "gradient opacity has no counterpart",
    );
    let labelled = ["--labels", "labels.nii.gz", "--label-tf", "0=own.json", "--rays", "rays.txt"];
    refuse(&[&["probe", phantom], &labelled[..]].concat(), "has a gradient opacity");
    for (text, why) in
        [("5", "is not a list"), ("0:2", "must be in [0, 1]"), ("9:0,5:1", "less than the one before")]
    {
        refuse(&["render", "--gradient-opacity", text, "-o", "a.png"], why);
    }
}

#[test]
fn small_volumes_show_something_and_a_note_says_by_what_factor() {
    let dir = tempfile::tempdir().unwrap();
    let voxels: Vec<u8> = (0..32 * 32 * 32).map(|i| (i % 251) as u8).collect();
    fs::write(dir.path().join("v_32x32x32_u8.raw"), voxels).unwrap();
    let across = |spacing: &str, more: &[&str]| {
        let line = ["v_32x32x32_u8.raw", "--spacing", spacing, "--tf", "engine"];
        fs::write(dir.path().join("rays.txt"), "-500 -500 -500 500 500 500\n").unwrap();
        let args = [&["probe"], &line[..], more, &["--rays", "rays.txt"]].concat();
        let Printed { stdout: out, stderr: err } = succeed(dir.path(), &args);
        let line = out.lines().find(|l| l.starts_with(|c: char| c.is_ascii_digit())).unwrap().to_owned();
        (line.split_whitespace().next().unwrap().parse::<f64>().unwrap(), err)
    };
    let (full, said) = across("1,1,1", &[]);
    assert!(!said.contains("--opacity-scale"), "{said}");
    // 400 mm by the diagonal, to three digits.
    for (spacing, factor) in [("0.1,0.1,0.1", 72.2), ("0.01,0.01,0.01", 722.0)] {
        let (plain, said) = across(spacing, &["--opacity-scale", "1"]);
        assert!(!said.contains("--opacity-scale"), "{said}");
        let (scaled, said) = across(spacing, &[]);
        assert!(said.contains(&format!("{factor} times")) && said.contains("--opacity-scale 1"), "{said}");
        assert!((scaled / plain / factor - 1.0).abs() < 1e-9, "{spacing}: {scaled} {plain}");
        assert!(plain < 0.11 * full);
    }
}

#[test]
fn info_says_what_values_are_taken_for_and_why() {
    let dir = tempfile::tempdir().unwrap();
    let text = succeed(dir.path(), &["info", "phantom:thorax:16"]).stdout;
    assert!(text.contains("taken as     HU (built in)"), "{text}");
    // Counts of 16 bits that no scanner of HU makes.
    let voxels: Vec<u8> = (0..4096u32).flat_map(|i| ((762 + i) as u16).to_le_bytes()).collect();
    fs::write(dir.path().join("v_16x16x16_u16.raw"), voxels).unwrap();
    let text = succeed(dir.path(), &["info", "v_16x16x16_u16.raw"]).stdout;
    for part in ["not HU (", "no air about -1000; guessed from the values"] {
        assert!(text.contains(part), "{text}");
    }
    for (units, taken, by_values) in
        [(None, "fraction", true), (Some("hu"), "HU", false), (Some("fraction"), "fraction", false)]
    {
        let mut args = vec!["info", "v_16x16x16_u16.raw", "--json"];
        args.extend(units.iter().flat_map(|units| ["--units", units]));
        let json: serde_json::Value = serde_json::from_str(&succeed(dir.path(), &args).stdout).unwrap();
        assert_eq!((&json["units"], &json["units_guessed"]), (&taken.into(), &by_values.into()), "{units:?}");
    }
    let line = ["v_16x16x16_u16.raw", "--spacing", "1,1,1"];
    let (_, said) = depth(dir.path(), &line);
    assert!(said.contains("preset `engine`") && said.contains("--units hu"), "{said}");
    let (_, said) = depth(dir.path(), &[&line[..], &["--units", "hu"]].concat());
    assert_eq!(said, "", "what was asked for needs no note");
}

#[test]
fn real_scans_are_taken_for_what_they_are() {
    let dir = tempfile::tempdir().unwrap();
    for (name, units, said) in [
        ("CT_AVM", "HU", "scales its 8 bits"),
        ("CT_pitch", "fraction", "span too little"),
        ("engine", "fraction", "span too little"),
    ] {
        let Some(path) = common::scan(name) else { continue };
        let path = path.to_str().unwrap();
        let json: serde_json::Value =
            serde_json::from_str(&succeed(dir.path(), &["info", path, "--json"]).stdout).unwrap();
        assert!(
            json["units"] == units && json["units_why"].as_str().unwrap().contains(said),
            "{name}: {json}"
        );
        // These volumes are near the size of a body.
        let (_, err) = depth(dir.path(), &[path]);
        assert!(!err.contains("times as high"), "{name}: {err}");
    }
}

/// Runs the program with a configuration folder and standard input, and returns status, stdout and stderr.
fn with_input(folder: &Path, input: &str, args: &[&str]) -> (bool, String, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(args)
        .current_dir(folder)
        .env("XDG_CONFIG_HOME", folder.join("config"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    (output.status.success(), out, err)
}

#[test]
#[cfg(target_os = "linux")]
fn presets_of_the_user_are_found_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let presets = dir.path().join("config/umbravox/presets");
    fs::create_dir_all(&presets).unwrap();
    fs::write(presets.join("mine.vp"), VP).unwrap();
    fs::write(presets.join("edges.vp"), VP.replace("4 0 1 255 1", "4 0 0.25 255 1")).unwrap();
    // A built-in preset keeps its name.
    fs::write(presets.join("bone.vp"), VP).unwrap();
    fs::write(presets.join("broken.json"), "{").unwrap();
    let (ok, listed, warning) = with_input(dir.path(), "", &["tf", "list", "--json"]);
    assert!(ok && warning.contains("broken.json"), "{warning}");
    let listed: Vec<serde_json::Value> = serde_json::from_str(&listed).unwrap();
    let named: Vec<_> =
        listed[PRESETS.len()..].iter().map(|p| (&p["name"], &p["gradient_opacity"])).collect();
    assert_eq!(named, [(&"edges".into(), &true.into()), (&"mine".into(), &false.into())]);
    assert!(listed[PRESETS.len() + 1]["file"].as_str().unwrap().ends_with("presets/mine.vp"));
    let (_, text, _) = with_input(dir.path(), "", &["tf", "list"]);
    let marked = text.lines().filter(|line| line.ends_with("; with gradient opacity"));
    assert!(marked.map(|line| line.split(' ').next().unwrap()).eq(["edges"]), "{text}");
    let (ok, exported, _) = with_input(dir.path(), "", &["tf", "export", "mine", "-o", "-"]);
    let (converted_ok, converted, _) = with_input(dir.path(), VP, &["tf", "convert", "-", "-o", "-"]);
    assert!(ok && converted_ok);
    let [exported, converted] = [exported, converted].map(|text| TransferFunction::from_json(&text).unwrap());
    assert_eq!(exported.points, converted.points);
    let rays = "-500 1 2 500 2 1\n";
    let depth_of =
        |tf: &str| with_input(dir.path(), rays, &["probe", "phantom:sphere:16", "--tf", tf, "--rays", "-"]);
    let (named, file) = (depth_of("mine"), depth_of(presets.join("mine.vp").to_str().unwrap()));
    assert!(named.0 && named.1 == file.1, "{named:?} {file:?}");
    let (ok, _, error) = with_input(dir.path(), "", &["tf", "export", "yours", "-o", "-"]);
    assert!(!ok && error.contains("mine"), "{error}");
    let (ok, _, error) = with_input(dir.path(), "", &["tf", "export", "mine", "-o", "-", "--json"]);
    assert!(!ok && error.contains("--json goes to standard output"), "{error}");
}
