//! What commands tell: results on stdout, everything else on stderr.

use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::open::{Loaded, SceneSettings};
use std::io::{self, Write};

/// Prints a result to stdout. A reader that has gone away (`| head`) is no error.
///
/// # Errors
/// stdout cannot be written, e.g. because the disk is full.
pub fn print_result(text: &impl std::fmt::Display) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match write!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::runtime("cannot print result", "stdout", e))
        }
        _ => Ok(()),
    }
}

/// Prints `KIND: TEXT` to stderr, even where stderr is closed.
pub fn say(kind: &str, text: &impl std::fmt::Display) {
    // There is nowhere left to say that stderr is gone.
    let text: String =
        text.to_string().chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    let _ = writeln!(io::stderr(), "{kind}: {text}");
}

/// Reads what settings name, and says on stderr what was assumed.
///
/// # Errors
/// Whatever of it cannot be read or does not go together.
pub fn load(settings: &SceneSettings) -> Result<Loaded> {
    let loaded = settings.load(&Loading::default())?;
    loaded.remarks.iter().for_each(|(kind, remark)| say(kind, remark));
    Ok(loaded)
}

/// Prints a result as JSON to stdout.
///
/// # Errors
/// As [`print_result`].
pub fn print_json(result: &impl serde::Serialize) -> Result<()> {
    let json = serde_json::to_string_pretty(result)
        .map_err(|e| Error::runtime("cannot print result", "stdout", e))?;
    print_result(&format_args!("{json}\n"))
}
