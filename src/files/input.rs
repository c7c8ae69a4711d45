//! Reading small text files, and what files of several formats say in the same words.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// No transfer function, scene or list of rays is larger; an endless device file ends here.
const MAX_TEXT_BYTES: u64 = 256 << 20;

/// Where a file of places would say which way its axes go.
const SPACE_WITHIN: usize = 4096;

/// Whether a file that begins so says `SPACE=LPS`, as 3D Slicer writes it: x goes to the left, y to the back.
pub fn says_lps(beginning: &[u8]) -> bool {
    const SAID: &[u8] = b"SPACE=LPS";
    beginning[..beginning.len().min(SPACE_WITHIN)].windows(SAID.len()).any(|words| words == SAID)
}

/// The whole of a UTF-8 text file; `what` begins the error line, e.g. `cannot read scene file`.
///
/// # Errors
/// The file cannot be read, is not UTF-8 or is larger than 256 MiB.
pub fn read_text(path: &Path, what: &str) -> Result<String> {
    let refuse = |why: String| Error::input(what, path.display(), why);
    let file = File::open(path).map_err(|e| refuse(e.to_string()))?;
    let mut bytes = Vec::new();
    file.take(MAX_TEXT_BYTES + 1).read_to_end(&mut bytes).map_err(|e| refuse(e.to_string()))?;
    if bytes.len() as u64 > MAX_TEXT_BYTES {
        return Err(refuse("it is larger than 256 MiB".into()));
    }
    String::from_utf8(bytes).map_err(|e| refuse(format!("it is not UTF-8 text: {e}")))
}
