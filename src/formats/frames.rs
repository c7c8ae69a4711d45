//! Files of several volumes: which one is read, and what is said of it.

use crate::error::{Error, Result};
use std::path::Path;

/// What to say where a file holds more than the frame that is read (0 is the first).
///
/// # Errors
/// It holds fewer.
pub(super) fn picked(path: &Path, frame: usize, frames: usize) -> Result<Option<String>> {
    if frame >= frames {
        let many = if frames == 1 { "frame" } else { "frames" };
        let why = format!("--frame {frame} is beyond its {frames} {many} (counted from 0)");
        return Err(Error::input("cannot read frame", path.display(), why));
    }
    let said = || format!("{frames} frames: frame {frame} (counted from 0) was read, --frame picks another");
    Ok((frames > 1).then(said))
}
