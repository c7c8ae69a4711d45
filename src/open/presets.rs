//! Finds the transfer function of `--tf`, a preset or a file, and adapts it to a volume.

use super::units::{Meaning, Units, ValueKind, background_note, of_strands};
use super::user_presets;
use crate::error::{Error, Result};
use crate::files::input::read_text;
use crate::transfer::TransferFunction;
use crate::transfer::formats::{self, Imported, has_fractions};
pub use crate::transfer::presets::{PRESETS, Preset, Scale};
use crate::volume::Volume;
use std::path::Path;

/// Range of HU that is mapped to the volume's value range when a transfer-function preset in HU is used for a volume
/// whose values are not HU.
///
/// An 8-bit CT is commonly such a window: air at the bottom, dense bone clipped at the top, and soft tissue at about
/// 0.58 of the range.
pub const HU_WINDOW: [f64; 2] = [-1000.0, 800.0];

/// Diagonal of the volumes for which the extinction of transfer-function presets is made, mm.
pub const NOMINAL_DIAGONAL_MM: f64 = 400.0;
/// Presets keep their extinction if the volume's diagonal is within this factor of the nominal one, or its voxel
/// spacing (geometric mean, mm) is in the range below. One of the two holds for every CT of a body or body part.
const DIAGONAL_FACTOR: f64 = 4.0;
const BODY_SPACINGS_MM: [f64; 2] = [0.3, 3.0];

/// Largest extinction (1/mm) of a transfer function that float32 arithmetic allows.
const MOST_EXTINCTION: f64 = 1e30;

/// Transfer function that was found and read but is not yet adapted to a volume.
#[derive(Debug, Clone)]
pub enum Found {
    /// Built-in transfer function (preset).
    Preset(&'static Preset),
    /// Transfer function that was read from a file.
    File(Imported),
}

/// Settings for adapting a transfer function to a volume: units of the values and factor on the extinction. `None`
/// derives a setting from the volume.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Suiting {
    /// Interpretation of the volume's values to which the transfer function is adapted: HU, or fractions of their
    /// range.
    pub units: Option<Units>,
    /// Factor on the transfer function's extinction.
    pub opacity_scale: Option<f64>,
}

/// Result of adapting a transfer function to the values of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ResolvedTransferFunction {
    /// Transfer function whose scalar values are in the units of the volume.
    pub tf: TransferFunction,
    /// Notes on how the transfer function was adapted to the volume, one line each.
    pub notes: Vec<String>,
    /// Warnings on parts of the transfer function's file that are not supported, one line each.
    pub warnings: Vec<String>,
    /// Units of the volume's values and factor on the extinction that were applied to the transfer function.
    pub suiting: Suiting,
}

/// Finds a transfer function: a preset by its name (built-in, or of the user), or else a file by its path.
///
/// # Errors
/// There is no such preset (the hint lists them), or the file cannot be read.
pub fn find(name_or_path: &str) -> Result<Found> {
    if let Some(preset) = PRESETS.iter().find(|p| p.name == name_or_path) {
        return Ok(Found::Preset(preset));
    }
    let located = user_presets::located(name_or_path);
    let path = Path::new(&located);
    if formats::has_ending(path) || path.exists() {
        return formats::read(path).map(Found::File);
    }
    let names = user_presets::names();
    let endings = formats::endings().join(", .");
    let meant = PRESETS.iter().find(|p| p.name.eq_ignore_ascii_case(name_or_path));
    let meant = meant.map_or(String::new(), |preset| format!("did you mean `{}`? ", preset.name));
    Err(Error::input(
        "unknown transfer function",
        format!("--tf {name_or_path}"),
        "it is neither a preset nor a file that exists",
    )
    .hint(format!("{meant}presets: {names}; or the path of a file (.{endings})")))
}

