//! What to compare: methods, how much to measure, the picture's size and the folder.

use crate::app::panels::parts::complaint;
use crate::app::panels::prompt::dialog::{Answer, Dialog};
use crate::error::{Error, Result};
use crate::files::output::check_output_dir;
use crate::measure::job::Effort;
use crate::shadow::{COMPARED, Entry, METHODS, Method, parse_list};
use eframe::egui;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Of the column of names, with the space beside it, points.
const NAMES_WIDTH: f32 = 140.0;

/// A family of the registry with its settings as text.
pub struct Family {
    entry: &'static Entry,
    pub wanted: bool,
    /// As `--methods` takes it.
    pub spec: String,
}

impl Family {
    /// As `compare` has it by default; a family that it leaves out is not wanted.
    fn of(entry: &'static Entry) -> Self {
        let of_family = |spec: &&str| spec.split(':').next().is_some_and(|name| name.trim() == entry.name);
        let rows = COMPARED.as_str();
        let default = rows.split(';').find(of_family);
        Self { entry, wanted: default.is_some(), spec: default.unwrap_or(entry.name).trim().to_owned() }
    }

    /// A row each.
    ///
    /// # Errors
    /// As [`parse_list`], or another family's settings.
    pub fn methods(&self) -> Result<Vec<Box<dyn Method>>> {
        let methods = parse_list(&self.spec)?;
        match methods.iter().find(|m| m.name() != self.entry.name) {
            Some(other) => {
                let why = format!("the settings of `{}` belong here", self.entry.name);
                Err(Error::input("bad shadow method", format!("`{}`", other.name()), why))
            }
            None => Ok(methods),
        }
    }
}

/// What is asked for.
pub struct Form {
    pub families: Vec<Family>,
    pub effort: Effort,
    /// Pixels, width and height.
    pub size: [u32; 2],
    pub folder: String,
    /// Go on with what the folder holds.
    pub resume: bool,
    /// What is wrong with the folder, as of the last start or choice.
    pub folder_error: Option<Error>,
    /// The system's dialog, while it is open.
    dialog: Option<Dialog>,
}

impl Default for Form {
    fn default() -> Self {
        Self {
            families: METHODS.iter().map(|entry| Family::of(entry)).collect(),
            effort: Effort::default(),
            size: [512, 512],
            folder: "comparison".into(),
            resume: true,
            folder_error: None,
            dialog: None,
        }
    }
}

impl Form {
    /// The methods that are wanted, a row each.
    ///
    /// # Errors
    /// A family whose text is none, or no method at all.
    pub fn methods(&self) -> Result<Vec<Box<dyn Method>>> {
        let wanted = self.families.iter().filter(|f| f.wanted);
        let methods = wanted.map(Family::methods).collect::<Result<Vec<_>>>()?.into_iter().flatten();
        let methods: Vec<_> = methods.collect();
        if methods.is_empty() {
            return Err(Error::input("nothing to compare", "methods", "none is chosen"));
        }
        Ok(methods)
    }

    /// The folder.
    ///
    /// # Errors
    /// None is named, or a file has its name.
    pub fn folder(&self) -> Result<PathBuf> {
        let folder = self.folder.trim();
        if folder.is_empty() {
            return Err(Error::input("cannot write to folder", "folder", "none is named"));
        }
        check_output_dir(Path::new(folder))?;
        Ok(folder.into())
    }

