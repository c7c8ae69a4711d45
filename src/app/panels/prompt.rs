//! Asking for a path: typed, or chosen in the system's dialog.

use crate::app::model::Model;
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS};
use crate::open::FORMATS;
use crate::transfer::formats::endings;
use eframe::egui;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

const NO_DIALOG_TEXT: &str = "The system shows no file dialog: type the path above";

/// What a path is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// A volume, strands or a scene, to be opened.
    OpenVolume,
    /// A transfer function, to be taken.
    LoadTransfer,
    /// Where the transfer function is to be written.
    SaveTransfer,
    /// Where the scene is to be written.
    SaveScene,
    /// Where a picture is to be written.
    ExportPicture,
}

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::OpenVolume => "Open a volume, strands or a scene",
            Self::LoadTransfer => "Load a transfer function",
            Self::SaveTransfer => "Save the transfer function",
            Self::SaveScene => "Save the scene",
            Self::ExportPicture => "Export a picture",
        }
    }

    fn saves(self) -> bool {
        matches!(self, Self::SaveTransfer | Self::SaveScene | Self::ExportPicture)
    }

    /// Name and endings of the files meant.
    fn filter(self) -> (&'static str, Vec<&'static str>) {
        match self {
            Self::OpenVolume => {
                let volumes = FORMATS.iter().flat_map(|f| f.endings);
                ("Volumes, strands, scenes", volumes.chain(&["toml"]).copied().collect())
            }
            Self::LoadTransfer => ("Transfer functions", endings()),
            Self::SaveTransfer => ("Transfer functions", vec!["json"]),
            Self::SaveScene => ("Scenes", vec!["toml"]),
            Self::ExportPicture => ("Pictures", PICTURE_EXTENSIONS.to_vec()),
        }
    }

    fn suggestion(self) -> &'static str {
        match self {
            Self::OpenVolume | Self::LoadTransfer => "",
            Self::SaveTransfer => "transfer.json",
            Self::SaveScene => "scene.toml",
            Self::ExportPicture => "picture.png",
        }
    }
}

/// The question that is open.
#[derive(Default)]
pub struct Prompt {
    open: Option<Purpose>,
    path: String,
    size: [u32; 2],
    backdrop: Backdrop,
    /// The system's dialog, while it is open.
    dialog: Option<Dialog>,
    /// The system has no dialog to show.
    no_dialog: bool,
}

/// A dialog that was asked for.
struct Dialog {
    since: Instant,
    chosen: Receiver<Option<PathBuf>>,
}

/// Nobody closes a dialog that soon: there was none.
const NO_DIALOG: Duration = Duration::from_millis(400);

impl Prompt {
    /// Takes what the dialog has to say.
    fn take_choice(&mut self) {
        let Some(dialog) = &self.dialog else { return };
        let chosen = match dialog.chosen.try_recv() {
            Err(TryRecvError::Empty) => return,
            Ok(chosen) => chosen,
            // Its thread ended without a word.
            Err(TryRecvError::Disconnected) => {
                self.no_dialog = true;
                None
            }
        };
        self.no_dialog |= chosen.is_none() && dialog.since.elapsed() < NO_DIALOG;
        if let Some(path) = chosen {
            self.path = path.display().to_string();
            self.no_dialog = false;
        }
        self.dialog = None;
    }

    /// Asks for a path.
    pub fn ask(&mut self, model: &Model, purpose: Purpose) {
        let size = model.document.as_ref().map_or([512, 512], |d| [d.scene.width, d.scene.height]);
        let transparent = model.document.as_ref().is_some_and(|d| d.transparent);
        *self = Self {
            open: Some(purpose),
            path: purpose.suggestion().into(),
            size,
            backdrop: if transparent { Backdrop::LeftOut } else { Backdrop::Drawn },
            ..Default::default()
        };
    }

