//! Strands on the command line: they are written, voxelised, and read wherever a volume is accepted.

use crate::program::{refused, succeed, umbravox};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn stdout(folder: &Path, args: &[&str]) -> String {
    succeed(folder, args).stdout
}

fn json(folder: &Path, args: &[&str]) -> Value {
    serde_json::from_str(&stdout(folder, args)).unwrap()
}

#[test]
fn a_strand_file_and_its_volume_are_volumes_like_any_other() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    assert_eq!(stdout(here, &["phantom", "hair-curly:3000", "-o", "x.hair"]), "");
    let length = fs::metadata(here.join("x.hair")).unwrap().len();
    assert!(length > 128 + 12 * 3000, "{length}");
    let report = json(here, &["voxelise", "x.hair", "-o", "x.nii.gz", "--resolution", "40", "--json"]);
    assert_eq!((&report["segments"], &report["kernel"]), (&Value::from(3000), &Value::from("box")));
    assert!(report["relative_error"].as_f64().unwrap() < 1e-6, "{report}");
    assert!(report["area_mm2"].as_f64().unwrap() > 100.0 && report["segments_per_s"].as_f64().unwrap() > 0.0);
    let against = &report["against_cylinders"];
    assert_eq!(against["beams"], 2000);
    assert!(against["rms"].as_f64().unwrap() > against["sampling_rms"].as_f64().unwrap(), "{against}");

    let info = |volume: &str, flags: &[&str]| json(here, &[&["info", volume, "--json"], flags].concat());
    let file = info("x.nii.gz", &[]);
    for strands in ["x.hair", "phantom:hair-curly:3000"] {
        let strands = info(strands, &["--resolution=40"]);
        for key in ["dims", "affine", "value_range", "memory_type"] {
            assert_eq!(strands[key], file[key], "{key}");
        }
        assert_eq!(strands["format"], "strands");
    }
    assert_eq!(file["dims"], report["dims"]);
    let dims = info("x.hair", &[])["dims"].clone();
    assert_eq!(dims.as_array().unwrap().iter().filter_map(Value::as_u64).max(), Some(256));
    let tent = info("x.hair", &["--resolution=40", "--kernel=tent"]);
    assert!(tent["value_range"] != file["value_range"]);
    let thick = info("x.hair", &["--resolution=40", "--thickness=30"]);
    assert!(thick["spacing_mm"] != file["spacing_mm"]);

    // The value is the extinction, without a --tf for strands and with `hair` for a file of them.
    fs::write(here.join("rays.txt"), "-300 0 -40 300 0 -40\n0 300 10 20 -300 10\n").unwrap();
    let probe = |args: &[&str]| stdout(here, &[&["probe", "--rays", "rays.txt"], args].concat());
    let depth = probe(&["x.hair", "--resolution", "40"]);
    assert!(depth.split(' ').next().unwrap().parse::<f64>().unwrap() > 0.01, "{depth}");
    assert_eq!(depth, probe(&["x.nii.gz", "--tf", "hair"]));
    fs::write(here.join("scene.toml"), "volume = 'x.hair'\nresolution = 40\nkernel = 'box'").unwrap();
    assert_eq!(depth, probe(&["--scene", "scene.toml"]));
}

