//! What tests and benches share.

use std::path::{Path, PathBuf};

/// The file of a real scan in `UMBRAVOX_DATA` or `../shared/data`, or `None` and a visible line.
pub fn scan(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("UMBRAVOX_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let path = folder.join(format!("{name}.nii.gz"));
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
    }
    path.exists().then_some(path)
}
