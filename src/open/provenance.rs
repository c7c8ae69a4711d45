//! Provenance of results: the record of a scene in a results folder, and the text entries of a picture file.

use super::presets::{self, PRESETS};
use super::scene_file::SCENE_KEY;
use super::{Loaded, SceneSettings};
use crate::error::Result;
use crate::files::hash::sha256;
use crate::measure::facts::REVISION;
use crate::measure::job::file_name_part;
use crate::report::run::SceneRecord;
use std::path::Path;

/// Settings of a scene, with the record that is written to a folder of results.
pub struct RecordedScene {
    /// Settings of the scene that the user gave, without defaults.
    pub settings: SceneSettings,
    /// Record of the scene for the results folder, in which all default settings are written out.
    pub record: SceneRecord,
    /// Text of the file of the scene's transfer function; `None` for a preset.
    pub tf_text: Option<String>,
}

impl RecordedScene {
    /// Creates the record of a scene for a results folder from the scene's settings and loaded data. `several` says
    /// that the folder holds more than one scene.
    ///
    /// # Errors
    /// The volume's file cannot be read for its SHA-256, or the settings do not fit a scene file.
    pub fn of(
        settings: SceneSettings,
        loaded: &Loaded,
        tf_text: Option<String>,
        name: &str,
        several: bool,
    ) -> Result<Self> {
        let volume_sha256 = settings.spec().sha256()?;
        let prefix = if several { format!("{}_", file_name_part(name)) } else { String::new() };
        let tf_file = tf_text.as_ref().map_or(String::new(), |_| format!("{prefix}transfer_function.json"));
        let tf = if tf_file.is_empty() { loaded.tf_source.clone() } else { tf_file.clone() };
        let scene = loaded.scene_of(&settings)?;
        let mut resolved = settings.resolved(&scene, &tf, loaded.suiting);
        resolved.name = Some(name.to_owned());
        resolved.sha256 = volume_sha256.clone();
        let record = SceneRecord {
            name: name.to_owned(),
            file: String::new(),
            settings: resolved.to_toml()?,
            volume_sha256,
            tf: loaded.tf_source.clone(),
            tf_file,
            tf_sha256: sha256(loaded.tf.to_json().as_bytes()),
            size: [scene.width, scene.height],
            light: None,
        };
        Ok(Self { settings, record, tf_text })
    }
}

/// Returns the text of the file of a loaded scene's transfer function; `None` for a preset.
///
/// # Errors
/// The file cannot be read.
pub fn function_text(loaded: &Loaded) -> Result<Option<String>> {
    let is_preset = PRESETS.iter().any(|p| p.name == loaded.tf_source);
    if is_preset { Ok(None) } else { presets::own_text(Path::new(&loaded.tf_source)).map(Some) }
}

/// Keys and texts stored in a picture file: program version, graphics adapter, and the scene file that draws the
/// picture again.
///
/// # Errors
/// See [`SceneSettings::to_toml`].
pub fn picture_texts(adapter: &str, scene: Option<&SceneSettings>) -> Result<Vec<(String, String)>> {
    let program = format!("umbravox {}, revision {REVISION}", env!("CARGO_PKG_VERSION"));
    let scene = scene.map(SceneSettings::to_toml).transpose()?;
    let texts =
        [("Software", Some(program)), ("umbravox:adapter", Some(adapter.to_owned())), (SCENE_KEY, scene)];
    Ok(texts.into_iter().filter_map(|(key, text)| Some((key.to_owned(), text?))).collect())
}