#[test]
fn the_report_for_people_says_what_the_json_says() {
    let dir = tempfile::tempdir().unwrap();
    let text =
        stdout(dir.path(), &["voxelise", "hair-fur:2000", "--resolution=32", "--kernel=tent", "--rays=100"]);
    for said in ["phantom:hair-fur:2000", "2000 segments", "tent", "relative error", "100 beams", "rms"] {
        assert!(text.contains(said), "{said}:\n{text}");
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    let without = stdout(dir.path(), &["voxelise", "phantom:hair-fur:2000", "--resolution=32", "--rays=0"]);
    assert!(!without.contains("beams"));
}

fn fixture(name: &str) -> String {
    format!("{}/tests/data/strands/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn files_of_tracks_are_volumes_and_are_voxelised() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["big.tck", "oblique.trk", "binary5.vtk", "default.vtp", "lines.obj"] {
        let file = fixture(name);
        let flags = ["--thickness=0.5", "--resolution=24", "--json"];
        let report = json(dir.path(), &[&["voxelise", &file, "--rays=50"], &flags[..]].concat());
        assert_eq!((&report["strands"], &report["segments"]), (&Value::from(4), &Value::from(22)), "{name}");
        let info = json(dir.path(), &[&["info", &file], &flags[..]].concat());
        assert_eq!((&info["dims"], &info["format"]), (&report["dims"], &Value::from("strands")), "{name}");
        let error = refused(dir.path(), &["render", &file, "-o", "a.png"]);
        assert!(error.contains("thickness"), "{error}");
    }
    let tck = umbravox(dir.path(), &["info", &fixture("big.tck"), "--thickness=1", "--resolution=9"]);
    let text = String::from_utf8(tck.stdout).unwrap();
    assert!(text.contains("1 lines of fewer than two points"), "{text}");
    // The help lists every file extension of strands.
    for (command, from) in
        [("render", "[VOLUME]"), ("render", "--strands"), ("info", "<VOLUME>..."), ("voxelise", "<STRANDS>")]
    {
        let help = stdout(dir.path(), &[command, "--help"]);
        let (_, part) = help.split_once(&format!("\n  {from}")).or(help.split_once(from)).unwrap();
        let part: String = part.chars().take(400).collect();
        for ending in umbravox::strands::STRAND_EXTENSIONS {
            assert!(part.contains(&format!(".{ending}")), "{command}, {from}: {ending}\n{part}");
        }
        let kind = umbravox::open::FORMATS.iter().find(|f| f.kind == "of strands").unwrap();
        assert!(umbravox::strands::STRAND_EXTENSIONS.iter().all(|e| kind.usage.contains(&format!(".{e}"))));
        assert_eq!(kind.endings, umbravox::strands::STRAND_EXTENSIONS);
    }
}

#[test]
fn strands_are_drawn_in_a_volume_and_written_to_the_scene_file() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    fs::write(here.join("a.obj"), "v -60 0 -40\nv 0 10 0\nv 60 0 40\nl 1 2 3\nl 2\n").unwrap();
    let render = |out: &str, more: &[&str]| {
        let base = ["render", "phantom:thorax:24", "--size=32x32", "--shadow=rays", "-o", out];
        succeed(here, &[&base[..], more].concat()).stderr
    };
    if !crate::common::has_adapter() {
        return;
    }
    let said = render("with.npy", &["--strands", "a.obj,thickness=12,color=#ff0000"]);
    assert!(said.contains("a.obj: 1 lines of fewer"), "{said}");
    render("without.npy", &[]);
    fs::write(
        here.join("scene.toml"),
        "volume = 'phantom:thorax:24'\nstrands = ['a.obj,color=#ff0000,thickness=12']",
    )
    .unwrap();
    let scene = ["render", "--scene=scene.toml", "--size=32x32", "--shadow=rays", "-o", "scene.npy"];
    succeed(here, &scene);
    let [with, without, scene] =
        ["with", "without", "scene"].map(|n| fs::read(here.join(format!("{n}.npy"))).unwrap());
    assert!(with == scene && with != without);
    // The scene file of a table records the strand flags, too.
    let table = [
        "compare",
        "phantom:thorax:24",
        "--size=16x16",
        "--methods=none",
        "--rays=4",
        "--points=16",
        "--repeats=1",
    ];
    let more = ["--strands", "a.obj,thickness=12", "--strands=phantom:hair-fur:24", "-o", "table"];
    succeed(here, &[&table[..], &more].concat());
    let kept = fs::read_to_string(here.join("table/scene.toml")).unwrap();
    let line = kept.lines().find(|l| l.starts_with("strands = ")).unwrap();
    assert!(
        line.contains("a.obj,color=#7fb2e5,thickness=12") && line.contains("phantom:hair-fur:24"),
        "{line}"
    );
}

