//! Terminal output of the commands: results on stdout, messages and progress on stderr.

use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::measure::progress::{Status, Step, StepKind, spoken};
use crate::open::{Loaded, RunFlags, SceneSettings};
use crate::render::{Renderer, Session};
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::cell::Cell;
use std::io::{self, IsTerminal, Write};
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
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

/// Loads a scene with its volume, and prints notes and warnings to stderr. If this takes long, it shows the progress.
///
/// # Errors
/// See [`SceneSettings::load`].
pub fn load_scene(settings: &SceneSettings) -> Result<Loaded> {
    let loading = Loading::default();
    let loaded = shown(&loading, || settings.load(&loading))?;
    loaded.diagnostics.iter().for_each(|d| print_message(d.level.name(), &d.message));
    Ok(loaded)
}

/// Opens the graphics adapter of a command with the volume and transfer function of its scene.
///
/// # Errors
/// There is no such adapter, or it cannot hold the volume.
pub fn open_session(
    run: &RunFlags,
    settings: &SceneSettings,
    (volume, strands): (Arc<Volume>, Option<Arc<VoxelisedStrands>>),
    tf: &TransferFunction,
) -> Result<Session> {
    let renderer = Arc::new(Renderer::new(run.gpu()?));
    let session = Session::on(&renderer, volume, tf, settings.disabled_optimizations())?;
    Ok(session.with_strands(strands))
}

/// Time between two looks at the progress of reading a volume.
const READING_INTERVAL: Duration = Duration::from_millis(500);

/// Reads a volume, and shows its progress from another thread.
fn shown<T>(loading: &Loading, read: impl FnOnce() -> T) -> T {
    let (end, ended) = channel::<()>();
    let show = move || {
        let Ok(display) = StepDisplay::new() else { return };
        let step = Step::new(StepKind::Render, "");
        while ended.recv_timeout(READING_INTERVAL) == Err(RecvTimeoutError::Timeout) {
            let progress = loading.progress();
            let (what, done) = (progress.stage.name(), (100.0 * progress.share) as usize);
            display.show(&Status { step: &step, what, done, total: 100, left_s: None });
        }
        display.finish_and_clear();
    };
    thread::scope(|scope| {
        // Without a thread, the volume is read all the same.
        let _ = thread::Builder::new().spawn_scoped(scope, show);
        let result = read();
        drop(end);
        result
    })
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

/// Minimum time between two lines of progress, except where a new row, scene or case starts. Also the time before the first
/// line of a command that measures nothing.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// Longest time between two lines of a command that measures nothing. Each is twice as long as the one before.
const LONGEST_INTERVAL: Duration = Duration::from_secs(600);

/// Progress of a command on stderr: a bar on a terminal, and lines elsewhere, such as in the log of a batch job.
pub struct StepDisplay {
    bar: ProgressBar,
    writes_lines: bool,
    began: Instant,
    /// Time of the last line; `None` before the first one.
    last_line: Cell<Option<Instant>>,
}

impl StepDisplay {
    /// Creates the display of a command's progress.
    ///
    /// # Errors
    /// See [`progress_bar`].
    pub fn new() -> Result<Self> {
        let bar = progress_bar(0, "{bar:20} {pos}/{len} {wide_msg}")?;
        let writes_lines = !io::stderr().is_terminal();
        Ok(Self { bar, writes_lines, began: Instant::now(), last_line: Cell::new(None) })
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

    /// Prints a message for the user above the progress bar.
    pub fn print_message(&self, kind: &str, text: &impl std::fmt::Display) {
        self.bar.suspend(|| print_message(kind, text));
    }

    /// Removes the progress bar from the terminal.
    pub fn finish_and_clear(&self) {
        self.bar.finish_and_clear();
    }

    /// Whether a step of this kind is written as a line: if it starts a new row, scene or case, or if the last line
    /// is old. Commands that measure nothing write fewer lines, and none if they are quick.
    fn is_line_due(&self, kind: StepKind) -> bool {
        match kind {
            StepKind::Points | StepKind::ExactPicture | StepKind::Draw | StepKind::Case => true,
            StepKind::Errors | StepKind::Run | StepKind::Ablation | StepKind::Trial => {
                self.last_line.get().is_none_or(|last| last.elapsed() >= LINE_INTERVAL)
            }
            StepKind::Render => {
                let last = self.last_line.get().unwrap_or(self.began);
                last.elapsed() >= (last - self.began).clamp(LINE_INTERVAL, LONGEST_INTERVAL)
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

    #[test]
    fn a_quick_command_writes_no_line_and_a_long_one_writes_few() {
        let mut display = StepDisplay::new().unwrap();
        assert!(!display.is_line_due(StepKind::Render));
        let ago = |s: u64| Instant::now().checked_sub(Duration::from_secs(s)).unwrap();
        display.began = ago(11);
        assert!(display.is_line_due(StepKind::Render));
        // The line after 100 s is followed by the one after 200 s.
        display.began = ago(150);
        display.last_line.set(Some(ago(50)));
        assert!(!display.is_line_due(StepKind::Render));
        display.began = ago(201);
        display.last_line.set(Some(ago(101)));
        assert!(display.is_line_due(StepKind::Render));
        display.began = ago(7000);
        display.last_line.set(Some(ago(601)));
        assert!(display.is_line_due(StepKind::Render));
    }
}
