//! Plots of error against time and memory, written as PNG, SVG and PDF.
//!
//! Each shadow method has one colour and one marker in every plot. They are distinct for colour-blind readers and, by
//! shape, in grey print.

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

/// Draws two plots of transmittance error against the time `build_ms + frame_ms`, side by side: rms error at visible
/// points (`point_err_rms`), and largest error along light rays (`ray_err_max`).
pub(super) fn error_time(rows: &[Row]) -> Drawing {
    figure(rows, Cost::Time)
}

/// Draws two plots of transmittance error against shadow-map memory, side by side: rms error at visible points
/// (`point_err_rms`), and largest error along light rays (`ray_err_max`). Shadow methods that store no shadow map are
/// not shown.
pub(super) fn error_bytes(rows: &[Row]) -> Drawing {
    figure(rows, Cost::Memory)
}

/// Writes the plots of error against time and against memory into an existing folder, each as PNG, SVG and PDF.
/// `stems` are the two file names without extension, and `texts` become text chunks of the PNG files. Returns the
/// paths.
///
/// # Errors
/// A file cannot be written.
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
