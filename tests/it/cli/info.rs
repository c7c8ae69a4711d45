//! `umbravox info` on several inputs, DICOM folders and tracks.

use crate::common::scan;
use crate::program::{refused, succeed, umbravox};
use serde_json::Value;
use std::path::Path;

fn fixture(name: &str) -> String {
    format!("{}/tests/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Returns what `umbravox info ARGS` prints to stdout.
fn info(args: &[&str]) -> String {
    succeed(Path::new("."), &[&["info"], args].concat()).stdout
}

#[test]
fn several_volumes_are_described_one_after_the_other() {
    let text = info(&["phantom:slab:8", "phantom:sphere:12"]);
    let sources: Vec<&str> = text.lines().filter(|line| line.starts_with("source ")).collect();
    assert_eq!(sources.len(), 2, "{text}");
    assert!(text.contains("\n\nsource"), "a blank line is between them: {text}");
    let json: Value =
        serde_json::from_str(&info(&["phantom:slab:8", "phantom:sphere:12", "--json"])).unwrap();
    let dims: Vec<&Value> = json.as_array().unwrap().iter().map(|one| &one["dims"][0]).collect();
    assert_eq!(dims, [8, 12]);
    let one: Value = serde_json::from_str(&info(&["phantom:slab:8", "--json"])).unwrap();
    assert_eq!(one["dims"][0], 8, "one volume is an object");

    let output = umbravox(Path::new("."), &["info", "gone.nii", "phantom:slab:8", "gone.nrrd"]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("(gone.nii)") && stderr.contains("(gone.nrrd)"), "{stderr}");
    assert!(String::from_utf8(output.stdout).unwrap().contains("8 x 8 x 8 voxels"));
}

#[test]
fn the_series_of_a_dicom_folder_are_listed() {
    let folder = fixture("formats/files/dicom_two");
    let text = info(&[&folder]);
    assert!(text.contains("dicom, 2 series") && text.contains("--series 1   series 1 (CT, 5x4"), "{text}");
    let json: Value = serde_json::from_str(&info(&[&folder, "--json"])).unwrap();
    assert_eq!(json["series"].as_array().unwrap().len(), 2);
    assert!(info(&[&folder, "--series=2"]).contains("voxels"));
    let dir = tempfile::tempdir().unwrap();
    assert!(refused(dir.path(), &["info", &folder, "--series=3"]).contains("1 to 2"));
    assert!(refused(dir.path(), &["render", &folder, "-o", "a.png"]).contains("2 series"));
}

#[test]
fn a_dicom_segmentation_has_the_names_of_its_segments() {
    let text = info(&[&fixture("formats/files/dicom_segments.dcm")]);
    assert!(text.contains("5 x 4 x 4 voxels") && text.contains("0 to 2"), "{text}");
    assert!(text.contains("segments     1 Left lung\n             2 Rib\n"), "{text}");
}

/// Notes of `umbravox probe` on a volume with its default transfer function.
fn notes(volume: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("rays.txt"), "-500 1 2 500 2 1\n").unwrap();
    let output = umbravox(dir.path(), &["probe", volume, "--rays", "rays.txt"]);
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_segmentation_that_is_opened_as_an_image_is_recognised() {
    let file = fixture("formats/files/dicom_segments.dcm");
    let text = info(&[&file]);
    assert!(text.contains("labels       probably a segmentation (the file names segments: 2)"), "{text}");
    let note = notes(&file);
    assert!(note.contains("note: this is probably a segmentation") && note.contains("--labels"), "{note}");
    assert!(!notes("phantom:thorax:16").contains("segmentation"));
    let names =
        ["thorax", "slab", "sphere", "shell", "step", "comb", "cloud", "smoke", "foam", "struts", "sheets"];
    let phantoms = names.map(|name| format!("phantom:{name}:32"));
    let scans = ["CT_AVM", "CT_pitch", "engine", "fuel"].into_iter().filter_map(scan);
    let images = phantoms.into_iter().chain(scans.map(|path| path.to_str().unwrap().to_owned()));
    for image in images {
        let json: Value = serde_json::from_str(&info(&[&image, "--json"])).unwrap();
        assert!(json["labels_why"].is_null(), "{image}: {json}");
    }
}

#[test]
fn tracks_are_counted_and_measured_without_a_thickness() {
    let tracks = fixture("data/strands/oblique.trk");
    let text = info(&[&tracks]);
    assert!(text.contains("4, 26 points, 22 segments") && text.contains("--thickness MM"), "{text}");
    assert!(!text.contains("dimensions"), "{text}");
    let json: Value = serde_json::from_str(&info(&[&tracks, "--json"])).unwrap();
    assert_eq!(
        (&json["strands"], &json["thickness_mm"], &json["dims"]),
        (&4.into(), &Value::Null, &Value::Null)
    );
    assert!(json["length_mm"].as_f64().unwrap() > 0.0 && json["source"].is_string(), "{json}");
    let text = info(&[&tracks, "--thickness=0.5", "--resolution=9"]);
    assert!(text.contains("thickness    0.5 mm") && text.contains("dimensions"), "{text}");
}