#[test]
fn strands_that_cannot_stand_in_a_volume_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.obj"), "v 0 0 0\nv 9 0 0\nl 1 2\n").unwrap();
    for (file, place, why) in [
        ("a.obj", "--strands: a.obj", "thickness"),
        ("a.obj,thickness=-1", "--strands", "above 0"),
        ("a.obj,thickness=1,colour=#ffffff", "a.obj,thickness=1,colour=#ffffff", "no format of strands"),
        ("gone.tck,thickness=1", "--strands: gone.tck", "No such file"),
        ("phantom:hair-curly:900000", "phantom:hair-curly:900000", "1000000 are the most"),
        ("phantom:slab", "phantom:slab", "no strand set"),
    ] {
        let error = refused(dir.path(), &["render", "phantom:slab:8", "--strands", file, "-o", "x.png"]);
        let (at, reason) = error.split_once("): ").expect("WHAT (WHERE): WHY");
        assert!(at.contains(place) && reason.contains(why), "{file}: {error}");
    }
    assert!(!dir.path().join("x.png").exists());
}

#[test]
fn unfit_strands_are_not_voxelised() {
    let dir = tempfile::tempdir().unwrap();
    stdout(dir.path(), &["phantom", "hair-straight:50", "-o", "x.hair"]);
    let mut bytes = fs::read(dir.path().join("x.hair")).unwrap();
    fs::write(dir.path().join("cut.hair"), &bytes[..300]).unwrap();
    bytes[20..24].copy_from_slice(&[0; 4]);
    fs::write(dir.path().join("thin.hair"), &bytes).unwrap();
    for (args, place, why) in [
        (&["voxelise", "x.hair", "-o", "x.nrrd"][..], "x.nrrd", ".nii, .nii.gz"),
        (&["voxelise", "x.hair", "-o", "gone/x.nii"], "gone/x.nii", "no folder"),
        (&["voxelise"], "STRANDS", "required"),
        (&["voxelise", "cut.hair", "-o", "x.nii"], "cut.hair: byte 300", "ends there"),
        (&["voxelise", "thin.hair", "-o", "x.nii"], "thin.hair", "thickness"),
        (&["render", "thin.hair", "-o", "a.png"], "thin.hair", "thickness"),
        (&["voxelise", "gone.hair"], "gone.hair", "No such file"),
        (&["voxelise", "hair-bald"], "phantom:hair-bald", "no strand set"),
        (&["voxelise", "hair-fur:0"], "phantom:hair-fur:0", "1..="),
        (&["voxelise", "phantom:sphere"], "phantom:sphere", "neither a file of strands"),
        (&["voxelise", "x.nii"], "x.nii", "neither a file of strands"),
        (&["voxelise", "x.hair", "--resolution", "3"], "--resolution", "4 to 1024"),
        (&["voxelise", "x.hair", "--resolution", "-1"], "--resolution", "4 to 1024"),
        (&["voxelise", "x.hair", "--resolution", "1e9"], "--resolution", "4 to 1024"),
        (&["voxelise", "x.hair", "--kernel", "gauss"], "--kernel", "'gauss'"),
        (&["voxelise", "x.hair", "--thickness", "0"], "--thickness", "above 0"),
        (&["voxelise", "x.hair", "--thickness", "nan"], "--thickness", "above 0"),
        (&["voxelise", "x.hair", "--rays", "100001"], "--rays", "100000"),
        (&["render", "x.hair", "--spacing", "1,1,1", "-o", "a.png"], "--spacing", "of strands"),
        (&["render", "phantom:slab:8", "--resolution", "9", "-o", "a.png"], "--resolution", "for strands"),
        (&["info", "phantom:hair-fur:9", "--frame", "1"], "--frame", "of strands"),
        (&["phantom", "hair-fur:9", "-o", "x.nii"], "x.nii", ".hair"),
        (&["phantom", "hair-fir", "-o", "y.hair"], "phantom:hair-fir", "no strand set"),
    ] {
        let error = refused(dir.path(), args);
        let (at, reason) = error.split_once("): ").expect("WHAT (WHERE): WHY");
        assert!(at.contains(place) && reason.contains(why), "{args:?}: {error}");
    }
    // --raw says what the file is, whatever its name.
    let voxels = stdout(
        dir.path(),
        &["info", "x.hair", "--raw", "8x2x2:u8", "--offset", &(bytes.len() - 32).to_string()],
    );
    assert!(voxels.contains("raw"));
}