impl Found {
    /// Adapts the transfer function to the volume: presets by the meaning of their values ([`Scale`]), files only if
    /// their values are fractions. The given factor, or for presets one from the volume's size, scales the
    /// extinction.
    ///
    /// # Errors
    /// The extinction becomes too large.
    pub fn suit(self, volume: &Volume, requested: Suiting) -> Result<ResolvedTransferFunction> {
        let meaning = Meaning::of(volume, requested.units);
        let (mut notes, mut warnings) = (Vec::new(), Vec::new());
        let (tf, by_size) = match self {
            Self::Preset(preset) => {
                let tf = preset_for(preset, volume, &meaning, &mut notes);
                let by_size = size_factor(volume).filter(|_| preset.scale != Scale::Extinction);
                let name = format!("preset `{}`", preset.name);
                (tf, by_size.map(|factor| (name, factor)))
            }
            Self::File(carried) => {
                warnings = carried.warnings;
                let mut tf = carried.tf;
                if has_fractions(&tf) {
                    let name = format!("`{}`", tf.name);
                    tf = laid_over(&tf, [0.0, 1.0], volume, &format!("{name}: 0 to 1"), &mut notes);
                }
                (tf, None)
            }
        };
        let factor = requested.opacity_scale.or(by_size.as_ref().map(|(_, factor)| *factor)).unwrap_or(1.0);
        if let Some((name, factor)) = by_size.filter(|_| requested.opacity_scale.is_none()) {
            notes.push(format!(
                "{name} is made for volumes of about {NOMINAL_DIAGONAL_MM} mm, and this one is {} mm across: its extinction is \
                 {factor} times as high (--opacity-scale 1 undoes that)",
                rounded(diagonal_mm(volume))
            ));
        }
        let tf = if factor == 1.0 { tf } else { tf.scale_extinction(factor) };
        let largest = tf.max_extinction(f64::NEG_INFINITY, f64::INFINITY);
        if largest.is_nan() || largest > MOST_EXTINCTION {
            let why = format!("an extinction of {largest:.3e} per mm is too large for 32-bit arithmetic");
            return Err(Error::input("cannot scale transfer function", "--opacity-scale", why));
        }
        let units = match meaning.kind {
            ValueKind::Hounsfield => Some(Units::Hu),
            ValueKind::Other => Some(Units::Fraction),
            ValueKind::Extinction => None,
        };
        let suiting = Suiting { units, opacity_scale: Some(factor) };
        Ok(ResolvedTransferFunction { tf, notes, warnings, suiting })
    }

    /// Returns the transfer function in its own units, not adapted to any volume, with the warnings of its import.
    pub fn as_it_is(self) -> (TransferFunction, Vec<String>) {
        match self {
            Self::Preset(preset) => (preset.transfer_function(), Vec::new()),
            Self::File(carried) => (carried.tf, carried.warnings),
        }
    }
}

/// Adapts a transfer-function preset to the values of a volume, and adds notes for the user on this to `notes`.
fn preset_for(
    preset: &Preset,
    volume: &Volume,
    meaning: &Meaning,
    notes: &mut Vec<String>,
) -> TransferFunction {
    let tf = preset.transfer_function();
    let name = format!("preset `{}`", preset.name);
    match preset.scale {
        Scale::Hounsfield if meaning.is_hounsfield() => {
            if meaning.is_guess {
                notes.push(format!("values are taken as {}", meaning.text()));
            }
            notes.extend(background_note(volume, &tf, &name));
            tf
        }
        Scale::Hounsfield => {
            let [low, high] = HU_WINDOW;
            let what = format!("{name}: the volume is {}, so {low} to {high} HU", meaning.text());
            laid_over(&tf, HU_WINDOW, volume, &what, notes)
        }
        Scale::Fraction => laid_over(&tf, [0.0, 1.0], volume, &format!("{name}: 0 to 1"), notes),
        Scale::Extinction => {
            let largest = volume.value_range()[1];
            // Without extinction there is no range to scale to.
            let stretch = if largest > 0.0 { largest } else { 1.0 };
            let mut tf = tf.scale_values(|v| v * stretch);
            tf.points.iter_mut().for_each(|p| p.amount *= stretch);
            if !of_strands(volume) {
                notes.push(format!("{name}: values are taken as extinction in 1/mm"));
            }
            tf
        }
    }
}

