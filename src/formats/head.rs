//! First bytes of an input, by which readers recognise their formats.

use super::source::Source;
use crate::files::loading::Loading;
use crate::volume::read::read_full;
use std::path::{Path, PathBuf};

/// Bytes that suffice to recognise a format.
const HEAD_BYTES: usize = 1024;

/// Path, kind and first bytes of an input.
#[derive(Debug, Clone, Default)]
pub struct Head {
    /// Path of the input.
    pub path: PathBuf,
    /// First bytes, decompressed.
    pub bytes: Vec<u8>,
    /// Whether the input is a folder.
    pub is_folder: bool,
    /// Whether the file is gzipped.
    pub is_gzipped: bool,
}

impl Head {
    /// Reads the head of a file, gzipped or not, or a folder; it is empty if nothing can be read.
    pub fn of(path: &Path) -> Self {
        let mut bytes = vec![0; HEAD_BYTES];
        let loading = Loading::default();
        let is_folder = path.is_dir();
        let source = if is_folder { None } else { Source::open(path, &loading).ok() };
        let is_gzipped = source.as_ref().is_some_and(Source::is_compressed);
        let got = source.and_then(|mut source| read_full(&mut source, &mut bytes).ok()).unwrap_or(0);
        bytes.truncate(got);
        Self { path: path.into(), bytes, is_folder, is_gzipped }
    }

    /// Whether the file begins with these bytes.
    pub fn starts_with(&self, magic: &[u8]) -> bool {
        self.bytes.starts_with(magic)
    }

    /// Whether the name has one of these extensions, in any letter case.
    pub fn is_named(&self, endings: &[&str]) -> bool {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        endings.iter().any(|e| name.strip_suffix(e).is_some_and(|stem| stem.ends_with('.')))
    }
}
