//! Figures as PNG and SVG, both of one drawing.
//!
//! A method has one colour and one marker in every figure (told apart with any colour vision, and by shape in print).

pub(super) mod axis;
mod cost;
pub mod curve;
mod error;
mod front;
mod label;
mod page;
mod style;

use super::canvas::Drawing;
use crate::error::Result;
use crate::files::output::write_whole;
use crate::measure::table::Row;
use cost::Cost;
use error::figure;
use std::path::{Path, PathBuf};

/// `point_err_rms` and `ray_err_max` against `build_ms + frame_ms`, side by side.
pub(super) fn error_time(rows: &[Row]) -> Drawing {
    figure(rows, Cost::Time)
}

/// The same against `bytes`, of rows that store a structure.
pub(super) fn error_bytes(rows: &[Row]) -> Drawing {
    figure(rows, Cost::Memory)
}

/// Writes `STEM.png` and `STEM.svg` (error against time), `STEM_bytes.png` and `STEM_bytes.svg` into a folder that
/// exists, each whole or not at all; returns their paths.
///
/// # Errors
/// A file that cannot be written.
pub fn write_plots(rows: &[Row], folder: &Path, stem: &str) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for (drawing, stem) in
        [(error_time(rows), stem.to_string()), (error_bytes(rows), format!("{stem}_bytes"))]
    {
        for (extension, bytes) in
            [("png", drawing.png()?), ("svg", drawing.svg(None).into_string().into_bytes())]
        {
            let path = folder.join(format!("{stem}.{extension}"));
            write_whole(&path, |file| file.write_all(&bytes))?;
            paths.push(path);
        }
    }
    Ok(paths)
}
