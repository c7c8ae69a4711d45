//! Files of other programs' writers: grid, affine and values are those that the writers' own libraries read back.
//!
//! `make.py` made the files and `expected.json`.

mod mutants;
mod round_trip;

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
    /// A part of a warning that must be there.
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
        let flags = ReadFlags { frame: e.frame, series: e.series, ..ReadFlags::default() };
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
        // What lies between slices hangs on positions of eight digits.
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

/// What `info` says of a folder, and how: in one line.
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
