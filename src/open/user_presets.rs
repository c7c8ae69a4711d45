//! Presets of the user: transfer-function files in a folder of the configuration, which are found by their names.

use crate::transfer::formats;
use crate::transfer::presets::PRESETS;
use itertools::Itertools as _;
use std::path::PathBuf;

/// Preset of the user: the name of a file without its extension, and its path.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct UserPreset {
    /// Name by which `--tf` finds the preset.
    pub name: String,
    /// Path of the transfer-function file.
    pub path: PathBuf,
}

/// Folder of the user's presets: `umbravox/presets` in the configuration folder, or `None` if the system has none.
pub fn folder() -> Option<PathBuf> {
    dirs::config_dir().map(|folder| folder.join("umbravox").join("presets"))
}

/// Returns the presets of the user by name. Files with the name of a built-in preset are left out.
pub fn user_presets() -> Vec<UserPreset> {
    let entries = folder().and_then(|folder| std::fs::read_dir(folder).ok());
    let paths = entries.into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let named = paths.filter(|path| formats::has_ending(path)).filter_map(|path| {
        let name = path.file_stem()?.to_str()?.to_owned();
        PRESETS.iter().all(|preset| preset.name != name).then_some(UserPreset { name, path })
    });
    named.sorted().dedup_by(|a, b| a.name == b.name).collect()
}

/// Returns the path of the user's preset of a name.
pub fn path_of(name: &str) -> Option<PathBuf> {
    user_presets().into_iter().find(|preset| preset.name == name).map(|preset| preset.path)
}

/// Returns the name of a built-in preset, or the path of a file. A preset of the user becomes the path of its file.
pub fn located(name_or_path: &str) -> String {
    let is_preset = PRESETS.iter().any(|preset| preset.name == name_or_path);
    let user_path = if is_preset { None } else { path_of(name_or_path) };
    user_path.map_or_else(|| name_or_path.to_owned(), |path| path.display().to_string())
}

/// Returns the names of all presets, built-in ones first, separated by commas.
pub fn names() -> String {
    let built_in = PRESETS.iter().map(|preset| preset.name.to_owned());
    built_in.chain(user_presets().into_iter().map(|preset| preset.name)).join(", ")
}
