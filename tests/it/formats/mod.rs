//! Volume files of other programs: grid, affine and values equal those that the programs' own libraries read back.
//!
//! `make.py` made the files and `expected.json`.

mod out_of_core;
mod round_trip;
mod segmentations;

use crate::common;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::volume::Volume;

#[derive(Deserialize)]
struct Expected {
    name: String,
    by: String,
    dims: [usize; 3],
    affine: [[f64; 4]; 3],
    values: Vec<f64>,
    frame: Option<usize>,
    series: Option<usize>,
    level: Option<usize>,
    /// Text that a warning must contain.
    warning: Option<String>,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats")
}

fn read(name: &str, flags: ReadFlags) -> umbravox::Result<Volume> {
    load(&VolumeSpec { source: folder().join("files").join(name).to_string_lossy().into_owned(), flags })
}

#[test]
fn files_of_other_writers_are_read_as_their_libraries_read_them() {
    let text = std::fs::read_to_string(folder().join("expected.json")).unwrap();
    let all: Vec<Expected> = serde_json::from_str(&text).unwrap();
    assert!(all.len() > 40);
    let mut faults = Vec::new();
    for e in &all {
        let flags = ReadFlags { frame: e.frame, series: e.series, level: e.level, ..ReadFlags::default() };
        let volume = match read(&e.name, flags) {
            Ok(volume) => volume,
            Err(error) => {
                faults.push(format!("{} ({}): {error}", e.name, e.by));
                continue;
            }
        };
        let mut fault = |what: String| faults.push(format!("{} ({}): {what}", e.name, e.by));
        if volume.dims() != e.dims {
            fault(format!("{:?} is not {:?}", volume.dims(), e.dims));
            continue;
        }
        let affine = volume.world_from_index();
        for row in 0..3 {
            for column in 0..4 {
                let is = if column < 3 { affine.matrix3.col(column)[row] } else { affine.translation[row] };
                // Positions in DICOM have eight digits here.
                if (is - e.affine[row][column]).abs() > 2e-6 {
                    fault(format!("affine[{row}][{column}] is {is}, not {}", e.affine[row][column]));
                }
            }
        }
        let [nx, ny, _] = e.dims;
        // Positions between slices depend on positions with eight digits.
        let tolerance = if e.warning.as_deref() == Some("resampled") { 1e-3 } else { 1e-6 };
        let wrong = e.values.iter().enumerate().find(|(at, expected)| {
            let is = volume.value(at % nx, at / nx % ny, at / (nx * ny));
            (is - **expected).abs() > tolerance * expected.abs().max(1.0)
        });
        if let Some((at, expected)) = wrong {
            fault(format!(
                "value {at} is {}, not {expected}",
                volume.value(at % nx, at / nx % ny, at / (nx * ny))
            ));
        }
        let warnings = volume.provenance.warnings.join("; ");
        if e.warning.as_ref().is_some_and(|w| !warnings.contains(w)) {
            fault(format!("no warning of {:?} in `{warnings}`", e.warning));
        }
        if warnings.contains("Secret") || warnings.contains("S3CR3T") || warnings.contains("1970") {
            fault("it names a person".into());
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Returns the one-line error of `info` for a folder that must be refused.
fn refusal(name: &str, flags: ReadFlags) -> String {
    let error = read(name, flags).unwrap_err();
    assert_eq!(error.exit_status(), 2, "{error}");
    let hint = error.hint.clone().unwrap_or_default();
    assert!(!error.to_string().contains('\n') && !hint.contains('\n'));
    format!("{error} {hint}")
}

#[test]
fn several_series_are_listed_without_names_of_people() {
    let said = refusal("dicom_two", ReadFlags::default());
    assert!(said.contains("2 series") && said.contains("--series") && said.contains("`Thorax 2`"), "{said}");
    assert!(said.contains("1: series 1 (CT, 5x4, 3 slices") && !said.contains("Secret"), "{said}");
    let said = refusal("dicom_two", ReadFlags { series: Some(3), ..ReadFlags::default() });
    assert!(said.contains("1 to 2"), "{said}");
    let said = refusal("dicom_oblique", ReadFlags { frame: Some(1), ..ReadFlags::default() });
    assert!(said.contains("--frame 1"), "{said}");
}

/// Copies a DICOM folder of three slices `88.dcm` to `90.dcm`, and plants another width in the compressed pixels of
/// some.
fn with_damaged_pixels(damaged: &[&str]) -> (tempfile::TempDir, PathBuf) {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("dicom_j2k");
    common::copy(&folder().join("files/dicom_j2k"), &path);
    for name in damaged {
        let file = path.join(name);
        let mut bytes = std::fs::read(&file).unwrap();
        // The marker segment SIZ of JPEG 2000: length, capabilities, width.
        let at = bytes.windows(4).position(|four| four == [0xff, 0x4f, 0xff, 0x51]).unwrap();
        bytes[at + 9] ^= 1;
        std::fs::write(&file, bytes).unwrap();
    }
    (home, path)
}

#[test]
fn a_slice_whose_pixels_are_damaged_does_not_spoil_its_neighbours() {
    let (_home, path) = with_damaged_pixels(&["90.dcm"]);
    let load_file = |name: &str| load(&VolumeSpec::new(path.join(name).to_str().unwrap()));
    let volume = load_file("88.dcm").unwrap();
    let warnings = volume.provenance.warnings.join("; ");
    assert!(
        warnings.contains("1 files of the folder are damaged") && warnings.contains("90.dcm"),
        "{warnings}"
    );
    assert_eq!(volume.dims()[2], 2, "{warnings}");
    let whole = load(&VolumeSpec::new(path.to_str().unwrap())).unwrap();
    assert_eq!(whole.dims(), volume.dims());
    let error = load_file("90.dcm").unwrap_err();
    assert!(error.why.contains("90.dcm: its compressed pixels are"), "{error}");
    // One slice in ten may be damaged, at least one.
    let (_home, path) = with_damaged_pixels(&["88.dcm", "90.dcm"]);
    let error = load(&VolumeSpec::new(path.to_str().unwrap())).unwrap_err();
    assert!(error.exit_status() == 2 && error.why.contains("compressed pixels are"), "{error}");
}

/// Copies a Zarr store, so that a test can change it.
fn store(name: &str) -> (tempfile::TempDir, PathBuf) {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join(name);
    common::copy(&folder().join("files").join(name), &path);
    (home, path)
}

/// Returns the error of reading a Zarr store in which one file's text is replaced.
fn zarr_refusal(name: &str, file: &str, from: &str, to: &str) -> String {
    let (_home, path) = store(name);
    let text = std::fs::read_to_string(path.join(file)).unwrap();
    assert!(text.contains(from), "{text}");
    std::fs::write(path.join(file), text.replace(from, to)).unwrap();
    refusal(path.to_str().unwrap(), ReadFlags::default())
}

#[test]
fn zarr_that_cannot_be_read_is_refused_in_words() {
    for (name, file, from, to, why) in [
        ("two.ome.zarr", ".zattrs", "\"s0\"", "\"../../etc\"", "beside it alone"),
        ("two.ome.zarr", ".zattrs", "\"s0\"", "\"gone\"", "no such array"),
        ("two.ome.zarr", ".zattrs", "\"name\": \"x\"", "\"name\": \"r\"", "x and y are needed"),
        ("two.ome.zarr", ".zattrs", "multiscales", "labels", "no `multiscales`"),
        ("two.ome.zarr", ".zattrs", "\"scale\"", "\"affine\"", "unknown variant `affine`"),
        ("v2_zstd.zarr", ".zarray", "\"zstd\"", "\"lzma\"", "`lzma`; gzip, zlib, zstd and blosc"),
        ("v2_zstd.zarr", ".zarray", "<u2", "<c8", "`<c8`"),
        ("v2_zstd.zarr", ".zarray", "16", "160", "fewer than its"),
        ("v2_plain.zarr", ".zarray", "<u2", "<u4", "and its numbers"),
        ("v3_sharded.zarr", "zarr.json", "sharding_indexed", "sharding", "compressed by `sharding`"),
        ("v3_checked.zarr", "zarr.json", "\"regular\"", "\"rectilinear\"", "grid of chunks"),
    ] {
        let said = zarr_refusal(name, file, from, to);
        assert!(said.contains(why), "{name}, {to}: {said}");
    }
    let said = refusal("two.ome.zarr", ReadFlags { level: Some(2), ..ReadFlags::default() });
    assert!(said.contains("--level 2") && said.contains("2 levels"), "{said}");
}

#[test]
fn checksums_reveal_damaged_chunks() {
    for (name, file) in [("v3_checked.zarr", "c/0/0/0"), ("v3_sharded.zarr", "c/0/0/0")] {
        let (_home, path) = store(name);
        let mut bytes = std::fs::read(path.join(file)).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(path.join(file), bytes).unwrap();
        let said = refusal(path.to_str().unwrap(), ReadFlags::default());
        assert!(said.contains("chunk c/0/0/0") && said.contains("checksum"), "{said}");
    }
}

#[test]
fn a_store_is_named_by_its_files_too_and_has_their_digest() {
    let whole = VolumeSpec::new(folder().join("files/two.ome.zarr").to_string_lossy());
    let by_file = VolumeSpec::new(folder().join("files/two.ome.zarr/.zattrs").to_string_lossy());
    let [a, b] = [&whole, &by_file].map(|spec| load(spec).unwrap());
    assert_eq!(a.resident().unwrap(), b.resident().unwrap());
    let coarse = VolumeSpec { flags: ReadFlags { level: Some(1), ..whole.flags.clone() }, ..whole.clone() };
    assert_eq!(whole.sha256().unwrap(), by_file.sha256().unwrap());
    assert_ne!(whole.sha256().unwrap(), coarse.sha256().unwrap());
    // A Zarr store without data takes neither memory nor time.
    let (_home, path) = store("v2_plain.zarr");
    let claims = std::fs::read_to_string(path.join(".zarray")).unwrap().replacen("16", "4000000", 1);
    std::fs::write(path.join(".zarray"), claims).unwrap();
    let said = refusal(path.to_str().unwrap(), ReadFlags::default());
    assert!(said.contains("claimed"), "{said}");
}

#[test]
fn lists_lead_nowhere_else_and_to_whole_files() {
    for (name, from, to, why) in [
        ("list.nhdr", "slice09.raw", "../slice09.raw", "beside it alone"),
        ("list.mhd", "slice09.raw", "/etc/passwd", "beside it alone"),
        ("pattern.mhd", "slice%02d", "../%02d", "beside it alone"),
        ("pattern.mhd", "8 13 1", "8 14 1", "no whole number in each"),
        ("pattern.nhdr", "8 13 1", "9 14 1", "no such file"),
        ("list.mhd", "5 4 6", "50 40 60", "shorter"),
        ("slabs.nhdr", "byte skip: 5", "byte skip: 6", "shorter"),
    ] {
        let home = tempfile::tempdir().unwrap();
        for file in std::fs::read_dir(folder().join("files")).unwrap().map(|entry| entry.unwrap().path()) {
            let name = file.file_name().unwrap().to_string_lossy().into_owned();
            if name.starts_with("slice") || name.starts_with("half") {
                std::fs::copy(&file, home.path().join(name)).unwrap();
            }
        }
        let text = std::fs::read_to_string(folder().join("files").join(name)).unwrap();
        assert!(text.contains(from), "{text}");
        std::fs::write(home.path().join(name), text.replace(from, to)).unwrap();
        let said = refusal(home.path().join(name).to_str().unwrap(), ReadFlags::default());
        assert!(said.contains(why), "{name}, {to}: {said}");
    }
    let spec = VolumeSpec::new(folder().join("files/list.mhd").to_string_lossy());
    let other = VolumeSpec::new(folder().join("files/pattern.mhd").to_string_lossy());
    assert_ne!(spec.sha256().unwrap(), other.sha256().unwrap());
}

#[test]
fn images_in_folders_of_a_store_are_found_or_reported() {
    let (_home, image) = store("two.ome.zarr");
    let around = tempfile::tempdir().unwrap();
    common::copy(&image, &around.path().join("0"));
    let read = || load(&VolumeSpec::new(around.path().to_string_lossy()));
    std::fs::write(around.path().join(".zattrs"), r#"{"bioformats2raw.layout": 3}"#).unwrap();
    let volume = read().unwrap();
    assert_eq!(volume.dims(), [8, 6, 3]);
    assert!(volume.provenance.warnings[0].contains("in `0`"), "{:?}", volume.provenance.warnings);
    std::fs::write(around.path().join(".zattrs"), r#"{"plate": {"rows": []}}"#).unwrap();
    assert!(read().unwrap_err().why.contains("A/1/0"));
    std::fs::write(around.path().join(".zattrs"), "{").unwrap();
    assert!(read().unwrap_err().why.contains(".zattrs"));
}

#[test]
fn vtk_images_that_cannot_be_read_are_refused_in_words() {
    let text = std::fs::read_to_string(folder().join("files/text.vti")).unwrap();
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("a.vti");
    for (from, to, why) in [
        ("Scalars=\"density\"", "Scalars=\"gradient\"", "`gradient` are 3 numbers"),
        ("Scalars=\"density\"", "Scalars=\"gone\"", "no array of one number"),
        ("WholeExtent=\"2 6 -1 2 0 2\"", "WholeExtent=\"2 7 -1 2 0 2\"", "smaller than the image"),
        ("2 6 -1 2 0 2", "2 99999 -1 99999 0 99999", "GiB"),
        ("2 6 -1 2 0 2", "2 6 -1 2 0 3", "ends after 480"),
        ("2 6 -1 2 0 2", "2 6 -1 2 0 -1", "no voxels along an axis"),
        ("2 6 -1 2 0 2", "2 6", "WholeExtent is `2 6`"),
        ("Spacing=\"0.7", "Spacing=\"0", "singular"),
        ("Direction=\"0.87", "Direction=\"1 0.87", "not 9 numbers"),
        ("34.5584", "x34.5584", "`x34.5584"),
        ("\"Float64\" Name=\"density\"", "\"String\" Name=\"density\"", "of the kind `String`"),
        ("</ImageData>", "", "no XML file"),
        ("header_type", "compressor=\"vtkLZ4DataCompressor\" header_type", "zlib or none"),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replace(from, to)).unwrap();
        let said = refusal(path.to_str().unwrap(), ReadFlags::default());
        assert!(said.contains(why), "{to}: {said}");
    }
    // A file marked as LPS is converted; everything else stays.
    let plain = load(&VolumeSpec::new(folder().join("files/text.vti").to_string_lossy())).unwrap();
    std::fs::write(&path, text.replacen('\n', "\n<!-- SPACE=LPS, it's said -->\n", 1)).unwrap();
    let turned = load(&VolumeSpec::new(path.to_string_lossy())).unwrap();
    let about = glam::DAffine3::from_scale(glam::DVec3::new(-1.0, -1.0, 1.0));
    assert_eq!(turned.world_from_index(), about * plain.world_from_index());
    assert_eq!(turned.resident().unwrap(), plain.resident().unwrap());
}
