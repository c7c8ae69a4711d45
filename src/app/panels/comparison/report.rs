//! The report of a finished comparison, opened by whatever the system opens such files with.

use crate::error::{Error, Result};
use eframe::egui;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Opens a file in another program.
pub type Opener = fn(&Path) -> io::Result<()>;

/// What opens reports, and how that went.
pub struct Report {
    /// The system's, but in tests.
    pub opener: Opener,
    /// The path that is being opened, and what comes of it.
    opening: Option<(PathBuf, Receiver<io::Result<()>>)>,
    failed: Option<Error>,
}

impl Default for Report {
    fn default() -> Self {
        Self { opener: |path| open::that_detached(path), opening: None, failed: None }
    }
}

impl Report {
    /// The buttons, the path, and why it was not opened.
    pub fn show(&mut self, ui: &mut egui::Ui, path: &Path) {
        self.take_outcome();
        let text = path.display().to_string();
        ui.horizontal_wrapped(|ui| {
            let idle = self.opening.is_none();
            let tooltip = "Table, plots and pictures in one page, in the system's browser";
            let button = ui.add_enabled(idle, egui::Button::new("Open report")).on_hover_text(tooltip);
            if button.clicked() {
                self.open(path, ui.ctx());
            }
            if ui.button("Copy path").on_hover_text("To open it elsewhere").clicked() {
                ui.ctx().copy_text(text.clone());
            }
        });
        ui.add(egui::Label::new(egui::RichText::new(text).monospace()).wrap());
        if let Some(e) = &self.failed {
            ui.colored_label(ui.visuals().error_fg_color, e.to_string());
        }
    }

    /// Forgets what went wrong.
    pub fn clear(&mut self) {
        self.failed = None;
    }

    /// Away from the window: the system's opener may take its time.
    fn open(&mut self, path: &Path, context: &egui::Context) {
        self.failed = None;
        let (send, outcome) = channel();
        let (opener, context, theirs) = (self.opener, context.clone(), path.to_owned());
        let work = move || {
            let _ = send.send(opener(&theirs));
            context.request_repaint();
        };
        match std::thread::Builder::new().name("open report".into()).spawn(work) {
            Ok(_) => self.opening = Some((path.to_owned(), outcome)),
            Err(e) => self.failed = Some(failed(path, &e)),
        }
    }

    fn take_outcome(&mut self) {
        let Some((path, outcome)) = &self.opening else { return };
        let outcome: Result<()> = match outcome.try_recv() {
            Err(TryRecvError::Empty) => return,
            Ok(outcome) => outcome.map_err(|e| failed(path, &e)),
            Err(TryRecvError::Disconnected) => Ok(()),
        };
        self.failed = outcome.err();
        self.opening = None;
    }
}

fn failed(path: &Path, why: &io::Error) -> Error {
    Error::runtime("cannot open the report", path.display(), why)
}
