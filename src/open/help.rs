//! Long helps that are made from what they list.

use super::presets::PRESETS;
use crate::shadow::METHODS;

/// The long help of `--tf`: the presets.
pub(super) fn tf_help() -> String {
    let mut help = String::from(
        "Transfer function: a preset, or the path of a file: this program's .json, ParaView's .json, 3D Slicer's .vp and \
         .vp.json, MRIcroGL's and NiiVue's .json, Inviwo's .itf\n\
         [default: ct for a volume in HU with air, bone in HU without, hair for strands, engine otherwise]\n\n\
         A file is used as it is, unless its units are `fraction`. A preset in HU is used as it is on a volume in HU \
         (`umbravox info` says which and why, --units decides); on any other, -1000 to 800 HU are laid over the value \
         range. What is in fractions is laid over the value range of every volume. `hair` takes values as extinction in \
         1/mm. Presets are denser or thinner in volumes far from the size of a body; --opacity-scale 1 undoes it.\n\n\
         Presets (`umbravox tf list`):",
    );
    for preset in PRESETS {
        help += &format!("\n  {:<12} {}", preset.name, preset.about);
    }
    help
}

/// The long help of `--shadow`: the methods, their keys and every default.
pub(super) fn shadow_help() -> String {
    let mut help =
        String::from("Shadow method and its settings, METHOD[:key=value,...] [default: dsm]\n\nMethods:");
    for method in METHODS {
        help += &format!("\n  {:<12} {}", method.name, method.summary);
        for key in method.keys {
            help += &format!("\n    {}={} [default: {}] {}", key.name, key.values(), key.default, key.help);
        }
    }
    help
}
