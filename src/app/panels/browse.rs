//! "Browse…" button with the system's file dialog, on its own thread.

use eframe::egui;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

/// A dialog that closes within this time was never shown.
const MIN_DIALOG_TIME: Duration = Duration::from_millis(400);

/// Shows a dialog and returns the chosen path.
pub type Pick = fn(rfd::FileDialog) -> Option<PathBuf>;

/// State of the button.
#[derive(Default)]
pub struct Browse {
    pending: Option<(Instant, Receiver<Option<PathBuf>>)>,
    /// The system showed no dialog.
    pub is_unavailable: bool,
}

impl Browse {
    /// Shows the button, for a dialog in the folder of `path`; returns a path once one was chosen.
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
            let (sender, chosen) = channel();
            let context = ui.ctx().clone();
            let work = move || {
                let _ = sender.send(pick(dialog));
                context.request_repaint();
            };
            let thread = std::thread::Builder::new().name("file dialog".into()).spawn(work);
            self.is_unavailable = thread.is_err();
            self.pending = thread.ok().map(|_| (Instant::now(), chosen));
        }
        self.take()
    }

    fn take(&mut self) -> Option<String> {
        let (since, chosen) = self.pending.as_ref()?;
        let path = match chosen.try_recv() {
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => None,
            Ok(path) => path,
        };
        self.is_unavailable = path.is_none() && since.elapsed() < MIN_DIALOG_TIME;
        self.pending = None;
        path.map(|path| path.display().to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dialogs_that_close_at_once_are_unavailable() {
        let answer = |age: Duration, path: Option<&str>| {
            let (sender, chosen) = channel();
            let since = Instant::now().checked_sub(age)?;
            let mut browse = Browse { pending: Some((since, chosen)), is_unavailable: false };
            assert_eq!(browse.take(), None, "still open");
            sender.send(path.map(Into::into)).unwrap();
            let path = browse.take();
            Some((path, browse.is_unavailable, browse.pending.is_some()))
        };
        let later = 2 * MIN_DIALOG_TIME;
        for (age, path, unavailable) in
            [(Duration::ZERO, None, true), (later, None, false), (later, Some("a.nii"), false)]
        {
            let Some(answered) = answer(age, path) else { continue };
            assert_eq!(answered, (path.map(Into::into), unavailable, false));
        }
    }
}