    /// Whether a question is open.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Shows the question while it is open, and does what it was asked for.
    pub fn show(&mut self, context: &egui::Context, model: &mut Model) {
        let Some(purpose) = self.open else { return };
        self.take_choice();
        let (mut done, mut cancelled) = (false, false);
        let response = egui::Modal::new(egui::Id::unique("path")).show(context, |ui| {
            ui.set_width(520.0);
            ui.heading(purpose.title());
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                let edit = egui::TextEdit::singleline(&mut self.path).desired_width(410.0).hint_text("path");
                let edit = ui.add(edit).accessible_name("path");
                // Before the field takes the cursor back, which Enter has taken from it.
                done |= edit.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
                if !edit.has_focus() && ui.memory(|m| m.focused().is_none()) {
                    edit.request_focus();
                }
                if ui.add_enabled(self.dialog.is_none(), egui::Button::new("Browse…")).clicked() {
                    self.dialog = browse(purpose, &self.path, ui.ctx());
                    self.no_dialog = self.dialog.is_none();
                }
            });
            if self.no_dialog {
                ui.colored_label(ui.visuals().warn_fg_color, NO_DIALOG_TEXT);
            }
            if purpose == Purpose::OpenVolume {
                ui.weak("A file, or phantom:NAME[:SIZE] for a built-in one");
            }
            if purpose == Purpose::ExportPicture {
                ui.horizontal_wrapped(|ui| {
                    ui.label("Size");
                    for (side, name) in self.size.iter_mut().zip(["width", "height"]) {
                        ui.add(egui::DragValue::new(side).range(1..=16_384).suffix(" px"))
                            .accessible_name(name);
                    }
                    ui.weak(".png is sRGB; .exr and .npy are linear, 32-bit float, with opacity");
                });
                ui.horizontal(|ui| {
                    let backdrop = &mut self.backdrop;
                    ui.radio_value(backdrop, Backdrop::Drawn, "With background");
                    ui.radio_value(backdrop, Backdrop::LeftOut, "Transparent").on_hover_text(
                        ".png with straight alpha; the colours of .exr and .npy are times the opacity",
                    );
                });
            }
            ui.add_space(8.0);
            ui.horizontal(|ui| {
                let verb = if purpose == Purpose::ExportPicture {
                    "Export"
                } else if purpose.saves() {
                    "Save"
                } else {
                    "Open"
                };
                done |= ui.add_enabled(!self.path.trim().is_empty(), egui::Button::new(verb)).clicked();
                cancelled = ui.button("Cancel").clicked();
            });
        });
        cancelled |= response.should_close();
        if done && !self.path.trim().is_empty() {
            self.open = None;
            self.go(purpose, model);
        } else if cancelled {
            self.open = None;
        }
    }

    fn go(&self, purpose: Purpose, model: &mut Model) {
        let path = self.path.trim().to_owned();
        let (size, backdrop) = (self.size, self.backdrop);
        match purpose {
            Purpose::OpenVolume => model.open_source(&path),
            Purpose::LoadTransfer => model.load_tf(&path),
            Purpose::SaveTransfer => model.save_tf(Path::new(&path)),
            Purpose::SaveScene => model.save_scene(Path::new(&path)),
            Purpose::ExportPicture => model.export(Path::new(&path), size, backdrop),
        }
    }
}

/// Opens the system's dialog away from the window, which goes on meanwhile.
fn browse(purpose: Purpose, path: &str, context: &egui::Context) -> Option<Dialog> {
    let (send, chosen) = channel();
    let (name, endings) = purpose.filter();
    let mut dialog = rfd::FileDialog::new().set_title(purpose.title()).add_filter(name, &endings);
    let path = Path::new(path);
    if let Some(folder) = path.parent().filter(|p| p.is_dir()) {
        dialog = dialog.set_directory(folder);
    }
    if purpose.saves()
        && let Some(file) = path.file_name()
    {
        dialog = dialog.set_file_name(file.to_string_lossy());
    }
    let context = context.clone();
    let ask = move || {
        let chosen = if purpose.saves() { dialog.save_file() } else { dialog.pick_file() };
        let _ = send.send(chosen);
        context.request_repaint();
    };
    let thread = std::thread::Builder::new().name("file dialog".into()).spawn(ask);
    thread.ok().map(|_| Dialog { since: Instant::now(), chosen })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(since: Instant) -> (std::sync::mpsc::Sender<Option<PathBuf>>, Prompt) {
        let (send, chosen) = channel();
        let dialog = Some(Dialog { since, chosen });
        (send, Prompt { path: "typed".into(), dialog, ..Default::default() })
    }

    #[test]
    fn without_a_dialog_the_typed_path_stays_and_it_is_said() {
        let (send, mut prompt) = asked(Instant::now());
        prompt.take_choice();
        assert!(prompt.dialog.is_some() && !prompt.no_dialog, "it is still open");
        send.send(None).unwrap();
        prompt.take_choice();
        assert!(prompt.dialog.is_none() && prompt.no_dialog && prompt.path == "typed");
        let (send, mut prompt) = asked(Instant::now());
        drop(send);
        prompt.take_choice();
        assert!(prompt.dialog.is_none() && prompt.no_dialog && prompt.path == "typed");
    }

    #[test]
    fn a_dialog_that_a_person_answers_is_no_missing_one() {
        let Some(earlier) = Instant::now().checked_sub(2 * NO_DIALOG) else { return };
        let (send, mut prompt) = asked(earlier);
        send.send(None).unwrap();
        prompt.take_choice();
        assert!(prompt.dialog.is_none() && !prompt.no_dialog && prompt.path == "typed");
        let (send, mut prompt) = asked(Instant::now());
        send.send(Some("chosen.nii".into())).unwrap();
        prompt.take_choice();
        assert!(prompt.dialog.is_none() && !prompt.no_dialog && prompt.path == "chosen.nii");
    }
}
