//! Helpers shared by the readers of volume files: error texts, frame numbers, paths of data files, length units,
//! affines.

use crate::error::{Error, Result};
use crate::volume::{Element, Volume};
use glam::{DAffine3, DMat3, DVec3};
use std::path::{Component, Path, PathBuf};

/// Returns a function that turns a reason into the error "cannot read volume" with that reason and the path of the
/// volume file.
pub(super) fn refusal(path: &Path) -> impl Fn(String) -> Error {
    move |why| Error::input("cannot read volume", path.display(), why)
}

/// Returns a warning for a volume file with several frames (such as time points): only the frame with index `frame`
/// (from 0) was read.
///
/// # Errors
/// The volume file has too few frames: `frame` is out of range.
pub(super) fn frame_warning(path: &Path, frame: usize, frames: usize) -> Result<Option<String>> {
    if frame >= frames {
        let noun = if frames == 1 { "frame" } else { "frames" };
        let why = format!("--frame {frame} is beyond its {frames} {noun} (counted from 0)");
        return Err(Error::input("cannot read frame", path.display(), why));
    }
    Ok((frames > 1).then(|| frame_choice(frame, frames)))
}

/// Returns the text of the warning that only one of several frames (such as time points) of a file was read.
pub fn frame_choice(frame: usize, frames: usize) -> String {
    format!("{frames} frames: frame {frame} (counted from 0) was read, --frame selects another")
}

/// Returns the path of a data file that a volume header names. The data file must lie in the folder of the header or
/// below it, so that a header cannot open other files of the machine.
///
/// # Errors
/// The name of the data file is empty or leads out of the folder of the header.
pub(super) fn sibling(header: &Path, name: &str) -> Result<PathBuf, String> {
    let path = Path::new(name);
    let is_inside = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if name.is_empty() || !is_inside || name.contains('\\') {
        return Err(format!("its voxels are in `{name}`, and a header may name files beside it alone"));
    }
    Ok(header.parent().unwrap_or(Path::new("")).join(path))
}

/// Returns the length in mm of a length unit that is given by its name, such as `cm`; `None` for an unknown name.
pub(super) fn mm_of(unit: &str) -> Option<f64> {
    Some(match unit {
        "mm" | "millimeter" | "millimeters" => 1.0,
        "cm" | "centimeter" => 10.0,
        "decimeter" => 100.0,
        "m" | "meter" => 1000.0,
        "micron" | "microns" | "um" | "µm" | "μm" | "\\u00B5m" | "micrometer" => 1e-3,
        "nm" | "nanometer" => 1e-6,
        "angstrom" => 1e-7,
        "picometer" => 1e-9,
        "inch" | "in" => 25.4,
        "foot" => 304.8,
        _ => return None,
    })
}

/// Parses finite numbers separated by white space; `None` if a word is not a finite number.
pub(super) fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace().map(|n| n.parse::<f64>().ok().filter(|v| v.is_finite())).collect()
}

/// Builds the affine from voxel indices to world coordinates (RAS+, mm) from the direction of each grid axis and the
/// origin in mm. With `is_lps` the inputs are in LPS coordinates, as in DICOM and ITK.
pub(super) fn affine(directions: [DVec3; 3], origin: DVec3, is_lps: bool) -> DAffine3 {
    let [x, y, z] = directions;
    let affine = DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin);
    if is_lps { DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * affine } else { affine }
}

/// Adds a warning to a volume whose 64-bit integers were rounded by the conversion to `f64`.
pub(super) fn with_integer_warning(mut volume: Volume, element: Element) -> Volume {
    let limit = (1u64 << f64::MANTISSA_DIGITS) as f64;
    let is_rounded = volume.stored_range().iter().any(|v| v.abs() > limit);
    if is_rounded && matches!(element, Element::I64 | Element::U64) {
        volume.provenance.warnings.push("integers beyond 2^53 were rounded to 53 bits".into());
    }
    volume
}