    /// The fields; `view_size` is that of the view, in pixels.
    pub fn show(&mut self, ui: &mut egui::Ui, view_size: Option<[u32; 2]>) {
        self.take_dialog();
        // What the names beside them leave.
        let field = (ui.available_width() - NAMES_WIDTH).clamp(120.0, 430.0);
        egui::Grid::new("families").num_columns(2).show(ui, |ui| {
            for family in &mut self.families {
                let name = family.entry.name;
                ui.checkbox(&mut family.wanted, name)
                    .on_hover_text(family.entry.summary)
                    .accessible_name(format!("compare {name}"));
                let edit = egui::TextEdit::singleline(&mut family.spec).desired_width(field);
                ui.add_enabled(family.wanted, edit)
                    .on_hover_text(settings_text(family.entry))
                    .accessible_name(format!("settings of {name}"));
                ui.end_row();
                if let Some(e) = family.wanted.then(|| family.methods().err()).flatten() {
                    ui.label("");
                    complaint(ui, &e);
                    ui.end_row();
                }
            }
        });
        ui.weak("A value without `=` is one more for the key before it; every combination is a row.");
        ui.add_space(4.0);
        egui::Grid::new("effort").num_columns(2).show(ui, |ui| {
            ui.label("Times");
            ui.horizontal(|ui| {
                let effort = &mut self.effort;
                count(ui, &mut effort.repeats, Effort::REPEATS, "repeats", "Timed runs of each method");
            });
            ui.end_row();
            ui.label("Errors").on_hover_text("Of transmittance, against the exact one");
            ui.horizontal(|ui| {
                let effort = &mut self.effort;
                count(ui, &mut effort.points, Effort::POINTS, "points", "Points that the camera sees");
                count(ui, &mut effort.rays, Effort::RAYS, "light rays", "Rays through texel centres");
                count(ui, &mut effort.depths, Effort::DEPTHS, "depths", "Depths on each light ray");
            });
            ui.end_row();
            ui.label("Picture").on_hover_text("Pixels");
            ui.horizontal(|ui| {
                for (side, name) in self.size.iter_mut().zip(["table width", "table height"]) {
                    ui.add(egui::DragValue::new(side).range(1..=8192)).accessible_name(name);
                }
                if ui.small_button("512 x 512").clicked() {
                    self.size = [512, 512];
                }
                if let Some(size) = view_size
                    && ui.small_button("as the view").clicked()
                {
                    self.size = size;
                }
            });
            ui.end_row();
            ui.label("Folder").on_hover_text("For tables, plots, pictures and the report");
            ui.horizontal(|ui| {
                let edit = egui::TextEdit::singleline(&mut self.folder).desired_width((field - 70.0).min(360.0));
                if ui.add(edit).accessible_name("table folder").changed() {
                    self.folder_error = None;
                }
                if ui.add_enabled(self.dialog.is_none(), egui::Button::new("Browse…")).clicked() {
                    let title = "Folder for the comparison";
                    self.dialog = Dialog::of_folder(title, Path::new(self.folder.trim()), ui.ctx());
                    self.folder_error = self.dialog.is_none().then(no_dialog);
                }
            });
            ui.end_row();
            if let Some(e) = &self.folder_error {
                ui.label("");
                complaint(ui, e);
                ui.end_row();
            }
            ui.label("");
            ui.checkbox(&mut self.resume, "Go on with what the folder holds").on_hover_text(
                "Rows and timed rounds of the same program, adapter, volume, transfer function, scene and settings are \
                 not measured again, and a folder of another scene is refused; otherwise the table is started anew and \
                 the files of the one that the folder holds are removed",
            );
            ui.end_row();
        });
    }

    fn take_dialog(&mut self) {
        let Some(answer) = self.dialog.as_ref().and_then(Dialog::answer) else { return };
        self.dialog = None;
        match answer {
            Answer::Chosen(path) => {
                self.folder = path.display().to_string();
                self.folder_error = None;
            }
            Answer::Cancelled => {}
            Answer::NoDialog => self.folder_error = Some(no_dialog()),
        }
    }
}

fn no_dialog() -> Error {
    Error::runtime("cannot choose a folder", "file dialog", "the system shows none; type the folder's name")
}

fn count(ui: &mut egui::Ui, value: &mut usize, range: RangeInclusive<i64>, name: &str, tooltip: &str) {
    let drag = egui::DragValue::new(value).range(*range.start() as usize..=*range.end() as usize);
    ui.add(drag).on_hover_text(tooltip).accessible_name(format!("table {name}"));
    ui.weak(name);
}

/// A family's keys, a line each.
fn settings_text(entry: &Entry) -> String {
    let keys =
        entry.keys.iter().map(|k| format!("{}={} [default: {}] {}", k.name, k.values(), k.default, k.help));
    let keys = keys.collect::<Vec<_>>().join("\n");
    if keys.is_empty() { format!("{}: {}", entry.name, entry.summary) } else { keys }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_starts_with_what_compare_measures() {
        let form = Form::default();
        let names = |methods: Vec<Box<dyn Method>>| methods.iter().map(|m| m.spec()).collect::<Vec<_>>();
        assert_eq!(names(form.methods().unwrap()), names(parse_list(&COMPARED).unwrap()));
        assert_eq!(form.families.len(), METHODS.len());
    }

    #[test]
    fn texts_of_other_families_and_bad_ones_are_refused() {
        let mut form = Form::default();
        for (spec, why) in
            [("dsm", "`osm` belong here"), ("osm:layers=0", "layers"), ("osm:colour=1", "there is")]
        {
            let family = form.families.iter_mut().find(|f| f.entry.name == "osm").unwrap();
            family.spec = spec.into();
            let e = form.methods().err().unwrap();
            assert!(e.to_string().contains(why), "{spec}: {e}");
        }
        form.families.iter_mut().for_each(|f| f.wanted = false);
        assert!(form.methods().err().unwrap().why.contains("none is chosen"));
    }
}
