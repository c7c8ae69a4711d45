//! Computes SHA-256 checksums of input files, which are recorded with the results.

use crate::error::{Error, Result};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Number of bytes read at once when a file's checksum is computed.
const PIECE: usize = 1 << 20;

/// Returns the SHA-256 checksum of the concatenated contents of files, in hexadecimal.
///
/// # Errors
/// A file cannot be read.
pub fn sha256_of_files<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Result<String> {
    let mut hasher = Sha256::new();
    let mut piece = vec![0; PIECE];
    for path in paths {
        let failed = |e: std::io::Error| Error::input("cannot read file", path.display(), e);
        let mut file = File::open(path).map_err(failed)?;
        loop {
            match file.read(&mut piece).map_err(failed)? {
                0 => break,
                length => hasher.update(&piece[..length]),
            }
        }
    }
    Ok(hex(&hasher.finalize()))
}

/// Returns the SHA-256 checksum of bytes in memory, in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_matches_the_standard_however_the_input_is_cut() {
        // FIPS 180-4's example.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(b"abc"), expected);
        let dir = tempfile::tempdir().unwrap();
        let paths = [dir.path().join("a"), dir.path().join("b")];
        std::fs::write(&paths[0], "a").unwrap();
        std::fs::write(&paths[1], "bc").unwrap();
        assert_eq!(sha256_of_files(paths.iter().map(|p| p.as_path())).unwrap(), expected);
        assert_eq!(sha256_of_files([dir.path().join("gone").as_path()]).unwrap_err().exit_status(), 2);
    }
}
