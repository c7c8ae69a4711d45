//! `umbravox probe --map-slices`: slices of a slab against its closed form, which side is up, and refused command lines.

use crate::common;
use crate::program::{refused, succeed};
use ndarray::{Array3, s};
use ndarray_npy::ReadNpyExt;
use std::fs::{self, File};
use std::path::Path;

fn slice(folder: &Path, name: &str) -> Array3<f32> {
    Array3::read_npy(File::open(folder.join(name)).unwrap()).unwrap()
}

/// Runs `probe --map-slices`, and returns the depths of the slices in mm.
fn depths(folder: &Path, args: &[&str]) -> Vec<f64> {
    let table = succeed(folder, &[&["probe"], args].concat()).stdout;
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    assert_eq!(reader.headers().unwrap().iter().nth(1), Some("depth_mm"));
    reader.records().map(|row| row.unwrap()[1].parse().unwrap()).collect()
}

#[test]
fn slices_of_a_slab_are_white_before_it_and_exponential_inside() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    // 1000 on the planes 8 to 23 of 32 and 0 elsewhere: the slab is 16 voxels thick, halves of ramps included.
    let tf =
        r#"{"name": "s", "points": [{"value": 0, "extinction": 0}, {"value": 1000, "extinction": 0.08}]}"#;
    fs::write(dir.path().join("s.json"), tf).unwrap();
    for method in ["dsm:epsilon=0,map=24,near=0", "osm:layers=48,map=24,near=0,bits=32", "rays"] {
        let flags = ["phantom:slab:32", "--tf", "s.json", "--light", "dir:0,0,1", "--shadow", method];
        let depths = depths(dir.path(), &[&flags[..], &["--map-slices", "16", "-o", "maps.npy"]].concat());
        assert_eq!(depths.len(), 16);
        let pictures: Vec<_> = (0..16).map(|i| slice(dir.path(), &format!("maps_{i:04}.npy"))).collect();
        let side = pictures[0].dim().0;
        let middle = |i: usize| f64::from(pictures[i][[side / 2, side / 2, 0]]);
        // Light rays of the border pass the volume.
        assert!(pictures.iter().all(|p| p[[0, 0, 0]] == 1.0 && p[[5, 5, 3]] == 1.0), "{method}");
        assert!((middle(0) - 1.0).abs() < 1e-3, "{method}: {}", middle(0));
        let volume = umbravox::open::load(&umbravox::open::VolumeSpec::new("phantom:slab:32")).unwrap();
        let thickness_mm = 16.0 * volume.min_spacing_mm();
        let behind = (-0.08 * thickness_mm).exp();
        assert!((middle(15) - behind).abs() < 2e-3, "{method}: {} {behind}", middle(15));
        // On the plateau every step of depth takes the same share of the light.
        let step = (-0.08 * (depths[1] - depths[0])).exp();
        let shares: Vec<f64> = (1..16).map(|i| middle(i) / middle(i - 1)).collect();
        let plateau = shares.iter().filter(|share| (*share - step).abs() < 4e-3).count();
        assert!(plateau >= 5, "{method}: {shares:?} {step}");
        for (i, picture) in pictures.iter().enumerate() {
            let exact = slice(dir.path(), &format!("maps_{i:04}_exact.npy"));
            let inner = s![2..side - 2, 2..side - 2, 0];
            let off =
                (&picture.slice(inner) - &exact.slice(inner)).iter().fold(0.0f32, |m, d| m.max(d.abs()));
            assert!(off < 5e-3, "{method}, slice {i}: {off}");
        }
    }
}

/// Three quadrants of different extinction: seen from a light above, x points right where y points up.
#[test]
fn slices_are_not_mirrored() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let value = |i: usize| match (i % 16 < 8, i / 16 % 16 < 8) {
        (true, true) => 1,
        (false, true) => 2,
        (true, false) => 3,
        (false, false) => 0,
    };
    let values: Vec<String> = (0..16 * 16 * 8).map(|i| value(i).to_string()).collect();
    let head = "NRRD0005\ntype: uchar\ndimension: 3\nsizes: 16 16 8\nspace: right-anterior-superior\n\
        space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: ascii\n\n";
    fs::write(dir.path().join("v.nrrd"), format!("{head}{}\n", values.join(" "))).unwrap();
    let tf = r#"{"name": "s", "points": [{"value": 0, "extinction": 0}, {"value": 3, "extinction": 0.15}]}"#;
    fs::write(dir.path().join("s.json"), tf).unwrap();
    let flags = ["v.nrrd", "--tf", "s.json", "--light", "dir:0,0,1", "--shadow", "dsm:map=32,near=0"];
    let depths = depths(dir.path(), &[&flags[..], &["--map-slices", "1", "-o", "m.npy"]].concat());
    assert_eq!(depths.len(), 1);
    let picture = slice(dir.path(), "m_0000.npy");
    // Centre of the texels behind 8 mm of a value, as column and row.
    let centre = |value: f64| {
        let expected = (-0.05 * value * 8.0).exp() as f32;
        let texels = picture.indexed_iter().filter(|((_, _, c), t)| *c == 0 && (**t - expected).abs() < 0.01);
        let places: Vec<_> = texels.map(|((row, column, _), _)| [column as f64, row as f64]).collect();
        assert!(places.len() > 40, "{value}: {}", places.len());
        [0, 1].map(|axis| places.iter().map(|p| p[axis]).sum::<f64>() / places.len() as f64)
    };
    let [first, right, up] = [1.0, 2.0, 3.0].map(centre);
    let turn = (right[0] - first[0]) * (up[1] - first[1]) - (right[1] - first[1]) * (up[0] - first[0]);
    assert!(turn < -20.0, "{first:?} {right:?} {up:?}");
}

#[test]
fn slips_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    for (flags, why) in [
        (&["--map-slices", "4"][..], "--output"),
        (&["--map-slices", "0", "-o", "a.png"], "0"),
        (&["--map-slices", "4", "-o", "a.svg"], ".png, .exr, .npy"),
        (&["--map-slices", "4", "-o", "no/a.png"], "no folder"),
        (&["--map-slices", "4", "-o", "a.png", "--methods", "dsm"], "--methods"),
        (&["--map-slices", "4", "-o", "a.png", "--curve", "0,0,0"], "--curve"),
    ] {
        let said = refused(dir.path(), &[&["probe", "phantom:slab:8"], flags].concat());
        assert!(said.contains(why), "{flags:?}: {said}");
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}
