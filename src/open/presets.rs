//! How a `--tf` value becomes a transfer function that suits a volume.

use crate::error::{Error, Result};
use crate::strands::STRANDS_FORMAT;
use crate::transfer::TransferFunction;
pub use crate::transfer::presets::{PRESETS, Preset, Scale};
use crate::volume::Volume;
use std::path::Path;

/// The HU that lie over the value range of a volume that is not in HU.
///
/// An 8-bit CT is commonly such a window: air at the bottom, dense bone clipped at the top, which puts soft tissue
/// at about 0.58 of the range.
pub const HU_WINDOW: [f64; 2] = [-1000.0, 800.0];

/// A range of scaled values no wider than this is 8-bit or normalised data, not HU.
const MIN_HU_WIDTH: f64 = 300.0;

/// CT values beyond these are no HU but 16-bit intensities or a synthetic field.
const PLAUSIBLE_HU: [f64; 2] = [-32768.0, 32767.0];

/// A volume in HU that has values below this has air in it; no tissue but lung is as thin.
const AIR_BELOW_HU: f64 = -500.0;

/// A `--tf` value that has been found and read, not yet suited to a volume.
#[derive(Debug, Clone)]
pub enum Found {
    /// A built-in function.
    Preset(&'static Preset),
    /// One from a file.
    File(TransferFunction),
}

/// A transfer function in the units of its volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ResolvedTransferFunction {
    /// The function, laid over the values of the volume.
    pub tf: TransferFunction,
    /// What was done to suit the volume, in one line, where anything was.
    pub note: Option<String>,
}

/// Finds a preset by name; anything that ends in `.json` or exists is read as a file.
///
/// # Errors
/// No such preset (the hint lists them), or a file that cannot be read.
pub fn find(name_or_path: &str) -> Result<Found> {
    if let Some(preset) = PRESETS.iter().find(|p| p.name == name_or_path) {
        return Ok(Found::Preset(preset));
    }
    let path = Path::new(name_or_path);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) || path.exists() {
        return TransferFunction::read(path).map(Found::File);
    }
    let names = PRESETS.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
    Err(Error::input(
        "unknown transfer function",
        format!("--tf {name_or_path}"),
        "it is neither a preset nor a file that exists",
    )
    .hint(format!("presets: {names}; or the path of a .json file")))
}

impl Found {
    /// The transfer function in the volume's units: presets are scaled as their [`Scale`] says, files never.
    pub fn suit(self, volume: &Volume) -> ResolvedTransferFunction {
        let preset = match self {
            Self::Preset(preset) => preset,
            Self::File(tf) => return ResolvedTransferFunction { tf, note: None },
        };
        let tf = preset.transfer_function();
        let (from, meaning) = match preset.scale {
            Scale::Hounsfield if in_hounsfield(volume) => return ResolvedTransferFunction { tf, note: None },
            Scale::Extinction => {
                let largest = volume.value_range()[1];
                // Nothing to stretch to where there is no extinction at all.
                let stretch = if largest > 0.0 { largest } else { 1.0 };
                let mut tf = tf.scale_values(|v| v * stretch);
                tf.points.iter_mut().for_each(|p| p.amount *= stretch);
                let note = (!of_strands(volume))
                    .then(|| format!("preset `{}`: values are taken as extinction in 1/mm", preset.name));
                return ResolvedTransferFunction { tf, note };
            }
            Scale::Hounsfield => (HU_WINDOW, "the volume is not in HU, so -1000 to 800 HU"),
            Scale::Fraction => ([0.0, 1.0], "0 to 1"),
        };
        let to = volume.value_range();
        // A constant volume has no range to scale to; its one value stands for the whole of it.
        let width = if to[1] > to[0] { to[1] - to[0] } else { 1.0 };
        let scaled = tf.scale_values(|v| to[0] + (v - from[0]) / (from[1] - from[0]) * width);
        // One point means one amount everywhere: nothing was moved, so nothing is said.
        let note = (scaled.points.len() > 1).then(|| {
            let [lo, hi] = to.map(|v| (v * 1e4).round() / 1e4);
            format!("preset `{}`: {meaning} of it lie over the value range {lo} to {hi}", preset.name)
        });
        ResolvedTransferFunction { tf: scaled, note }
    }
}

/// Finds a transfer function and suits it to a volume.
///
/// # Errors
/// As [`find`].
pub fn resolve(name_or_path: &str, volume: &Volume) -> Result<ResolvedTransferFunction> {
    find(name_or_path).map(|found| found.suit(volume))
}

/// Whether a volume was made from strands, so that its values are extinction in 1/mm.
pub fn of_strands(volume: &Volume) -> bool {
    volume.provenance.format == STRANDS_FORMAT
}

