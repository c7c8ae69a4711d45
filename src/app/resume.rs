//! Recovery from the loss of the graphics device: the open volume and its settings move to a new window and device.
//! The volume is not read again.

use super::document::Document;
use super::panels::difference::Difference;
use super::settings::Settings;
use super::split::Split;
use crate::error::Error;
use std::path::PathBuf;

/// Open volume and window settings, kept when the graphics device was lost.
pub struct Resume {
    /// Reason for the loss of the graphics device, as the driver reports it.
    pub why: String,
    /// User settings of the viewer window when the graphics device was lost.
    pub settings: Settings,
    /// Open volume with its settings, those of the split view and those of the error heat maps; `None` if no volume
    /// was open.
    pub open: Option<(Document, Split, Difference)>,
}

impl Resume {
    /// Path of the scene file that saves the open volume's settings if no graphics device can be opened after a
    /// device loss.
    pub fn recovery_path() -> Option<PathBuf> {
        Settings::path().map(|path| path.with_file_name("lost.toml"))
    }

    /// Saves the open volume's name and settings as a scene file at `path`, because no graphics device can be opened.
    /// Returns the error to report.
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
