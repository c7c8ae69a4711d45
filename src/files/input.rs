//! Reads small text files, names the source of a volume, and detects the LPS coordinate-system mark of mesh and volume
//! files.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest size of a text file that is read, bytes; it also stops the reading of endless device files.
const MAX_TEXT_BYTES: u64 = 256 << 20;

/// Number of bytes at the beginning of a file that are searched for the coordinate-system mark `SPACE=LPS`.
const SPACE_WITHIN: usize = 4096;

/// Returns whether the beginning of a file contains `SPACE=LPS`, 3D Slicer's mark for coordinates with x to the left
/// and y to the back.
pub fn says_lps(beginning: &[u8]) -> bool {
    const MARK: &[u8] = b"SPACE=LPS";
    beginning[..beginning.len().min(SPACE_WITHIN)].windows(MARK.len()).any(|bytes| bytes == MARK)
}

/// Name that stands for standard input or standard output instead of a file.
const STANDARD_STREAM: &str = "-";

/// Whether a path stands for standard input or standard output.
pub fn is_standard_stream(path: &Path) -> bool {
    path == Path::new(STANDARD_STREAM)
}

/// Returns the name of a file or folder from its path, or from the source (path or name) of a volume. A slash at the
/// end of a folder, as tab completion writes it, is ignored.
pub fn source_name(source: &str) -> &str {
    const SEPARATORS: [char; 2] = ['/', '\\'];
    source
        .trim_end_matches(SEPARATORS)
        .rsplit(SEPARATORS)
        .next()
        .filter(|name| !name.is_empty())
        .unwrap_or(source)
}

/// Reads a UTF-8 text file, or standard input for `-`; `what` is the beginning of the error message, e.g. `cannot read
/// scene file`.
///
/// # Errors
/// The file cannot be read, is not UTF-8 or is larger than 256 MiB.
pub fn read_text(path: &Path, what: &str) -> Result<String> {
    let refuse = |why: String| Error::input(what, path.display(), why);
    let source: Box<dyn Read> = match is_standard_stream(path) {
        true => Box::new(std::io::stdin()),
        false => Box::new(File::open(path).map_err(|e| refuse(e.to_string()))?),
    };
    let mut bytes = Vec::new();
    source.take(MAX_TEXT_BYTES + 1).read_to_end(&mut bytes).map_err(|e| refuse(e.to_string()))?;
    if bytes.len() as u64 > MAX_TEXT_BYTES {
        return Err(refuse("it is larger than 256 MiB".into()));
    }
    String::from_utf8(bytes).map_err(|e| refuse(format!("it is not UTF-8 text: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_keeps_its_name_with_a_slash_at_its_end() {
        for (source, name) in [
            ("bigdcm/", "bigdcm"),
            ("a/b.nii.gz", "b.nii.gz"),
            ("C:\\scans\\head\\", "head"),
            ("scans//", "scans"),
            ("phantom:thorax", "phantom:thorax"),
            ("/", "/"),
        ] {
            assert_eq!(source_name(source), name, "{source}");
        }
    }
}
