//! The files that a header names.

use std::path::{Component, Path, PathBuf};

/// A file that a header names: beside the header or below its folder, nowhere else.
///
/// # Errors
/// A name that leads elsewhere.
pub(super) fn beside(header: &Path, name: &str) -> Result<PathBuf, String> {
    let path = Path::new(name);
    let inside = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    // What a header says must not make this program open just any file of the machine.
    if name.is_empty() || !inside || name.contains('\\') {
        return Err(format!(
            "its voxels are said to be in `{name}`, and a header may name files beside it alone"
        ));
    }
    Ok(header.parent().unwrap_or(Path::new("")).join(path))
}
