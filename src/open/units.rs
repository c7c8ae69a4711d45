//! Decides whether a volume's values are Hounsfield units (HU), and gives the reason.
//!
//! The file's metadata decide first, then the distribution of the values. The stored number type is ignored, except
//! for rescaled 8-bit values.

use crate::strands::STRANDS_FORMAT;
use crate::transfer::TransferFunction;
use crate::volume::{Element, IndexBox, ValueMeaning, Volume, Voxel};
use crate::with_voxels;
use serde::Serialize;

/// Interpretation of a volume's values that the user can request with `--units`: HU, or fractions of their range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "a comment would be a line of `--help`")]
pub enum Units {
    Hu,
    Fraction,
}

/// Kind of a volume's values: Hounsfield units, extinction, or anything else.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum ValueKind {
    /// Values of the volume are Hounsfield units.
    #[serde(rename = "HU")]
    Hounsfield,
    /// Values of the volume are extinction in 1/mm, as made from strands.
    #[serde(rename = "1/mm")]
    Extinction,
    /// Values of the volume have an unknown unit; only their position in the volume's value range has a meaning.
    #[serde(rename = "fraction")]
    Other,
}

impl ValueKind {
    /// Name of the kind of a volume's values (HU, 1/mm or neither) in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hounsfield => "HU",
            Self::Extinction => "1/mm",
            Self::Other => "not HU",
        }
    }
}

/// Interpretation of a volume's values as HU, extinction or neither, with the reason for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Meaning {
    /// Kind of the volume's values: HU, extinction or neither.
    pub kind: ValueKind,
    /// Reason for the interpretation of the volume's values, in a few words.
    pub why: String,
    /// Whether the kind of the values was guessed from the volume's values alone.
    pub is_guess: bool,
    /// Whether the volume has values of air: some below -500 HU. No tissue except lung has such values.
    pub has_air: bool,
}

/// HU of air, and half the width of the interval around it in which values count as air.
const AIR_HU: f64 = -1000.0;
const AIR_WIDTH: f64 = 100.0;
/// Criteria by which a volume's values are taken as HU: smallest share of voxels that are air, and smallest ratio of
/// the histogram's density at air to its mean density.
const AIR_SHARE: f64 = 0.01;
const AIR_DENSITY: f64 = 3.0;
/// HU below which a voxel counts as air; no tissue except lung has lower values.
const AIR_BELOW_HU: f64 = -500.0;
/// Width of a volume's value range up to which its values are taken as 8-bit or normalised data instead of HU.
const MIN_HU_WIDTH: f64 = 300.0;
/// Range of possible HU in a volume: the 16-bit values of a scanner.
const PLAUSIBLE_HU: [f64; 2] = [-32768.0, 32767.0];
/// Lowest value, HU, that CT scanners use for padding outside the scanned region.
const PADDING_HU: f64 = -3100.0;
/// Range of HU of water, fat, muscle and blood, and the smallest share of voxels in this range that identifies a CT
/// scan without air around the body.
const SOFT_HU: [f64; 2] = [-150.0, 250.0];
const SOFT_SHARE: f64 = 0.3;
/// Limits, HU, of the range to which a CT file may rescale 8-bit values.
const WINDOW_HU: [f64; 2] = [-1100.0, 4100.0];
/// Largest number of voxels that are examined to guess the units of a volume's values.
const MOST_LOOKED_AT: usize = 1 << 20;

/// Whether a volume was made from strands, so that its values are extinction in 1/mm.
pub fn of_strands(volume: &Volume) -> bool {
    volume.provenance.format == STRANDS_FORMAT
}

