//! Figures as PNG, SVG and PDF, all of one drawing.
//!
//! A method has one colour and one marker in every figure (distinct with any colour vision, and by shape in print).

pub(super) mod axis;
mod cost;
pub mod curve;
mod error;
mod front;
mod label;
pub(super) mod page;
mod style;

use super::canvas::Drawing;
use super::names::PLOT_ENDINGS;
use super::writers::write_files;
use crate::error::Result;
use crate::files::picture::with_texts;
use crate::measure::table::Row;
use cost::Cost;
use error::figure;
pub(super) use page::shorten;
use std::path::{Path, PathBuf};

/// `point_err_rms` and `ray_err_max` against `build_ms + frame_ms`, side by side.
pub(super) fn error_time(rows: &[Row]) -> Drawing {
    figure(rows, Cost::Time)
}

/// `point_err_rms` and `ray_err_max` against `bytes`, side by side, for rows that store a structure.
pub(super) fn error_bytes(rows: &[Row]) -> Drawing {
    figure(rows, Cost::Memory)
}

/// Writes the plots of error against time and against bytes under two stems, each as PNG with texts by their keys, SVG
/// and PDF, into a folder that exists, each whole or not at all; returns their paths.
///
/// # Errors
/// A file that cannot be written.
pub fn write_plots(
    rows: &[Row],
    folder: &Path,
    stems: &[String; 2],
    texts: &[(String, String)],
) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for (drawing, stem) in [error_time(rows), error_bytes(rows)].into_iter().zip(stems) {
        for ending in PLOT_ENDINGS {
            let bytes = match ending {
                "png" => with_texts(drawing.png()?, texts)?,
                "svg" => drawing.svg(None).into_string().into_bytes(),
                _ => drawing.pdf()?,
            };
            files.push((format!("{stem}.{ending}"), bytes));
        }
    }
    write_files(folder, files)
}
