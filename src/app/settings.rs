//! What the window remembers from one run to the next.

use super::camera::Orbit;
use super::curve::AmountAxis;
use super::split;
use crate::files::output::write_whole;
use serde::{Deserialize, Serialize};
use std::env;
use std::path::PathBuf;

/// Volumes in the menu of recent ones.
const MOST_RECENT: usize = 10;

/// Kept in a TOML file of the user's settings folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Inner size of the window, points.
    pub window: [f32; 2],
    /// Light on dark.
    pub dark: bool,
    /// How dragging turns the camera.
    pub orbit: Orbit,
    /// The editor's vertical axis.
    pub amount_axis: AmountAxis,
    /// Counts on a logarithmic scale.
    pub log_histogram: bool,
    /// Voxels weigh as much as the value changes there.
    pub gradient_histogram: bool,
    /// Slices beside the view.
    pub slices: bool,
    /// Anatomical letters.
    pub marks: bool,
    /// The orientation cube.
    pub cube: bool,
    /// Changes a second of the flicker.
    pub flicker_hz: f64,
    /// Sources of volumes, the latest first.
    pub recent: Vec<String>,
    /// The folder of the file that was named last, with its separator at the end.
    pub folder: String,
    /// The scene that was open, as the text of a scene file.
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
    /// The file, where the system says where such files go.
    pub fn path() -> Option<PathBuf> {
        let var = |name: &str| env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        let folder = if cfg!(windows) {
            var("APPDATA")
        } else if cfg!(target_os = "macos") {
            var("HOME").map(|h| h.join("Library/Application Support"))
        } else {
            var("XDG_CONFIG_HOME").or_else(|| var("HOME").map(|h| h.join(".config")))
        };
        folder.map(|f| f.join("umbravox").join("window.toml"))
    }

    /// What was kept; the defaults where nothing was, or what was is not understood.
    pub fn read() -> Self {
        let text = Self::path().and_then(|path| std::fs::read_to_string(path).ok());
        let mut settings: Self = text.and_then(|t| toml::from_str(&t).ok()).unwrap_or_default();
        settings.window = settings.window.map(|s| if s.is_finite() { s.clamp(480.0, 8192.0) } else { 900.0 });
        if !split::RATES_HZ.contains(&settings.flicker_hz) {
            settings.flicker_hz = split::DEFAULT_RATE_HZ;
        }
        settings.recent.truncate(MOST_RECENT);
        settings
    }

    /// Keeps them; a folder that cannot be written is no reason to disturb anyone.
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

    /// Puts a volume on top of the recent ones.
    pub fn opened(&mut self, source: &str) {
        self.recent.retain(|r| r != source);
        self.recent.insert(0, source.to_owned());
        self.recent.truncate(MOST_RECENT);
    }
}
