//! Small pictures of every shadow method and feature against those in `tests/golden`, to show changes by a shader.
//!
//! `UMBRAVOX_REWRITE=1 cargo test --test gpu golden` renews the pictures. Look at them before you commit them.

use crate::common;
use crate::program::succeed;
use image::RgbImage;
use rayon::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};
use umbravox::shadow::METHODS;

/// Command line of every golden picture.
const SCENE: [&str; 5] = ["render", "phantom:thorax:32", "--size=48x48", "--tf=bone", "--background=#203040"];
/// Golden pictures of features: a name, and the flags of the feature.
const FEATURES: [(&str, &[&str]); 12] = [
    ("clip", &["--clip=1,0.3,0,0"]),
    ("filter", &["--shadow=dsm:filter=nearest,map=24"]),
    ("gradient-opacity", &["--gradient-opacity=0:0,60:1"]),
    ("labels", &["--labels=labels.nrrd", "--label-tf=2=ct"]),
    ("labels-hidden", &["--labels=labels.nrrd", "--hide=1"]),
    ("light-point", &["--light=point:60,220,120"]),
    ("light-two", &["--light=dir:0,1,1", "--light=point:200,0,300,color=#ff8040,intensity=0.5"]),
    ("mesh", &["--mesh=mesh.obj,color=#8090a0"]),
    ("occlusion", &["--ambient=0.6", "--ambient-occlusion=60"]),
    ("samples", &["--shadow=dsm:march=samples"]),
    ("shading", &["--shading=blinn-phong"]),
    ("strands", &["--strands=strands.obj,thickness=9,color=#d02020"]),
];
/// Allowed difference of a channel in sRGB codes, since adapters round differently at each sample.
const CODES: u8 = 4;
/// Number of pixels that may differ by more: edges of surfaces, where one sample more or less counts.
const MOVED: usize = 12;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

/// Writes the files that [`FEATURES`] name.
fn write_files(folder: &Path) {
    // Two large voxels: label 1 where x < 0, label 2 elsewhere.
    let labels = "NRRD0005\ntype: uchar\ndimension: 3\nsizes: 2 1 1\nspace: right-anterior-superior\n\
        space directions: (500,0,0) (0,1000,0) (0,0,1000)\nspace origin: (-250,0,0)\nencoding: ascii\n\n1 2\n";
    fs::write(folder.join("labels.nrrd"), labels).unwrap();
    let mesh = "v -60 150 -40\nv 60 150 -40\nv 0 150 60\nv 0 0 0\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    fs::write(folder.join("mesh.obj"), mesh).unwrap();
    fs::write(folder.join("strands.obj"), "v -150 100 -60\nv 0 170 0\nv 150 100 60\nl 1 2 3\n").unwrap();
}

/// Changed pixel: largest difference of a channel, column, row, colours before and after.
type Moved = (u8, u32, u32, [u8; 3], [u8; 3]);

/// Describes how a picture differs from the golden one; `None` within the tolerance.
fn difference(golden: &RgbImage, found: &RgbImage) -> Option<String> {
    if golden.dimensions() != found.dimensions() {
        return Some(format!("it has {:?} pixels instead of {:?}", found.dimensions(), golden.dimensions()));
    }
    let mut moved = Vec::new();
    for (x, y, before) in golden.enumerate_pixels() {
        let after = found.get_pixel(x, y);
        let off = before.0.iter().zip(after.0).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0);
        if off > CODES {
            moved.push((off, x, y, before.0, after.0));
        }
    }
    if moved.len() <= MOVED {
        return None;
    }
    let (off, x, y, before, after) = moved.iter().max().unwrap();
    let range = |at: fn(&Moved) -> u32| {
        let places = || moved.iter().map(at);
        format!("{}..={}", places().min().unwrap(), places().max().unwrap())
    };
    Some(format!(
        "{} of {} pixels moved by more than {CODES} codes, all in x {}, y {}; the most by {off}: ({x}, {y}) was \
        {before:?} and is {after:?}",
        moved.len(),
        golden.pixels().len(),
        range(|m| m.1),
        range(|m| m.2)
    ))
}

#[test]
fn pictures_are_those_in_the_repository() {
    if !common::has_adapter() {
        return;
    }
    let home = tempfile::tempdir().unwrap();
    write_files(home.path());
    let methods = METHODS
        .iter()
        .filter(|m| m.name != "half")
        .map(|m| (format!("method-{}", m.name), vec![format!("--shadow={}", m.name)]));
    let features = FEATURES
        .iter()
        .map(|(name, flags)| (name.to_string(), flags.iter().map(|flag| flag.to_string()).collect()));
    let cases: Vec<(String, Vec<String>)> = methods.chain(features).collect();
    let renew = std::env::var_os("UMBRAVOX_REWRITE").is_some();
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden");
    fs::create_dir_all(&kept).unwrap();
    let faults: Vec<String> = cases
        .par_iter()
        .filter_map(|(name, flags)| {
            let file = format!("{name}.png");
            let flags: Vec<&str> = flags.iter().map(String::as_str).collect();
            succeed(home.path(), &[&SCENE[..], &flags, &["-o", &file]].concat());
            let found = image::open(home.path().join(&file)).unwrap().to_rgb8();
            let golden = folder().join(&file);
            if renew {
                // Saved without the scene that the program writes into its pictures.
                found.save(&golden).unwrap();
            }
            let golden =
                image::open(&golden).unwrap_or_else(|e| panic!("{}: {e}", golden.display())).to_rgb8();
            let why = difference(&golden, &found)?;
            found.save(kept.join(&file)).unwrap();
            Some(format!("{name}: {why}"))
        })
        .collect();
    assert!(
        faults.is_empty(),
        "{}\nnew pictures: {}\nif that is meant: UMBRAVOX_REWRITE=1 cargo test --test gpu golden",
        faults.join("\n"),
        kept.display()
    );
    let expected: Vec<_> = cases.iter().map(|(name, _)| format!("{name}.png")).collect();
    for entry in fs::read_dir(folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(expected.contains(&name), "tests/golden/{name} is of no method or feature");
    }
}

#[test]
fn a_moved_picture_is_reported_with_its_pixels() {
    let golden = RgbImage::from_fn(48, 48, |x, y| image::Rgb([x as u8, y as u8, 7]));
    let mut found = golden.clone();
    found.pixels_mut().for_each(|p| p.0[2] += CODES);
    assert_eq!(difference(&golden, &found), None);
    for x in 20..20 + MOVED as u32 + 1 {
        found.get_pixel_mut(x, 11).0[0] = 200;
    }
    let why = difference(&golden, &found).unwrap();
    assert!(why.contains("13 of 2304 pixels") && why.contains("x 20..=32, y 11..=11"), "{why}");
    assert!(why.contains("(20, 11) was [20, 11, 7] and is [200, 11, 11]"), "{why}");
}