/// The preset where none is asked for: `hair` for strands, `ct` for a volume in HU with air in it, `bone` for one in HU
/// without (its background, often 0, would be opaque as soft tissue), `engine` otherwise.
pub fn default_name(volume: &Volume) -> &'static str {
    if of_strands(volume) {
        return "hair";
    }
    match (in_hounsfield(volume), volume.value_range()[0] < AIR_BELOW_HU) {
        (true, true) => "ct",
        (true, false) => "bone",
        (false, _) => "engine",
    }
}

/// Whether the values can be HU: wider than 300 and within 16-bit integers. NIfTI does not say, so range is all
/// there is to go by.
pub fn in_hounsfield(volume: &Volume) -> bool {
    let [lo, hi] = volume.value_range();
    hi - lo > MIN_HU_WIDTH && lo >= PLAUSIBLE_HU[0] && hi <= PLAUSIBLE_HU[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling, Voxels};
    use glam::DAffine3;
    use ndarray::array;

    fn volume(lo: f64, hi: f64) -> Volume {
        let provenance = Provenance::new("test", "phantom", "float64");
        let voxels = Voxels::F64(array![[[lo, hi]]]);
        Volume::new(voxels, Scaling::IDENTITY, DAffine3::IDENTITY, provenance).unwrap()
    }

    #[test]
    fn hounsfield_presets_stay_on_hounsfield_volumes() {
        for (lo, hi) in [(-1024.0, 3071.0), (0.0, 563.2), (0.0, 4095.0)] {
            let r = resolve("vessels", &volume(lo, hi)).unwrap();
            assert_eq!((r.tf.points[0].value, r.note), (190.0, None));
        }
    }

    #[test]
    fn hounsfield_presets_scale_to_other_ranges_and_say_so() {
        for (lo, hi) in [(0.0, 255.0), (0.0, 1.0), (0.0, 65535.0), (-0.5, 0.5)] {
            let r = resolve("vessels", &volume(lo, hi)).unwrap();
            let expected = lo + (190.0 + 1000.0) / 1800.0 * (hi - lo);
            assert!((r.tf.points[0].value - expected).abs() < 1e-9 * hi.abs());
            assert!(r.note.unwrap().contains(&format!("value range {lo} to {hi}")));
        }
    }

    #[test]
    fn fractions_scale_to_every_range() {
        let r = resolve("isosurface", &volume(-1000.0, 3000.0)).unwrap();
        assert_eq!((r.tf.extinction(999.9), r.tf.points[0].value), (0.0, 1000.0));
        assert!(r.tf.extinction(1000.0) > 10.0 && r.note.is_some());
        let constant = resolve("isosurface", &volume(7.0, 7.0)).unwrap().tf;
        assert!(constant.points.iter().all(|p| p.value.is_finite()));
        assert_eq!(resolve("uniform", &volume(0.0, 9.0)).unwrap().note, None);
    }

    #[test]
    fn extinction_is_the_value_itself() {
        for hi in [1e-12, 0.37, 4000.0] {
            let mut strands = volume(0.0, hi);
            let tf = resolve("hair", &strands).unwrap();
            assert!(tf.note.is_some(), "nothing says that the values are extinction");
            for w in [0.0, 0.1, 0.5, 1.0] {
                assert!((tf.tf.extinction(w * hi) - w * hi).abs() <= 1e-15 * hi, "{hi} {w}");
            }
            strands.provenance.format = STRANDS_FORMAT.into();
            assert_eq!(default_name(&strands), "hair");
            assert_eq!(resolve("hair", &strands).unwrap().note, None);
        }
        let empty = resolve("hair", &volume(0.0, 0.0)).unwrap().tf;
        assert_eq!((empty.extinction(0.0), empty.points.len()), (0.0, 2));
    }

    #[test]
    fn files_are_never_scaled() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mine.json");
        let tf = PRESETS[1].transfer_function();
        tf.write(&path).unwrap();
        let r = resolve(path.to_str().unwrap(), &volume(0.0, 1.0)).unwrap();
        assert_eq!(r, ResolvedTransferFunction { tf, note: None });
    }

    #[test]
    fn an_unknown_name_lists_the_presets() {
        let e = find("boen").unwrap_err();
        assert!(e.place.contains("boen") && e.hint.unwrap().contains("bone"));
        assert_eq!(e.fault, crate::error::Fault::Input);
        assert!(find("missing.json").unwrap_err().why.contains("No such file"));
    }

    #[test]
    fn the_default_suits_the_values() {
        for (lo, hi, expected) in [(0.0, 1.0, "engine"), (-1000.0, 1000.0, "ct"), (0.0, 563.2, "bone")] {
            assert_eq!(default_name(&volume(lo, hi)), expected);
            assert!(find(expected).is_ok());
        }
    }
}