impl Meaning {
    /// Decides what a volume's values mean (HU, extinction or neither); the user's choice wins.
    pub fn of(volume: &Volume, requested: Option<Units>) -> Self {
        let [low, high] = volume.value_range();
        let has_air = low < AIR_BELOW_HU;
        let known = |kind, why: &str| Self { kind, why: why.into(), is_guess: false, has_air };
        match requested {
            Some(Units::Hu) => return known(ValueKind::Hounsfield, "--units hu"),
            Some(Units::Fraction) => return known(ValueKind::Other, "--units fraction"),
            None => {}
        }
        if of_strands(volume) {
            return known(ValueKind::Extinction, "made from strands");
        }
        match &volume.provenance.values {
            ValueMeaning::Hounsfield(by) => return known(ValueKind::Hounsfield, by),
            ValueMeaning::Other(by) => return known(ValueKind::Other, by),
            ValueMeaning::Unknown => {}
        }
        let [low_text, high_text] = [low, high].map(|v| (v * 1e2).round() / 1e2);
        let range = format!("values from {low_text} to {high_text}");
        let (kind, why) = if high - low <= MIN_HU_WIDTH {
            (ValueKind::Other, format!("{range} span too little"))
        } else if low < PLAUSIBLE_HU[0] || high > PLAUSIBLE_HU[1] {
            (ValueKind::Other, format!("{range} go beyond HU"))
        } else {
            let ValueSummary { air, soft, .. } = ValueSummary::of(volume);
            let percent = |share: f64| (100.0 * share).round();
            let is_dense = air * (high - low) >= AIR_DENSITY * 2.0 * AIR_WIDTH * near_air(low, high);
            let scaled_bytes = volume.element() == Element::U8 && volume.scaling().slope != 1.0;
            if air >= AIR_SHARE && is_dense {
                (ValueKind::Hounsfield, format!("{} % of the voxels are air, about {AIR_HU}", percent(air)))
            } else if has_air && low >= PADDING_HU && soft >= SOFT_SHARE {
                let ([from, to], percent) = (SOFT_HU, percent(soft));
                let why = format!(
                    "{percent} % of the voxels are from {from} to {to}, as soft tissue is, and there are gases"
                );
                (ValueKind::Hounsfield, why)
            } else if scaled_bytes && (WINDOW_HU[0]..=0.0).contains(&low) && high <= WINDOW_HU[1] {
                let why = format!("the file scales its 8 bits to {low_text} to {high_text}, a window of HU");
                (ValueKind::Hounsfield, why)
            } else {
                (ValueKind::Other, format!("{range} have no air about {AIR_HU}"))
            }
        };
        Self { kind, why, is_guess: true, has_air }
    }

    /// Whether the volume's values are Hounsfield units.
    pub fn is_hounsfield(&self) -> bool {
        self.kind == ValueKind::Hounsfield
    }

    /// Describes the kind of the volume's values and the reason in one line. If the kind is a guess, the text adds
    /// the flag that overrides it.
    pub fn text(&self) -> String {
        let other = if self.is_hounsfield() { "fraction" } else { "hu" };
        let way = if self.is_guess { format!("; --units {other} says otherwise") } else { String::new() };
        format!("{} ({}{way})", self.kind.name(), self.why)
    }
}

/// Smallest share of voxels with exactly the volume's lowest value that suggests a background.
const BACKGROUND_SHARE: f64 = 0.3;

/// Returns a note for the user if a transfer function makes the probable background of a volume visible: its lowest
/// value, which very many voxels have. `name` is the name of the transfer function in the note.
pub fn background_note(volume: &Volume, tf: &TransferFunction, name: &str) -> Option<String> {
    let [low, high] = volume.value_range();
    // Most transfer functions hide the lowest value, so that the voxels are rarely counted.
    let is_visible = high > low && tf.extinction(low) > 0.0;
    let share = is_visible.then(|| ValueSummary::of(volume).lowest).filter(|s| *s >= BACKGROUND_SHARE)?;
    Some(format!(
        "{:.0} % of the voxels are {low}, the lowest value, and {name} makes it visible; if it is the background, \
         choose another --tf, or --units",
        100.0 * share
    ))
}

