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
