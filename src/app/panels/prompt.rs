//! Path prompt: asks for a file path with a text field, Tab completion and the system's file dialog.

use super::browse::{Browse, Pick};
use crate::app::model::Model;
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS};
use crate::open::FORMATS;
use crate::transfer::formats::endings;
use eframe::egui::text::{CCursor, CCursorRange};
use eframe::egui::text_edit::TextEditState;
use eframe::egui::{self, Key, Modifiers};
use std::path::{MAIN_SEPARATOR_STR, Path, absolute, is_separator};

/// Purpose for which the viewer asks the user for a file path: to open, load, save or export a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Path of a volume, a file of strands or a scene file to open.
    OpenVolume,
    /// Path of a transfer function to load.
    LoadTransfer,
    /// Path of the file to which the transfer function is saved.
    SaveTransfer,
    /// Path of the scene file to save.
    SaveScene,
    /// Path of the picture file to export.
    ExportPicture,
}

impl Purpose {
    /// Texts of a path prompt: title, kind of file, file extensions, and suggested file name. The name is empty if a
    /// file is opened.
    fn texts(self) -> (&'static str, &'static str, Vec<&'static str>, &'static str) {
        match self {
            Self::OpenVolume => {
                let extensions = FORMATS.iter().flat_map(|f| f.endings).chain(&["toml"]).copied().collect();
                ("Open a volume, strands or a scene", "Volumes, strands, scenes", extensions, "")
            }
            Self::LoadTransfer => ("Load a transfer function", "Transfer functions", endings(), ""),
            Self::SaveTransfer => {
                ("Save the transfer function", "Transfer functions", vec!["json"], "transfer.json")
            }
            Self::SaveScene => ("Save the scene", "Scenes", vec!["toml"], "scene.toml"),
            Self::ExportPicture => {
                ("Export a picture", "Pictures", PICTURE_EXTENSIONS.to_vec(), "picture.png")
            }
        }
    }

    fn saves(self) -> bool {
        !self.texts().3.is_empty()
    }
}

/// State of the prompt that asks for a file path.
#[derive(Default)]
pub struct Prompt {
    open: Option<Purpose>,
    text: String,
    /// Number of frames in which the prompt's text field takes the focus and selects the file name. The first frame
    /// measures the window and may lose both.
    select_frames: u8,
    size: [u32; 2],
    backdrop: Backdrop,
    browse: Browse,
}

impl Prompt {
    /// Opens the prompt for a file path with the given purpose.
    pub fn ask(&mut self, model: &Model, purpose: Purpose) {
        let document = model.document.as_ref();
        let transparent = document.is_some_and(|d| d.transparent);
        *self = Self {
            open: Some(purpose),
            text: format!("{}{}", model.settings.folder, purpose.texts().3),
            select_frames: 2,
            size: document.map_or([512, 512], |d| [d.scene.width, d.scene.height]),
            backdrop: if transparent { Backdrop::LeftOut } else { Backdrop::Drawn },
            browse: Browse::default(),
        };
    }

    /// Whether the prompt for a file path is open.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Shows the prompt for a file path if it is open. Opens, saves or exports the file when the user confirms the
    /// path.
    pub fn show(&mut self, context: &egui::Context, model: &mut Model) {
        let Some(purpose) = self.open else { return };
        let (title, kind, extensions, _) = purpose.texts();
        // Enter confirms, but not the Enter that opened the prompt.
        let enter = self.select_frames == 0 && context.input(|i| i.key_pressed(Key::Enter));
        let (mut done, mut cancelled) = (enter, false);
        let response = egui::Modal::new(egui::Id::unique("path")).show(context, |ui| {
            ui.set_width(520.0);
            ui.heading(title);
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                self.field(ui, &extensions);
                let path = expanded(self.text.trim());
                let dialog = || {
                    let dialog = rfd::FileDialog::new().set_title(title).add_filter(kind, &extensions);
                    if purpose.saves() { dialog.set_file_name(split(&path).1) } else { dialog }
                };
                let pick: Pick = if purpose.saves() { |d| d.save_file() } else { |d| d.pick_file() };
                if let Some(path) = self.browse.show(ui, Path::new(&path), dialog, pick) {
                    (self.text, self.select_frames) = (path, 2);
                    // An opened file needs no confirmation; a saved one has more options here.
                    done |= !purpose.saves();
                }
            });
            if self.browse.is_unavailable {
                let text = "The system shows no file dialog: type a path (Tab completes it)";
                ui.colored_label(ui.visuals().warn_fg_color, text);
            }
            if purpose == Purpose::OpenVolume {
                ui.weak("A file, a folder of DICOM files, or phantom:NAME[:SIZE] for a built-in volume");
            }
            if purpose == Purpose::ExportPicture {
                self.picture_options(ui);
            }
            ui.add_space(8.0);
            ui.horizontal(|ui| {
                let verb = match purpose {
                    _ if purpose.saves() && Path::new(&expanded(self.text.trim())).is_file() => "Replace",
                    Purpose::ExportPicture => "Export",
                    _ if purpose.saves() => "Save",
                    _ => "Open",
                };
                let button = egui::Button::new(verb);
                done |= ui.add_enabled(!self.text.trim().is_empty(), button).clicked();
                cancelled = ui.button("Cancel").clicked();
            });
        });
        if cancelled || response.should_close() {
            self.open = None;
        } else if done && !self.text.trim().is_empty() {
            self.open = None;
            self.use_path(purpose, model);
        }
    }

    /// Shows the text field of the prompt for a file path, with the file name selected at first.
    fn field(&mut self, ui: &mut egui::Ui, extensions: &[&str]) {
        let id = egui::Id::unique("path field");
        let takes_focus = self.select_frames > 0;
        self.select_frames = self.select_frames.saturating_sub(1);
        let mut selected = takes_focus.then(|| split(&self.text).0.to_owned());
        if !takes_focus && ui.memory(|m| m.has_focus(id)) {
            if ui.input_mut(|i| i.consume_key(Modifiers::SHIFT, Key::Tab)) {
                ui.memory_mut(|m| m.move_focus(egui::FocusDirection::Previous));
            } else if ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Tab)) {
                match completed(&self.text, extensions) {
                    Some(longer) => {
                        selected = Some(longer.clone());
                        self.text = longer;
                    }
                    None => ui.memory_mut(|m| m.move_focus(egui::FocusDirection::Next)),
                }
            }
        }
        if let Some(before) = selected {
            let [from, to] = [&before, &self.text].map(|text| CCursor::end_of_str(text));
            let mut state = TextEditState::load(ui.ctx(), id).unwrap_or_default();
            state.cursor.set_char_range(Some(CCursorRange::two(from, to)));
            state.store(ui.ctx(), id);
        }
        let field = egui::TextEdit::singleline(&mut self.text).id(id).desired_width(410.0);
        let field = ui.add(field.hint_text("path").lock_focus(true)).accessible_name("path");
        if takes_focus {
            field.request_focus();
        }
    }

    fn picture_options(&mut self, ui: &mut egui::Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.label("Size");
            for (side, name) in self.size.iter_mut().zip(["width", "height"]) {
                ui.add(egui::DragValue::new(side).range(1..=16_384).suffix(" px")).accessible_name(name);
            }
            ui.weak(".png is sRGB; .exr and .npy are linear, 32-bit float, with opacity");
        });
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.backdrop, Backdrop::Drawn, "With background");
            ui.radio_value(&mut self.backdrop, Backdrop::LeftOut, "Transparent")
                .on_hover_text(".png has straight alpha; .exr and .npy have premultiplied colours");
        });
    }

    fn use_path(&self, purpose: Purpose, model: &mut Model) {
        let path = expanded(self.text.trim());
        let folder = split(&path).0;
        if Path::new(folder).is_dir()
            && let Ok(folder) = absolute(folder)
        {
            // A folder ends with a separator, so that a file name can follow.
            model.settings.folder = folder.join("").display().to_string();
        }
        match purpose {
            Purpose::OpenVolume => model.open_source(&path),
            Purpose::LoadTransfer => model.load_tf(&path),
            Purpose::SaveTransfer => model.save_tf(Path::new(&path)),
            Purpose::SaveScene => model.save_scene(Path::new(&path)),
            Purpose::ExportPicture => model.export(Path::new(&path), self.size, self.backdrop),
        }
    }
}

