//! `umbravox compare`, run as a user runs it, on tiny phantoms; and its measurements, with planted delays and errors.

mod ablate;
mod budget;
mod cancel;
mod flicker;
mod folder;
mod lights;
mod planted;
mod resume;
mod shards;
mod strands;
mod table;

use crate::common;
use crate::program::{Printed, succeed};
use std::collections::HashMap;
use std::path::Path;
use umbravox::measure::table::COLUMNS;

/// Transfer function (JSON) whose extinction rises slowly with the value.
pub const TF: &str =
    r#"{"name": "haze", "points": [{"value": 200, "extinction": 0}, {"value": 1000, "extinction": 0.1}]}"#;

/// Runs a command in `folder` and returns stdout.
fn run(folder: &Path, args: &[&str]) -> String {
    std::fs::write(folder.join("tf.json"), TF).unwrap();
    let Printed { stdout, stderr } = succeed(folder, args);
    assert!(stderr.contains("compare.csv") && !stderr.contains("failed"), "{stderr}");
    stdout
}

fn read_csv(path: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let names: Vec<_> = COLUMNS.iter().map(|c| c.name).collect();
    assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), names);
    reader.deserialize().map(|row| row.unwrap()).collect()
}
