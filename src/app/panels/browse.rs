//! "Browse…" button, which opens the system's file dialog on a separate thread.

use crate::engine::task::Task;
use eframe::egui;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

/// Minimum time that a file dialog is open. A dialog that closes sooner was never shown by the system.
const MIN_DIALOG_TIME: Duration = Duration::from_millis(400);

/// Function that shows a file dialog and returns the path that the user chose; `None` if cancelled.
pub type Pick = fn(rfd::FileDialog) -> Option<PathBuf>;

/// State of a "Browse…" button and its file dialog.
#[derive(Default)]
pub struct Browse {
    pending: Option<(Instant, Task<Option<PathBuf>>)>,
    /// Whether the system failed to show a file dialog.
    pub is_unavailable: bool,
}

impl Browse {
    /// Shows the "Browse…" button. Its file dialog starts in the folder of `path`. Returns the chosen path once, in
    /// the frame after the user's choice.
    pub fn show(
        &mut self,
        ui: &mut egui::Ui,
        path: &Path,
        dialog: impl FnOnce() -> rfd::FileDialog,
        pick: Pick,
    ) -> Option<String> {
        if ui.add_enabled(self.pending.is_none(), egui::Button::new("Browse…")).clicked() {
            let mut dialog = dialog();
            if let Some(folder) = path.ancestors().find(|p| p.is_dir()) {
                dialog = dialog.set_directory(folder);
            }
            let context = ui.ctx().clone();
            let wake = Arc::new(move || context.request_repaint());
            let task = Task::start("file dialog", wake, move |sender, _| _ = sender.send(pick(dialog)));
            self.is_unavailable = task.is_err();
            self.pending = task.ok().map(|task| (Instant::now(), task));
        }
        self.take()
    }

    fn take(&mut self) -> Option<String> {
        let (since, task) = self.pending.as_ref()?;
        let path = match task.poll() {
            Err(TryRecvError::Empty) => return None,
            path => path.unwrap_or_default(),
        };
        self.is_unavailable = path.is_none() && since.elapsed() < MIN_DIALOG_TIME;
        self.pending = None;
        path.map(|path| path.display().to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Sender, channel};

    #[test]
    fn dialogs_that_close_at_once_are_unavailable() {
        let answer = |age: Duration, path: Option<&str>| {
            let (reply, replied) = channel::<Option<PathBuf>>();
            let work =
                move |sender: &Sender<Option<PathBuf>>, _: &_| sender.send(replied.recv().unwrap()).unwrap();
            let task = Task::start("dialog", Arc::new(|| ()), work).unwrap();
            let since = Instant::now().checked_sub(age)?;
            let mut browse = Browse { pending: Some((since, task)), is_unavailable: false };
            assert_eq!(browse.take(), None, "still open");
            reply.send(path.map(Into::into)).unwrap();
            let mut path = browse.take();
            while browse.pending.is_some() {
                path = browse.take();
            }
            Some((path, browse.is_unavailable))
        };
        let later = 2 * MIN_DIALOG_TIME;
        for (age, path, unavailable) in
            [(Duration::ZERO, None, true), (later, None, false), (later, Some("a.nii"), false)]
        {
            let Some(answered) = answer(age, path) else { continue };
            assert_eq!(answered, (path.map(Into::into), unavailable));
        }
    }
}
