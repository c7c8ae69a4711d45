//! Reading small text files.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// No transfer function, scene or list of rays is larger; an endless device file ends here.
const MAX_TEXT_BYTES: u64 = 256 << 20;

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