/// Shares of air, of soft tissue and of the lowest value among the examined voxels of a volume.
struct ValueSummary {
    air: f64,
    soft: f64,
    /// Share of voxels that have exactly the lowest value of the volume.
    lowest: f64,
}

impl ValueSummary {
    /// Computes the shares of air and soft tissue from voxels that are evenly spread over the volume.
    fn of(volume: &Volume) -> Self {
        let scaling = volume.scaling();
        let lowest_value = volume.value_range()[0];
        let [mut air, mut soft, mut lowest] = [0usize; 3];
        let mut looked_at = 0usize;
        let mut look_at = |stored: f64| {
            let value = scaling.apply(stored);
            looked_at += 1;
            lowest += usize::from(value == lowest_value);
            air += usize::from((value - AIR_HU).abs() <= AIR_WIDTH);
            // A background of exactly 0 is no tissue.
            soft += usize::from(value != 0.0 && (SOFT_HU[0]..=SOFT_HU[1]).contains(&value));
        };
        for part in examined_boxes(volume) {
            let block = volume.block_or_zeros(&part);
            with_voxels!(block.voxels(), array => {
                let values = array.as_slice().unwrap_or_default();
                let stride = values.len().div_ceil(MOST_LOOKED_AT).max(1);
                // One voxel of each group, at varying positions: a constant stride could follow the rows.
                let groups = values.chunks(stride).enumerate();
                groups.for_each(|(i, group)| look_at(group[i.wrapping_mul(7919) % group.len()].to_f64()));
            });
        }
        let share = |count: usize| count as f64 / looked_at.max(1) as f64;
        Self { air: share(air), soft: share(soft), lowest: share(lowest) }
    }
}

/// Number of slices that are examined of a volume that is read in parts.
const EXAMINED_SLICES: usize = 32;

/// Returns the boxes of voxels that are examined: the whole volume, or slices that are evenly spread over a volume that is
/// read in parts.
fn examined_boxes(volume: &Volume) -> Vec<IndexBox> {
    let [nx, ny, nz] = volume.dims();
    if volume.resident().is_some() {
        return vec![[0..nx, 0..ny, 0..nz]];
    }
    let step = nz.div_ceil(EXAMINED_SLICES);
    (step / 2..nz).step_by(step).map(|k| [0..nx, 0..ny, k..k + 1]).collect()
}