/// Maps the range `from` of a transfer function's scalar values to the value range of the volume. It adds a note for
/// the user that starts with `what`.
fn laid_over(
    tf: &TransferFunction,
    from: [f64; 2],
    volume: &Volume,
    what: &str,
    notes: &mut Vec<String>,
) -> TransferFunction {
    let to = volume.value_range();
    // A constant volume has no range: its value stands for all of it.
    let width = if to[1] > to[0] { to[1] - to[0] } else { 1.0 };
    let mut scaled = tf.scale_values(|v| to[0] + (v - from[0]) / (from[1] - from[0]) * width);
    // If the function is written to a file, its values must not be scaled again.
    scaled.units.clear();
    // A single point is one amount everywhere: nothing was scaled.
    if scaled.points.len() > 1 {
        let [lo, hi] = to.map(|v| (v * 1e4).round() / 1e4);
        notes.push(format!("{what} of it lie over the value range {lo} to {hi}"));
    }
    scaled
}

/// Diagonal of a volume's bounding box, mm.
fn diagonal_mm(volume: &Volume) -> f64 {
    let corners = volume.corners_mm();
    corners.iter().map(|c| c.distance(corners[0])).fold(0.0, f64::max)
}

/// Factor on the extinction of presets for a volume much smaller or larger than a body: [`NOMINAL_DIAGONAL_MM`] over
/// the volume's diagonal, so that light fades over the same fraction of the volume. `None` near the size of a body.
pub fn size_factor(volume: &Volume) -> Option<f64> {
    let spacing_mm = volume.spacing_mm().into_iter().product::<f64>().cbrt();
    let factor = NOMINAL_DIAGONAL_MM / diagonal_mm(volume);
    let is_near = (1.0 / DIAGONAL_FACTOR..=DIAGONAL_FACTOR).contains(&factor)
        || (BODY_SPACINGS_MM[0]..=BODY_SPACINGS_MM[1]).contains(&spacing_mm);
    (factor.is_finite() && factor > 0.0 && !is_near).then(|| rounded(factor).clamp(1e-6, 1e6))
}

/// Rounds a number to three significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

/// Finds a transfer function by preset name or file path, and adapts it to a volume.
///
/// # Errors
/// See [`find`] and [`Found::suit`].
pub fn resolve(name_or_path: &str, volume: &Volume) -> Result<ResolvedTransferFunction> {
    resolve_as(name_or_path, volume, Suiting::default())
}

/// Finds a transfer function by preset name or file path, and adapts it to a volume with the units and extinction
/// factor of `requested`.
///
/// # Errors
/// See [`find`] and [`Found::suit`].
pub fn resolve_as(
    name_or_path: &str,
    volume: &Volume,
    requested: Suiting,
) -> Result<ResolvedTransferFunction> {
    find(name_or_path)?.suit(volume, requested)
}

/// Name of the default transfer-function preset for a volume: `hair` for strands, `ct` for HU with air, `bone` for HU
/// without air, `engine` otherwise. In a volume without air, `ct` would make a background of 0 as opaque as soft
/// tissue.
pub fn default_name(volume: &Volume) -> &'static str {
    default_of(&Meaning::of(volume, None))
}

/// Name of the default transfer-function preset for a kind of volume values, such as HU with air.
fn default_of(meaning: &Meaning) -> &'static str {
    match (meaning.kind, meaning.has_air) {
        (ValueKind::Extinction, _) => "hair",
        (ValueKind::Hounsfield, true) => "ct",
        (ValueKind::Hounsfield, false) => "bone",
        (ValueKind::Other, _) => "engine",
    }
}

/// Returns a transfer-function file as text in this program's format; a file of another format is converted.
///
/// # Errors
/// The file cannot be read.
pub fn own_text(path: &Path) -> Result<String> {
    let text = read_text(path, "cannot read transfer function")?;
    match TransferFunction::from_json(&text) {
        Ok(_) => Ok(text),
        Err(_) => formats::read(path).map(|carried| carried.tf.to_json() + "\n"),
    }
}

