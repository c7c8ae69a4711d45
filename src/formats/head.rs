//! First bytes of an input file, from which readers recognise their volume formats.

use super::source::Source;
use crate::files::loading::Loading;
use crate::volume::read::read_full;
use std::path::{Path, PathBuf};

/// Number of bytes that suffice to recognise the format of a volume file.
const HEAD_BYTES: usize = 1024;

/// First bytes of a volume file with its path, for the recognition of its format.
#[derive(Debug, Clone, Default)]
pub struct Head {
    /// Path of the input file or folder.
    pub path: PathBuf,
    /// First bytes of the input file, decompressed if it is gzipped.
    pub bytes: Vec<u8>,
    /// Whether the input path is a folder.
    pub is_folder: bool,
    /// Whether the input file is gzipped.
    pub is_gzipped: bool,
}

impl Head {
    /// Reads the first bytes of an input file, gzipped or not. Returns no bytes for a folder or an unreadable file.
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

    /// Whether the input file begins with the magic bytes `magic`.
    pub fn starts_with(&self, magic: &[u8]) -> bool {
        self.bytes.starts_with(magic)
    }

    /// Whether the name of the input file has one of the extensions `endings`, in any letter case.
    pub fn is_named(&self, endings: &[&str]) -> bool {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        endings.iter().any(|e| name.strip_suffix(e).is_some_and(|stem| stem.ends_with('.')))
    }
}
