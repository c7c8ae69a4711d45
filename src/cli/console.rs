//! Terminal output of the commands: results on stdout, messages and progress on stderr.

use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::measure::progress::{Status, spoken};
use crate::open::{Loaded, SceneSettings};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{self, Write};

/// Prints the result of a command to stdout. A closed pipe (`| head`) is not an error.
///
/// # Errors
/// stdout cannot be written, e.g. because the disk is full.
pub fn print_result(text: &impl std::fmt::Display) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match write!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(not_printed(e)),
        _ => Ok(()),
    }
}

/// Prints a message for the user to stderr, in the form `KIND: TEXT`.
pub fn print_message(kind: &str, text: &impl std::fmt::Display) {
    let text: String =
        text.to_string().chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    // A closed stderr is no error.
    let _ = writeln!(io::stderr(), "{kind}: {text}");
}

/// Loads a scene with its volume, and prints notes and warnings to stderr.
///
/// # Errors
/// See [`SceneSettings::load`].
pub fn load_scene(settings: &SceneSettings) -> Result<Loaded> {
    let loaded = settings.load(&Loading::default())?;
    loaded.diagnostics.iter().for_each(|d| print_message(d.level.name(), &d.message));
    Ok(loaded)
}

/// Creates a progress bar on stderr. It is shown only if stderr is a terminal.
///
/// # Errors
/// A template that is not well-formed.
pub fn progress_bar(length: u64, template: &str) -> Result<ProgressBar> {
    let style = ProgressStyle::with_template(template)
        .map_err(|e| Error::runtime("cannot show progress", "stderr", e))?;
    Ok(ProgressBar::new(length).with_style(style))
}

/// Shows the running step and the estimated remaining time of a measurement on a progress bar.
pub fn show_step(bar: &ProgressBar, status: &Status) {
    bar.set_length(status.total as u64);
    bar.set_position(status.done as u64);
    // The remaining time comes first: the end of the line may be cut off.
    let left = status.left_s.map_or(String::new(), |s| format!("about {} left, ", spoken(s)));
    bar.set_message(format!("{left}{}", status.what));
}

/// Prints the result of a command as JSON to stdout.
///
/// # Errors
/// See [`print_result`].
pub fn print_json(result: &impl Serialize) -> Result<()> {
    let json = serde_json::to_string_pretty(result).map_err(not_printed)?;
    print_result(&format_args!("{json}\n"))
}

fn not_printed(why: impl std::fmt::Display) -> Error {
    Error::runtime("cannot print result", "stdout", why.to_string())
}
