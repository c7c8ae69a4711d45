//! The first bytes of what is to be read.

use super::source::Source;
use crate::files::loading::Loading;
use crate::volume::element::read_full;
use std::path::{Path, PathBuf};

/// As many bytes as tell formats apart.
const HEAD_BYTES: usize = 1024;

/// What a name stands for, as far as is needed to tell whose it is.
#[derive(Debug, Clone, Default)]
pub struct Head {
    path: PathBuf,
    bytes: Vec<u8>,
    is_folder: bool,
    is_packed: bool,
}

impl Head {
    /// Of a file, gzipped or not, or a folder; empty where nothing can be read.
    pub fn of(path: &Path) -> Self {
        let mut bytes = vec![0; HEAD_BYTES];
        let loading = Loading::default();
        let is_folder = path.is_dir();
        let source = if is_folder { None } else { Source::open(path, &loading).ok() };
        let is_packed = source.as_ref().is_some_and(|s| !matches!(s, Source::Plain { .. }));
        let got = source.and_then(|mut source| read_full(&mut source, &mut bytes).ok()).unwrap_or(0);
        bytes.truncate(got);
        Self { path: path.into(), bytes, is_folder, is_packed }
    }

    /// Its name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it is a folder.
    pub fn is_folder(&self) -> bool {
        self.is_folder
    }

    /// Whether it is gzipped.
    pub fn is_packed(&self) -> bool {
        self.is_packed
    }

    /// The first bytes, unpacked.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Whether it begins with these bytes.
    pub fn starts_with(&self, magic: &[u8]) -> bool {
        self.bytes.starts_with(magic)
    }

    /// Whether the name ends in one of these, letter case aside.
    pub fn is_named(&self, endings: &[&str]) -> bool {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        endings.iter().any(|e| name.strip_suffix(e).is_some_and(|stem| stem.ends_with('.')))
    }
}
