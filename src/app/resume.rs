//! Going on after the graphics device was lost (a driver that was reset or updated, a card that was taken away): what was
//! open is handed from one window to the next, on a new device; volumes are not read again.

use super::document::Document;
use super::panels::difference::Difference;
use super::settings::Settings;
use super::split::Split;
use crate::error::{Error, Result};
use std::path::PathBuf;

/// What was open when a device was lost.
pub struct Resume {
    /// The driver's reason.
    pub why: String,
    /// The window's.
    pub settings: Settings,
    /// The document, how the view was divided, and whether errors were shown.
    pub open: Option<(Document, Split, Difference)>,
}

impl Resume {
    /// The scene file that is kept where no new device can be had.
    pub fn kept_scene() -> Option<PathBuf> {
        Settings::path().map(|path| path.with_file_name("lost.toml"))
    }

    /// Where no new device can be had: keeps the scene file in `path` and says so.
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
            // Where it cannot be made, writing says so.
            let _ = std::fs::create_dir_all(folder);
        }
        Some(document.write_scene(&path).map(|()| path))
    }
}
