//! Terminal output of the commands: results on stdout, messages and progress on stderr.

use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::measure::progress::{Status, StepKind, spoken};
use crate::open::{Loaded, SceneSettings};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::cell::Cell;
use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

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

/// Minimum time between two lines of progress, except where a new row, scene or case starts.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// Progress of a measurement on stderr: a bar on a terminal, and lines elsewhere, such as in the log of a batch job.
pub struct StepDisplay {
    bar: ProgressBar,
    writes_lines: bool,
    /// Time of the last line; `None` before the first one.
    last_line: Cell<Option<Instant>>,
}

impl StepDisplay {
    /// Creates the display of a measurement's progress.
    ///
    /// # Errors
    /// See [`progress_bar`].
    pub fn new() -> Result<Self> {
        let bar = progress_bar(0, "{bar:20} {pos}/{len} {wide_msg}")?;
        Ok(Self { bar, writes_lines: !io::stderr().is_terminal(), last_line: Cell::new(None) })
    }

    /// Shows the running step of a measurement and the estimated remaining time.
    pub fn show(&self, status: &Status) {
        self.bar.set_length(status.total as u64);
        self.bar.set_position(status.done as u64);
        // The remaining time comes first: the end of the line may be cut off.
        let left = status.left_s.map_or(String::new(), |s| format!("about {} left, ", spoken(s)));
        let text = format!("{left}{}", status.what);
        if self.writes_lines && self.is_line_due(status.step.kind) {
            self.last_line.set(Some(Instant::now()));
            print_message("progress", &format_args!("{}/{} {text}", status.done, status.total));
        }
        self.bar.set_message(text);
    }

    /// Removes the progress bar from the terminal.
    pub fn finish_and_clear(&self) {
        self.bar.finish_and_clear();
    }

    /// Whether a step of this kind is written as a line: if it starts a new row, scene or case, or if the last line
    /// is old.
    fn is_line_due(&self, kind: StepKind) -> bool {
        match kind {
            StepKind::Points | StepKind::ExactPicture | StepKind::Draw | StepKind::Case => true,
            StepKind::Errors | StepKind::Run | StepKind::Ablation | StepKind::Trial => {
                self.last_line.get().is_none_or(|last| last.elapsed() >= LINE_INTERVAL)
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_progress_are_one_a_row_and_few_between() {
        let display = StepDisplay::new().unwrap();
        assert!(display.is_line_due(StepKind::Run), "the first step is always written");
        display.last_line.set(Some(Instant::now()));
        assert!(display.is_line_due(StepKind::Draw) && display.is_line_due(StepKind::Case));
        assert!(!display.is_line_due(StepKind::Run) && !display.is_line_due(StepKind::Errors));
        let old = Instant::now().checked_sub(LINE_INTERVAL).unwrap();
        display.last_line.set(Some(old));
        assert!(display.is_line_due(StepKind::Run) && display.is_line_due(StepKind::Errors));
    }
}
