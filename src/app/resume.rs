//! Recovery from a device loss: the document moves to a new window and device without reading the volume again.

use super::document::Document;
use super::panels::difference::Difference;
use super::settings::Settings;
use super::split::Split;
use crate::error::Error;
use std::path::PathBuf;

/// Document and settings at a device loss.
pub struct Resume {
    /// Reason given by the driver.
    pub why: String,
    /// Settings of the window.
    pub settings: Settings,
    /// Document, split and heat map settings.
    pub open: Option<(Document, Split, Difference)>,
}

impl Resume {
    /// Scene file for the case that no device can be opened.
    pub fn recovery_path() -> Option<PathBuf> {
        Settings::path().map(|path| path.with_file_name("lost.toml"))
    }

    /// Writes the scene file to `path` where no device can be opened, and returns the error.
    pub fn give_up(&self, path: Option<PathBuf>) -> Error {
        let failed = Error::runtime("the graphics device was lost", "window", &self.why);
        let Some(((document, ..), path)) = self.open.as_ref().zip(path) else { return failed };
        if let Some(folder) = path.parent() {
            // The write reports a missing folder.
            let _ = std::fs::create_dir_all(folder);
        }
        failed.hint(match document.write_scene(&path) {
            Ok(()) => format!("the scene was kept: --scene {}", path.display()),
            Err(e) => format!("the scene could not be kept: {e}"),
        })
    }
}