/// Splits a path after its last separator into folder and file name.
fn split(typed: &str) -> (&str, &str) {
    typed.split_at(typed.rfind(is_separator).map_or(0, |at| at + 1))
}

/// Replaces a leading `~` of a path by the home folder.
fn expanded(typed: &str) -> String {
    let rest = typed.strip_prefix('~').filter(|rest| rest.is_empty() || rest.starts_with(is_separator));
    match rest.zip(dirs::home_dir()) {
        Some((rest, home)) => format!("{}{rest}", home.display()),
        None => typed.to_owned(),
    }
}

/// Completes a typed path up to the longest common prefix of all matching folders and files. `None` if nothing can be
/// added.
fn completed(typed: &str, extensions: &[&str]) -> Option<String> {
    let (folder, begun) = split(typed);
    let is_meant = |name: &str| {
        let lower = name.to_lowercase();
        let stem = |extension: &&str| lower.strip_suffix(*extension).is_some_and(|stem| stem.ends_with('.'));
        extensions.iter().any(stem)
    };
    let listed = Path::new(if folder.is_empty() { "." } else { folder });
    let entries = std::fs::read_dir(expanded(&listed.display().to_string())).ok()?;
    let names = entries.flatten().filter_map(|entry| {
        let name = entry.file_name().into_string().ok().filter(|name| name.starts_with(begun))?;
        match entry.path().is_dir() {
            true => Some(name + MAIN_SEPARATOR_STR),
            false => is_meant(&name).then_some(name),
        }
    });
    let common = names.reduce(|common, name| {
        let equal = common.chars().zip(name.chars()).take_while(|(a, b)| a == b);
        equal.map(|(a, _)| a).collect()
    })?;
    (common.len() > begun.len()).then(|| format!("{folder}{common}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_completed_as_far_as_they_agree() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["scan_a.nii.gz", "scan_b.NII", "notes.txt", "other.nii"] {
            std::fs::write(dir.path().join(name), b"").unwrap();
        }
        for name in ["scans", "zarr"] {
            std::fs::create_dir(dir.path().join(name)).unwrap();
        }
        let typed = |name: &str| dir.path().join(name).display().to_string();
        let completed = |name: &str| completed(&typed(name), &["nii", "gz"]);
        for (begun, whole) in [("s", "scan"), ("scan_a", "scan_a.nii.gz"), ("scan_b", "scan_b.NII")] {
            assert_eq!(completed(begun), Some(typed(whole)), "{begun}");
        }
        assert_eq!(completed("z"), Some(typed("zarr") + MAIN_SEPARATOR_STR));
        for begun in ["scan", "nothing", "notes", "nowhere/at all"] {
            assert_eq!(completed(begun), None, "{begun}");
        }
    }

    #[test]
    fn a_tilde_is_the_home_folder() {
        let Some(home) = dirs::home_dir() else { return };
        assert_eq!(expanded("~/a b"), format!("{}/a b", home.display()));
        for same in ["~a/b", "a/~", "phantom:thorax", ""] {
            assert_eq!(expanded(same), same);
        }
    }
}
