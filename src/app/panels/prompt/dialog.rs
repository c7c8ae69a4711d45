//! The system's own file dialog, on a thread of its own: the window goes on meanwhile.

use super::listing::split;
use eframe::egui;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

/// Nobody closes a dialog that soon: there was none.
const NO_DIALOG: Duration = Duration::from_millis(400);

/// A dialog that was asked for.
pub struct Dialog {
    since: Instant,
    chosen: Receiver<Option<PathBuf>>,
}

/// How a dialog ended.
#[derive(Debug, PartialEq, Eq)]
pub enum Answer {
    Chosen(PathBuf),
    Cancelled,
    /// The system has none to show.
    NoDialog,
}

impl Dialog {
    /// Opens one, for a title, the kind of files meant and their endings, in the folder of a typed path; `None` where the
    /// system has no thread left.
    pub fn of_file(
        (title, kind, endings): (&str, &str, &[&str]),
        saves: bool,
        typed: &str,
        context: &egui::Context,
    ) -> Option<Self> {
        let mut dialog = rfd::FileDialog::new().set_title(title).add_filter(kind, endings);
        let (folder, file) = split(typed);
        if Path::new(folder).is_dir() {
            dialog = dialog.set_directory(folder);
        }
        if saves && !file.is_empty() {
            dialog = dialog.set_file_name(file);
        }
        Self::open(context, move || if saves { dialog.save_file() } else { dialog.pick_file() })
    }

    /// Opens one for a folder, in `folder` or the nearest above it that there is; `None` as there.
    pub fn of_folder(title: &str, folder: &Path, context: &egui::Context) -> Option<Self> {
        let mut dialog = rfd::FileDialog::new().set_title(title);
        if let Some(folder) = folder.ancestors().find(|p| p.is_dir()) {
            dialog = dialog.set_directory(folder);
        }
        Self::open(context, move || dialog.pick_folder())
    }

    fn open(context: &egui::Context, ask: impl FnOnce() -> Option<PathBuf> + Send + 'static) -> Option<Self> {
        let (send, chosen) = channel();
        let context = context.clone();
        let ask = move || {
            let _ = send.send(ask());
            context.request_repaint();
        };
        let thread = std::thread::Builder::new().name("file dialog".into()).spawn(ask);
        thread.ok().map(|_| Self { since: Instant::now(), chosen })
    }

    /// How it ended, once it has.
    pub fn answer(&self) -> Option<Answer> {
        match self.chosen.try_recv() {
            Err(TryRecvError::Empty) => None,
            Ok(Some(path)) => Some(Answer::Chosen(path)),
            Ok(None) if self.since.elapsed() >= NO_DIALOG => Some(Answer::Cancelled),
            // At once, or its thread ended without a word.
            Ok(None) | Err(TryRecvError::Disconnected) => Some(Answer::NoDialog),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(since: Instant) -> (std::sync::mpsc::Sender<Option<PathBuf>>, Dialog) {
        let (send, chosen) = channel();
        (send, Dialog { since, chosen })
    }

    #[test]
    fn what_ends_at_once_was_no_dialog() {
        let (send, dialog) = asked(Instant::now());
        assert_eq!(dialog.answer(), None, "it is still open");
        send.send(None).unwrap();
        assert_eq!(dialog.answer(), Some(Answer::NoDialog));
        let (send, dialog) = asked(Instant::now());
        drop(send);
        assert_eq!(dialog.answer(), Some(Answer::NoDialog));
    }

    #[test]
    fn a_dialog_that_a_person_answers_is_no_missing_one() {
        let Some(earlier) = Instant::now().checked_sub(2 * NO_DIALOG) else { return };
        let (send, dialog) = asked(earlier);
        send.send(None).unwrap();
        assert_eq!(dialog.answer(), Some(Answer::Cancelled));
        let (send, dialog) = asked(Instant::now());
        send.send(Some("chosen.nii".into())).unwrap();
        assert_eq!(dialog.answer(), Some(Answer::Chosen("chosen.nii".into())));
    }
}
