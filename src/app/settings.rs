//! Saved settings of the window.

use super::camera::Orbit;
use super::curve::AmountAxis;
use super::split;
use crate::files::output::write_whole;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Maximum number of recent volumes.
const MAX_RECENT: usize = 10;

/// Settings in a TOML file of the user's configuration folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Inner size of the window, points.
    pub window: [f32; 2],
    /// Dark theme.
    pub dark: bool,
    /// Camera rotation of a drag.
    pub orbit: Orbit,
    /// The editor's vertical axis.
    pub amount_axis: AmountAxis,
    /// Logarithmic counts of the histogram.
    pub log_histogram: bool,
    /// Histogram weighted by the gradient magnitude.
    pub gradient_histogram: bool,
    /// Slices beside the view.
    pub slices: bool,
    /// Anatomical letters.
    pub marks: bool,
    /// The orientation cube.
    pub cube: bool,
    /// Frequency of the flicker, changes per second.
    pub flicker_hz: f64,
    /// Recent volumes, the latest first.
    pub recent: Vec<String>,
    /// Folder of the last file, with a separator at the end.
    pub folder: String,
    /// Last scene, as a scene file.
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
    /// Path of the settings file.
    pub fn path() -> Option<PathBuf> {
        dirs::config_dir().map(|folder| folder.join("umbravox").join("window.toml"))
    }

    /// Reads the settings; the defaults where there are none or they are invalid.
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

    /// Writes the settings; a failure is only logged.
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

    /// Adds a volume to the recent ones.
    pub fn opened(&mut self, source: &str) {
        self.recent.retain(|r| r != source);
        self.recent.insert(0, source.to_owned());
        self.recent.truncate(MAX_RECENT);
    }
}