/// Returns the default transfer-function preset of a volume, and a note for the user if the values' units were
/// guessed not to be HU.
pub fn default_as(volume: &Volume, units: Option<Units>) -> (&'static str, Option<String>) {
    let meaning = Meaning::of(volume, units);
    let name = default_of(&meaning);
    let needs_note = meaning.is_guess && meaning.kind == ValueKind::Other;
    (name, needs_note.then(|| format!("values are taken as {}: preset `{name}`", meaning.text())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strands::STRANDS_FORMAT;
    use crate::volume::{Provenance, Scaling, ValueMeaning, Voxels};
    use glam::DAffine3;
    use ndarray::array;

    /// Creates a test volume of two voxels at a distance of `mm`.
    fn volume_of(lo: f64, hi: f64, mm: f64) -> Volume {
        let provenance = Provenance::new("test", "phantom", "float64");
        let voxels = Voxels::F64(array![[[lo, hi]]]);
        let affine = DAffine3::from_scale(glam::DVec3::splat(mm));
        Volume::new(voxels, Scaling::IDENTITY, affine, provenance).unwrap()
    }

    fn volume(lo: f64, hi: f64) -> Volume {
        volume_of(lo, hi, 1.0)
    }

    #[test]
    fn hounsfield_presets_stay_on_hounsfield_volumes() {
        let r = resolve("vessels", &volume(-1024.0, 3071.0)).unwrap();
        assert_eq!((r.tf.points[0].value, r.notes.len()), (190.0, 1), "a guess is stated");
        let mut stated = volume(0.0, 100.0);
        stated.provenance.values = ValueMeaning::Hounsfield("DICOM modality CT".into());
        let r = resolve("vessels", &stated).unwrap();
        assert_eq!((r.tf.points[0].value, r.notes.len(), r.tf.units.as_str()), (190.0, 0, "HU"));
        let requested = Suiting { units: Some(Units::Hu), ..Suiting::default() };
        let r = resolve_as("vessels", &volume(0.0, 4095.0), requested).unwrap();
        assert_eq!((r.tf.points[0].value, r.notes.len()), (190.0, 0));
        assert_eq!(r.suiting, Suiting { units: Some(Units::Hu), opacity_scale: Some(1.0) });
    }

    #[test]
    fn hounsfield_presets_scale_to_other_ranges_and_say_so() {
        for (lo, hi) in [(0.0, 255.0), (0.0, 1.0), (0.0, 65535.0), (-0.5, 0.5), (0.0, 4095.0)] {
            let r = resolve("vessels", &volume(lo, hi)).unwrap();
            let expected = lo + (190.0 + 1000.0) / 1800.0 * (hi - lo);
            assert!((r.tf.points[0].value - expected).abs() < 1e-9 * hi.abs());
            assert!(
                r.notes[0].contains(&format!("value range {lo} to {hi}"))
                    && r.notes[0].contains("--units hu")
            );
            assert_eq!(r.tf.units, "", "its values are the volume's own");
        }
        let requested = Suiting { units: Some(Units::Fraction), ..Suiting::default() };
        assert_eq!(
            resolve_as("vessels", &volume(-1000.0, 800.0), requested).unwrap().tf.points[0].value,
            190.0
        );
        assert_eq!(
            resolve_as("vessels", &volume(-1000.0, 2600.0), requested).unwrap().tf.points[0].value,
            1380.0
        );
    }

    #[test]
    fn fractions_scale_to_every_range() {
        let r = resolve("isosurface", &volume(-1000.0, 3000.0)).unwrap();
        assert_eq!((r.tf.extinction(999.9), r.tf.points[0].value), (0.0, 1000.0));
        assert!(r.tf.extinction(1000.0) > 10.0 && r.notes.len() == 1);
        let constant = resolve("isosurface", &volume(7.0, 7.0)).unwrap().tf;
        assert!(constant.points.iter().all(|p| p.value.is_finite()));
        assert_eq!(resolve("uniform", &volume(0.0, 9.0)).unwrap().notes, [""; 0]);
    }

    #[test]
    fn extinction_is_the_value_itself() {
        for hi in [1e-12, 0.37, 4000.0] {
            let mut strands = volume(0.0, hi);
            let tf = resolve("hair", &strands).unwrap();
            assert_eq!(tf.notes.len(), 1, "nothing says that the values are extinction");
            for w in [0.0, 0.1, 0.5, 1.0] {
                assert!((tf.tf.extinction(w * hi) - w * hi).abs() <= 1e-15 * hi, "{hi} {w}");
            }
            strands.provenance.format = STRANDS_FORMAT.into();
            assert_eq!(default_name(&strands), "hair");
            assert_eq!(resolve("hair", &strands).unwrap().notes, [""; 0]);
        }
        let empty = resolve("hair", &volume(0.0, 0.0)).unwrap().tf;
        assert_eq!((empty.extinction(0.0), empty.points.len()), (0.0, 2));
        let tiny = resolve("hair", &volume_of(0.0, 1.0, 1e-3)).unwrap();
        assert_eq!(tiny.tf.extinction(1.0), 1.0, "what is an extinction has no size to scale with");
    }

    #[test]
    fn files_are_scaled_where_they_are_of_fractions_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mine.json");
        let tf = PRESETS[1].transfer_function();
        tf.write(&path).unwrap();
        let read = |volume: &Volume| resolve(path.to_str().unwrap(), volume).unwrap();
        for volume in [volume(0.0, 1.0), volume_of(0.0, 1.0, 1e-3)] {
            let r = read(&volume);
            assert_eq!((&r.tf, r.notes.len(), r.warnings.len()), (&tf, 0, 0));
        }
        let engine = PRESETS.iter().find(|p| p.name == "engine").unwrap();
        engine.transfer_function().write(&path).unwrap();
        let (file, preset) = (read(&volume(3.0, 50.0)), resolve("engine", &volume(3.0, 50.0)).unwrap());
        assert_eq!(file.tf, preset.tf);
        assert_eq!(file.notes.len(), 1);
        // A preset that was adapted to one volume and written is not scaled to another volume's range.
        preset.tf.write(&path).unwrap();
        assert_eq!(read(&volume(0.0, 1000.0)).tf, preset.tf);
    }

    #[test]
    fn results_keep_our_files_to_the_byte_and_others_as_ours() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let text = r#" {"points": [{"value": 1, "opacity": 0.5}] } "#;
        std::fs::write(&path, text).unwrap();
        assert_eq!(own_text(&path).unwrap(), text);
        std::fs::write(&path, r#"{"Points": [0, 0, 0.5, 0, 7, 1, 0.5, 0]}"#).unwrap();
        let ours = TransferFunction::from_json(&own_text(&path).unwrap()).unwrap();
        assert_eq!(ours, formats::read(&path).unwrap().tf);
        assert!(own_text(&dir.path().join("gone.vp")).is_err());
    }

    #[test]
    fn presets_alone_scale_with_the_size_and_an_asked_scale_wins() {
        let bone = PRESETS[1].transfer_function();
        let hu = |mm| volume_of(-1024.0, 3071.0, mm);
        for mm in [0.3, 0.5, 1.0, 3.0, 100.0] {
            assert_eq!(resolve("bone", &hu(mm)).unwrap().tf, bone, "{mm} mm");
        }
        for (mm, factor) in [(0.1, 1630.0), (0.01, 16_300.0), (1000.0, 0.163)] {
            let r = resolve("bone", &hu(mm)).unwrap();
            let ratio = r.tf.extinction(800.0) / bone.extinction(800.0);
            assert!((ratio / factor - 1.0).abs() < 1e-12, "{mm}: {ratio}");
            assert!(r.notes.iter().any(|n| n.contains("--opacity-scale 1")), "{:?}", r.notes);
            assert_eq!(r.suiting.opacity_scale, Some(factor));
            for requested in [1.0, 0.5] {
                let requested = Suiting { opacity_scale: Some(requested), ..Suiting::default() };
                let r = resolve_as("bone", &hu(mm), requested).unwrap();
                let ratio = r.tf.extinction(800.0) / bone.extinction(800.0);
                assert!((ratio - requested.opacity_scale.unwrap()).abs() < 1e-12 && r.notes.len() == 1);
            }
        }
    }

    #[test]
    fn an_unknown_name_lists_the_presets() {
        let e = find("boen").unwrap_err();
        assert!(e.place.contains("boen") && e.hint.unwrap().contains("bone"));
        assert_eq!(e.fault, crate::error::Fault::Input);
        for name in ["missing.json", "missing.vp", "missing.ITF"] {
            assert!(find(name).unwrap_err().why.contains("No such file"), "{name}");
        }
    }

    #[test]
    fn the_default_suits_the_values() {
        for (lo, hi, expected) in [(0.0, 1.0, "engine"), (-1000.0, 1000.0, "ct"), (0.0, 563.2, "engine")] {
            assert_eq!(default_name(&volume(lo, hi)), expected);
            assert!(find(expected).is_ok());
        }
        assert_eq!(default_as(&volume(0.0, 563.2), Some(Units::Hu)), ("bone", None));
        let (name, why) = default_as(&volume(0.0, 563.2), None);
        assert!(name == "engine" && why.unwrap().contains("--units hu"));
    }
}
