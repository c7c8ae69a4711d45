//! User settings of the viewer window, saved between sessions.

use super::camera::Orbit;
use super::curve::AmountAxis;
use super::split;
use crate::files::output::write_whole;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Maximum number of entries in the list of recently opened volumes.
const MAX_RECENT: usize = 10;

/// User settings of the viewer window, saved as a TOML file in the user's configuration folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Width and height of the viewer window without its frame, screen points.
    pub window: [f32; 2],
    /// Whether the window uses the dark theme.
    pub dark: bool,
    /// Mode of camera rotation by pointer drags: turntable or trackball.
    pub orbit: Orbit,
    /// Scale of the vertical axis of the transfer-function editor: linear or logarithmic.
    pub amount_axis: AmountAxis,
    /// Whether the histogram of the transfer-function editor shows the logarithm of its counts.
    pub log_histogram: bool,
    /// Whether the histogram of the transfer-function editor is weighted by the gradient magnitude.
    pub gradient_histogram: bool,
    /// Whether volume slices are shown beside the picture.
    pub slices: bool,
    /// Whether anatomical letters (L, R, A, P, S, I) are shown over the picture.
    pub marks: bool,
    /// Whether the orientation cube is shown over the picture.
    pub cube: bool,
    /// Frequency at which flicker alternates between the pictures of two shadow methods, changes per second.
    pub flicker_hz: f64,
    /// Paths or names of recently opened volumes, the latest first.
    pub recent: Vec<String>,
    /// Folder of the file that was opened or saved last, with a path separator at the end.
    pub folder: String,
    /// Last scene of the previous session, as the text of a scene file.
    pub last_scene: String,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            window: [1440.0, 900.0],
            dark: true,
            orbit: Orbit::Turntable,
            amount_axis: AmountAxis::Linear,
            log_histogram: true,
            gradient_histogram: false,
            slices: false,
            marks: true,
            cube: true,
            flicker_hz: split::DEFAULT_RATE_HZ,
            recent: Vec::new(),
            folder: String::new(),
            last_scene: String::new(),
        }
    }
}

impl Settings {
    /// Path of the file with the user settings of the viewer window; `None` if the system has no configuration
    /// folder.
    pub fn path() -> Option<PathBuf> {
        dirs::config_dir().map(|folder| folder.join("umbravox").join("window.toml"))
    }

    /// Reads the user settings of the viewer window from their file. Uses the defaults if the file is missing or
    /// invalid.
    pub fn read() -> Self {
        let text = Self::path().and_then(|path| std::fs::read_to_string(path).ok());
        let mut settings: Self = text.and_then(|t| toml::from_str(&t).ok()).unwrap_or_default();
        settings.window = settings.window.map(|s| if s.is_finite() { s.clamp(480.0, 8192.0) } else { 900.0 });
        if !split::RATES_HZ.contains(&settings.flicker_hz) {
            settings.flicker_hz = split::DEFAULT_RATE_HZ;
        }
        settings.recent.truncate(MAX_RECENT);
        settings
    }

    /// Writes the user settings of the viewer window to their file. A failure is only logged.
    pub fn write(&self) {
        let Some(path) = Self::path() else { return };
        let Ok(text) = toml::to_string(self) else { return };
        if let Some(folder) = path.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        if let Err(e) = write_whole(&path, |file| file.write_all(text.as_bytes())) {
            tracing::info!("{e}");
        }
    }

    /// Adds a volume to the top of the list of recently opened volumes.
    pub fn opened(&mut self, source: &str) {
        self.recent.retain(|r| r != source);
        self.recent.insert(0, source.to_owned());
        self.recent.truncate(MAX_RECENT);
    }
}
