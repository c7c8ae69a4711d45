//! The README says what the program does.

use umbravox::transfer::presets::{PRESETS, Scale};

const README: &str = include_str!("../README.md");

#[test]
fn the_preset_table_is_the_programs() {
    for preset in PRESETS {
        let units = match preset.scale {
            Scale::Hounsfield => "HU",
            Scale::Fraction => "fraction",
            Scale::Extinction => "1/mm",
        };
        let row = format!("| `{}` | {units} | {} |", preset.name, preset.about);
        assert!(README.contains(&row), "missing: {row}");
    }
}

#[test]
fn the_transfer_function_shown_can_be_read() {
    let block =
        README.split("```json").nth(1).and_then(|rest| rest.split("```").next()).expect("a JSON block");
    umbravox::transfer::TransferFunction::from_json(block).expect("it is valid");
}

#[test]
fn the_method_table_has_every_method_and_key() {
    for method in umbravox::shadow::METHODS {
        let row = README.lines().find(|l| l.starts_with(&format!("| `{}` |", method.name)));
        let row = row.unwrap_or_else(|| panic!("{} is missing", method.name));
        for key in method.keys {
            let named = [format!("`{}`", key.name), format!("`{}=", key.name)];
            assert!(named.iter().any(|n| row.contains(n)), "{}: {} is missing", method.name, key.name);
        }
    }
}
