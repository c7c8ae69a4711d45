//! Errors against the strands' cylinders: cases with known results, and cases without a reference.

use super::{TF, read_csv};
use crate::common;
use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Output};
use umbravox::strands::{Attribute, StrandArrays, Strands, write_hair};

fn compare(folder: &Path, volume: &str, extra: &[&str]) -> (Vec<HashMap<String, String>>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_umbravox"));
    command.current_dir(folder).args(["compare", volume, "-o", "out", "--rays=10", "--depths=10"]);
    command.args(["--points=1500", "--repeats=1", "--overwrite"]).args(extra);
    if !extra.iter().any(|flag| flag.starts_with("--methods")) {
        command.arg("--methods=none;rays");
    }
    let Output { status, stderr, .. } = command.output().unwrap();
    let stderr = String::from_utf8(stderr).unwrap();
    assert!(status.success(), "{stderr}");
    (read_csv(&folder.join("out/compare.csv")), stderr)
}

fn error(row: &HashMap<String, String>) -> f64 {
    row["strand_err_rms"].parse().unwrap()
}

/// One thick opaque strand across the light: points in front of its axis are fully lit, points behind it not at all.
#[test]
fn a_strand_whose_shadow_is_known() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let arrays = StrandArrays {
        strands: 1,
        segments: Attribute::constant(1),
        points: vec![[-10.0, 0.0, 0.0], [10.0, 0.0, 0.0]],
        thickness_mm: Attribute::constant(4.0),
        transparency: Attribute::constant(0.0),
        color: Attribute::constant([1.0; 3]),
        info: [0; 88],
    };
    write_hair(&Strands::new("one", arrays).unwrap(), &dir.path().join("one.hair")).unwrap();
    // Looking along the light or against it; an odd number of rows has one through the axis.
    let seen_from = |z: &str| {
        let eye = format!("--eye=0,0,{z}");
        let scene =
            ["--resolution=100", "--light=dir:0,0,1", &eye, "--target=0,0,0", "--up=0,1,0", "--size=31x31"];
        compare(dir.path(), "one.hair", &scene).0
    };
    // Lit side of the strand: all beams are lit, and so is everything with `none`.
    let rows = seen_from("60");
    assert!(error(&rows[0]) < 0.1, "{}", error(&rows[0]));
    // Dark side of the strand: no beam is lit; `none` is wrong by all of the light, `rays` by next to nothing.
    let [none, rays] = <[_; 2]>::try_from(seen_from("-60")).unwrap();
    assert!(error(&none) > 0.9 && error(&rays) < 0.1, "{}, {}", error(&none), error(&rays));
}

#[test]
fn curls_are_measured_against_their_cylinders() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (rows, stderr) =
        compare(dir.path(), "phantom:hair-curly:20000", &["--size=32x32", "--resolution=48"]);
    let [none, rays] = [0, 1].map(|i| error(&rows[i]));
    // `rays` is the voxel field, whose own error the note says.
    let said = stderr.split("the voxel field itself is off by ").nth(1).unwrap();
    let field: f64 = said.split(' ').next().unwrap().parse().unwrap();
    assert!((rays - field).abs() < 0.005 && rays > 0.005, "{rays}, {field}");
    assert!(none > 2.0 * rays, "{none}, {rays}");
    assert!(
        rows[1]["point_err_rms"].parse::<f64>().unwrap() < 0.5 * rays,
        "against the voxels it is nearly exact"
    );

    // Without a reference the column is empty, and a note gives the reason.
    let (rows, stderr) = compare(
        dir.path(),
        "phantom:hair-curly:20000",
        &["--size=32x32", "--resolution=48", "--light=point:0,0,500"],
    );
    assert!(rows.iter().all(|r| r["strand_err_rms"].is_empty()));
    assert!(stderr.contains("strand_err_rms is left out: beams are parallel"), "{stderr}");
    std::fs::write(dir.path().join("tf.json"), TF).unwrap();
    let (rows, stderr) =
        compare(dir.path(), "phantom:hair-curly:20000", &["--size=32x32", "--resolution=48", "--tf=tf.json"]);
    assert!(
        rows[0]["strand_err_rms"].is_empty() && stderr.contains("does not take the strands' extinction"),
        "{stderr}"
    );
    let (rows, stderr) = compare(dir.path(), "phantom:slab:8", &["--size=32x32", "--tf=tf.json"]);
    assert!(rows[0]["strand_err_rms"].is_empty() && !stderr.contains("strand_err_rms"), "{stderr}");
}

/// Curls rasterised directly into the map cast shadows closer to those of their cylinders than curls that are
/// voxelised.
#[test]
fn curls_drawn_into_maps_are_closer_to_their_cylinders() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let methods = "--methods=dsm:from=voxels,lines;avsm:from=voxels,lines;bom:from=voxels,lines";
    let scene = ["--size=48x48", "--resolution=96", methods];
    let (rows, _) = compare(dir.path(), "phantom:hair-curly:200000", &scene);
    for pair in rows.chunks(2) {
        let [voxels, lines] = [&pair[0], &pair[1]].map(error);
        println!("{}: voxels {voxels}, lines {lines}", pair[0]["method"]);
        assert!(lines < 0.9 * voxels, "{}: {lines} {voxels}", pair[0]["method"]);
    }
}
