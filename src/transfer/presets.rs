//! Built-in transfer functions (presets).

use super::TransferFunction;

/// Meaning of the scalar values of a transfer-function preset, which decides how the preset is adapted to a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// The scalar values of the transfer-function preset are Hounsfield units. If a volume has other units, -1000 to
    /// 800 HU are mapped to its value range.
    Hounsfield,
    /// The scalar values of the transfer-function preset are fractions: 0 and 1 are mapped to the smallest and
    /// largest value of the volume.
    Fraction,
    /// The scalar values of the transfer-function preset are extinction in 1/mm, for voxelised strands. The preset's
    /// ramp ends at the volume's largest value.
    Extinction,
}

/// Built-in transfer function (preset).
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Name of the transfer-function preset on the command line.
    pub name: &'static str,
    /// Description of the transfer-function preset in one line.
    pub about: &'static str,
    /// Meaning of the preset's scalar values: Hounsfield units, fractions or extinction.
    pub scale: Scale,
    json: &'static str,
}

macro_rules! preset {
    ($name:literal, $scale:ident, $about:literal) => {
        Preset {
            name: $name,
            about: $about,
            scale: Scale::$scale,
            json: include_str!(concat!("../../transfer_functions/", $name, ".json")),
        }
    };
}

/// List of all built-in transfer functions (presets).
pub const PRESETS: &[Preset] = &[
    preset!("ct", Hounsfield, "bone in translucent soft tissue; the default for HU with air in it"),
    preset!("bone", Hounsfield, "bone, teeth, calcification from 150 HU; the default for HU without air"),
    preset!("soft-tissue", Hounsfield, "fat, muscle and organs, bone paler; -160 to 300 HU"),
    preset!("lung", Hounsfield, "lung tissue, airways and lung vessels; -980 to -250 HU"),
    preset!("vessels", Hounsfield, "vessels with contrast agent; 0 at 190 HU to 0.3 per mm at 310 HU"),
    preset!("skin", Hounsfield, "the outer surface of the body; from -500 HU"),
    preset!("fat", Hounsfield, "fat only; -200 to -20 HU"),
    preset!("metal", Hounsfield, "implants and fillings, bone faint; from 150 HU, opaque at 2500 HU"),
    preset!("engine", Fraction, "casting translucent, dense inserts opaque; the default otherwise"),
    preset!("uniform", Fraction, "the same extinction everywhere, 0.25 per cm"),
    preset!("isosurface", Fraction, "opaque from half the value range on: a jump"),
    preset!("hair", Extinction, "values are extinction, brown; the default for strands"),
];

impl Preset {
    /// Returns the preset's transfer function in its own units, not adapted to a volume.
    pub fn transfer_function(&self) -> TransferFunction {
        TransferFunction::from_json(self.json).expect("a test reads every preset")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn every_preset_reads_and_stops_light() {
        for preset in PRESETS {
            let tf = preset.transfer_function();
            assert!(tf.max_extinction(f64::NEG_INFINITY, f64::INFINITY) > 0.0, "{}", preset.name);
            let units = match preset.scale {
                Scale::Hounsfield => "HU",
                Scale::Fraction => "fraction",
                Scale::Extinction => "1/mm",
            };
            assert_eq!(tf.units, units, "{}", preset.name);
        }
    }

    #[test]
    fn every_file_of_the_folder_is_a_preset() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("transfer_functions");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|f| f.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
            .collect();
        let mut names: Vec<String> = PRESETS.iter().map(|p| p.name.into()).collect();
        files.sort();
        names.sort();
        assert_eq!(files, names);
    }
}