/// Fraction of the HU interval of air that lies within the volume's value range `[low, high]`.
fn near_air(low: f64, high: f64) -> f64 {
    let [a, b] = [(AIR_HU - AIR_WIDTH).max(low), (AIR_HU + AIR_WIDTH).min(high)];
    ((b - a) / (2.0 * AIR_WIDTH)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling, Voxels};
    use glam::DAffine3;
    use ndarray::Array3;

    /// Creates a test volume of 20 x 20 x 20 voxels; `value` gets each voxel's storage index divided by the number of
    /// voxels.
    fn volume(value: impl Fn(f64) -> f64) -> Volume {
        let values =
            Array3::from_shape_fn((20, 20, 20), |(k, j, i)| value(((k * 20 + j) * 20 + i) as f64 / 8000.0));
        scaled(Voxels::F64(values), Scaling::IDENTITY)
    }

    fn scaled(voxels: Voxels, scaling: Scaling) -> Volume {
        let provenance = Provenance::new("test", "raw", "test");
        Volume::new(voxels, scaling, DAffine3::IDENTITY, provenance).unwrap()
    }

    fn kind(volume: &Volume) -> ValueKind {
        Meaning::of(volume, None).kind
    }

    #[test]
    fn air_is_what_tells_hounsfield_units() {
        let noise = |s: f64| 30.0 * (s * 7919.0).fract();
        // Air, tissue and bone; such a scan padded with -2000; a body without air around it.
        let scan = |s: f64| if s < 0.4 { -1010.0 + noise(s) } else { 3000.0 * (s - 0.4).powi(2) };
        assert_eq!(kind(&volume(scan)), ValueKind::Hounsfield);
        assert_eq!(kind(&volume(|s| if s < 0.1 { -2000.0 } else { scan(s) })), ValueKind::Hounsfield);
        let inside =
            |s: f64| if s < 0.005 { -900.0 } else { -120.0 + 320.0 * s + if s > 0.95 { 900.0 } else { 0.0 } };
        assert_eq!(kind(&volume(inside)), ValueKind::Hounsfield);
        // 16-bit data that are not HU: fMRI, a micro-CT, 12 bits from 0, the phase of an MR image, evenly spread
        // numbers.
        let others: [&dyn Fn(f64) -> f64; 6] = [
            &|s| 762.0 + 4776.0 * s * s,
            &|s| 25_500.0 * s,
            &|s| if s < 0.5 { noise(s) } else { 1000.0 + 3000.0 * (s - 0.5) },
            &|s| -4096.0 + 8191.0 * s,
            &|s| -2000.0 + 4000.0 * s,
            &|s| 65_535.0 * s,
        ];
        for (i, other) in others.iter().enumerate() {
            let meaning = Meaning::of(&volume(other), None);
            assert!(meaning.kind == ValueKind::Other && meaning.is_guess, "{i}: {}", meaning.text());
        }
    }

    #[test]
    fn a_visible_background_gets_a_note() {
        use crate::transfer::presets::PRESETS;
        let preset = |name: &str| PRESETS.iter().find(|p| p.name == name).unwrap().transfer_function();
        // Vessels in a background of 0, as angiographies without bone have.
        let angiography = volume(|s| if s < 0.9 { 0.0 } else { 560.0 * s });
        let note = background_note(&angiography, &preset("ct"), "preset `ct`").unwrap();
        assert!(note.starts_with("90 % of the voxels are 0, ") && note.contains("preset `ct`"), "{note}");
        assert_eq!(background_note(&angiography, &preset("vessels"), ""), None, "0 is transparent");
        assert_eq!(background_note(&volume(|s| 560.0 * s), &preset("ct"), ""), None, "no value is frequent");
        assert_eq!(background_note(&volume(|_| 40.0), &preset("ct"), ""), None, "a constant volume");
    }

    #[test]
    fn bits_scaled_to_a_window_of_hounsfield_units_are_such() {
        let bytes = Voxels::U8(Array3::from_shape_fn((4, 4, 16), |(k, j, i)| (k * 64 + j * 16 + i) as u8));
        let window = Scaling { slope: 2.2086, intercept: 0.0 };
        assert_eq!(kind(&scaled(bytes.clone(), window)), ValueKind::Hounsfield);
        assert_eq!(kind(&scaled(bytes.clone(), Scaling::IDENTITY)), ValueKind::Other);
        let beyond = Scaling { slope: 100.0, intercept: 0.0 };
        assert_eq!(kind(&scaled(bytes, beyond)), ValueKind::Other);
    }

    #[test]
    fn what_is_asked_for_and_what_the_file_says_decide() {
        let mut volume = volume(|s| if s < 0.4 { -1000.0 } else { 1000.0 * s });
        volume.provenance.values = ValueMeaning::Other("MR".into());
        let meaning = Meaning::of(&volume, None);
        assert_eq!(
            (meaning.kind, meaning.is_guess, meaning.text()),
            (ValueKind::Other, false, "not HU (MR)".into())
        );
        assert_eq!(Meaning::of(&volume, Some(Units::Hu)).text(), "HU (--units hu)");
        volume.provenance.values = ValueMeaning::Hounsfield("DICOM modality CT".into());
        assert_eq!(Meaning::of(&volume, None).text(), "HU (DICOM modality CT)");
        assert_eq!(Meaning::of(&volume, Some(Units::Fraction)).kind, ValueKind::Other);
        volume.provenance.format = STRANDS_FORMAT.into();
        assert_eq!(kind(&volume), ValueKind::Extinction);
    }
}
