//! Recovery from a device loss: the document moves to a new window and device without reading the volume again.

use super::document::Document;
use super::panels::difference::Difference;
use super::settings::Settings;
use super::split::Split;
use crate::error::{Error, Result};
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
    pub fn kept_scene() -> Option<PathBuf> {
        Settings::path().map(|path| path.with_file_name("lost.toml"))
    }

    /// Writes the scene file to `path` where no device can be opened, and returns the error.
    pub fn give_up(&self, path: Option<PathBuf>) -> Error {
        let failed = Error::runtime("the graphics device was lost", "window", &self.why);
        match self.keep(path) {
            Some(Ok(path)) => failed.hint(format!("the scene was kept: --scene {}", path.display())),
            Some(Err(e)) => failed.hint(format!("the scene could not be kept: {e}")),
            None => failed,
        }
    }

    fn keep(&self, path: Option<PathBuf>) -> Option<Result<PathBuf>> {
        let ((document, ..), path) = (self.open.as_ref()?, path?);
        if let Some(folder) = path.parent() {
            // The write reports a missing folder.
            let _ = std::fs::create_dir_all(folder);
        }
        Some(document.write_scene(&path).map(|()| path))
    }
}
