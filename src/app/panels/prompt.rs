//! Asking for a path: typed, chosen from a list of what is there, or in the system's dialog.

pub mod dialog;
mod list;
mod listing;

use crate::app::model::Model;
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS};
use crate::open::FORMATS;
use crate::transfer::formats::endings;
use dialog::{Answer, Dialog};
use eframe::egui;
use list::PathField;
use std::path::{Path, absolute};

const NO_DIALOG_TEXT: &str = "The system shows no file dialog: choose from the list, or type";

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
    field: PathField,
    size: [u32; 2],
    backdrop: Backdrop,
    /// The system's dialog, while it is open.
    dialog: Option<Dialog>,
    /// The system has no dialog to show.
    no_dialog: bool,
}

impl Prompt {
    /// Asks for a path.
    pub fn ask(&mut self, model: &Model, purpose: Purpose) {
        let folder = &model.settings.folder;
        let size = model.document.as_ref().map_or([512, 512], |d| [d.scene.width, d.scene.height]);
        let transparent = model.document.as_ref().is_some_and(|d| d.transparent);
        *self = Self {
            open: Some(purpose),
            field: PathField::new(
                format!("{folder}{}", purpose.suggestion()),
                purpose.filter().1,
                purpose.saves(),
            ),
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
        // Chosen in the system's dialog is confirmed, unless there is more to say here.
        let (mut done, mut cancelled) = (self.take_answer() && !purpose.saves(), false);
        let response = egui::Modal::new(egui::Id::unique("path")).show(context, |ui| {
            ui.set_width(520.0);
            ui.heading(purpose.title());
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                done |= self.field.show(ui, 410.0);
                if ui.add_enabled(self.dialog.is_none(), egui::Button::new("Browse…")).clicked() {
                    let (name, endings) = purpose.filter();
                    let question = (purpose.title(), name, endings.as_slice());
                    self.dialog = Dialog::of_file(question, purpose.saves(), &self.field.path(), ui.ctx());
                    self.no_dialog = self.dialog.is_none();
                }
            });
            done |= self.field.list(ui);
            if self.no_dialog {
                ui.colored_label(ui.visuals().warn_fg_color, NO_DIALOG_TEXT);
            }
            if purpose == Purpose::OpenVolume {
                ui.weak("A file, a folder of DICOM files, or phantom:NAME[:SIZE] for a built-in one");
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
                let verb = if purpose.saves() && Path::new(&self.field.path()).is_file() {
                    "Replace"
                } else if purpose == Purpose::ExportPicture {
                    "Export"
                } else if purpose.saves() {
                    "Save"
                } else {
                    "Open"
                };
                done |= ui.add_enabled(!self.field.text.trim().is_empty(), egui::Button::new(verb)).clicked();
                cancelled = ui.button("Cancel").clicked();
            });
        });
        cancelled |= response.should_close();
        if done && !self.field.text.trim().is_empty() {
            self.open = None;
            self.go(purpose, model);
        } else if cancelled {
            self.open = None;
        }
    }

    /// Takes what the system's dialog has to say: whether a path was chosen.
    fn take_answer(&mut self) -> bool {
        let Some(answer) = self.dialog.as_ref().and_then(Dialog::answer) else { return false };
        self.dialog = None;
        self.no_dialog = matches!(answer, Answer::NoDialog);
        let Answer::Chosen(path) = answer else { return false };
        self.field.choose(path.display().to_string());
        true
    }

    fn go(&self, purpose: Purpose, model: &mut Model) {
        let path = self.field.path();
        if let Some(folder) = self.field.folder() {
            let folder = absolute(&folder).map_or(folder, |whole| whole.display().to_string());
            // With its separator, so that a name can be put behind it.
            model.settings.folder = Path::new(&folder).join("").display().to_string();
        }
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
