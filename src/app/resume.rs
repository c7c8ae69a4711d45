//! Going on after the graphics device was lost (a driver that was reset or updated, a card that was taken away): what was
//! open is handed from one window to the next, on a new device; volumes are not read again.

use super::curve::History;
use super::difference::DifferenceState;
use super::open::Opened;
use super::worker::Job;
use super::{App, Document, Settings};
use crate::error::{Error, Result};
use crate::scene::Camera;
use std::path::PathBuf;
use std::sync::Arc;

/// What was open when a device was lost.
pub struct Resume {
    /// The driver's reason.
    pub why: String,
    pub settings: Settings,
    what: Option<Open>,
}

struct Open {
    document: Document,
    history: History,
    home: Option<Camera>,
    split: Option<f32>,
    difference: DifferenceState,
}

impl App {
    /// Whether the device is lost, and why.
    pub fn lost(&self) -> Option<String> {
        self.loss.reason()
    }

    /// Takes what is open, to go on with it on another device.
    pub fn into_resume(&mut self, why: String) -> Resume {
        let open = self.document.take();
        let open = open.map(|document| (document, std::mem::take(&mut self.history), self.view.home));
        // A device that is lost before the volume is on it loses nothing.
        let what = open.or_else(|| self.resuming.take()).map(|(document, history, home)| Open {
            document,
            history,
            home,
            split: self.split,
            difference: self.difference.only_choices(),
        });
        Resume { why, settings: self.settings.clone(), what }
    }

    /// Goes on with what was open on a device that was lost.
    pub fn resume(&mut self, resume: Resume) {
        self.say(format!("the graphics device was lost ({}); this is a new one", resume.why), None, true);
        let Some(Open { document, history, home, split, difference }) = resume.what else { return };
        self.worker.push(Job::Upload(Box::new(Opened::again(&document))));
        self.split = split;
        self.difference = difference;
        self.resuming = Some((document, history, home));
    }

    /// The document of a volume that is on the new device now, where it was open before.
    pub(super) fn take_resumed(&mut self, volume: &Arc<crate::volume::Volume>) -> bool {
        let is_it = self.resuming.as_ref().is_some_and(|(d, ..)| Arc::ptr_eq(&d.volume, volume));
        let Some((document, history, home)) = self.resuming.take().filter(|_| is_it) else { return false };
        self.document = Some(document);
        self.history = history;
        self.view.home = home;
        true
    }
}

impl Resume {
    /// The scene file that is kept where no new device can be had.
    pub fn kept_scene() -> Option<PathBuf> {
        Settings::path().map(|path| path.with_file_name("lost.toml"))
    }

    /// Where no new device can be had: keeps the scene file in `path` and says so.
    pub fn give_up(&self, path: Option<PathBuf>) -> Error {
        let failed = Error::runtime("the graphics device was lost", "window", &self.why);
        match self.keep(path) {
            Some(Ok(path)) => failed.hint(format!("the scene was kept: --scene {}", path.display())),
            Some(Err(e)) => failed.hint(format!("the scene could not be kept: {e}")),
            None => failed,
        }
    }

    fn keep(&self, path: Option<PathBuf>) -> Option<Result<PathBuf>> {
        let (document, path) = (&self.what.as_ref()?.document, path?);
        if let Some(folder) = path.parent() {
            // Where it cannot be made, writing says so.
            let _ = std::fs::create_dir_all(folder);
        }
        Some(document.write_scene(&path).map(|()| path))
    }
}
