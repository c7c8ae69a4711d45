//! Opaque things in a scene as a user names them: files, each with a colour.

use crate::error::Result;
use crate::files::color;
use crate::mesh::{self, Mesh};
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A mesh file and its colour: `FILE[,color=#rrggbb]`.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// Where it is.
    pub path: PathBuf,
    /// Linear RGB.
    pub color: [f64; 3],
}

impl Serialize for MeshFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{},color={}", self.path.display(), color::to_hex(self.color)))
    }
}

/// `FILE[,color=#rrggbb]` (sRGB).
pub fn mesh_file(text: &str) -> Result<MeshFile, String> {
    let (path, color) = match text.rsplit_once(",color=") {
        Some((path, hex)) => (path, color::parse_hex(hex.trim())?),
        None => (text, color::parse_hex(Mesh::DEFAULT_COLOR)?),
    };
    match path.is_empty() {
        true => Err("expected FILE[,color=#rrggbb]".into()),
        false => Ok(MeshFile { path: path.into(), color }),
    }
}

/// The opaque things of some files, where there are any.
///
/// # Errors
/// A file that cannot be read, or is no mesh.
pub(super) fn read(files: Option<&[MeshFile]>) -> Result<Option<Arc<Mesh>>> {
    let files = files.unwrap_or_default();
    if files.is_empty() {
        return Ok(None);
    }
    let read = mesh::read(files.iter().map(|file| (file.path.as_path(), file.color)));
    Ok(Some(Arc::new(read.map_err(|e| e.at("--mesh"))?)))
}

/// The files of a mesh, the other way than [`read`].
pub(super) fn files_of(mesh: Option<&Mesh>) -> Option<Vec<MeshFile>> {
    let file = |(source, color): (&str, [f64; 3])| MeshFile { path: Path::new(source).into(), color };
    Some(mesh?.parts().map(file).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_with_their_colours() {
        let files = ["a b.stl", "c,d.ply,color=#ff8000"].map(|text| mesh_file(text).unwrap());
        assert_eq!(files[0].path, Path::new("a b.stl"));
        assert_eq!((files[1].path.as_path(), files[1].color[0]), (Path::new("c,d.ply"), 1.0));
        let text = serde_json::to_string(&files[1]).unwrap();
        assert_eq!(text, "\"c,d.ply,color=#ff8000\"");
        assert!(mesh_file("a.stl,color=red").unwrap_err().contains("#rrggbb"));
        assert!(mesh_file(",color=#ffffff").is_err());
        let error = read(Some(&[mesh_file("no such file.stl").unwrap()])).unwrap_err();
        assert!(error.exit_status() == 2 && error.place.contains("--mesh"), "{error}");
    }
}
