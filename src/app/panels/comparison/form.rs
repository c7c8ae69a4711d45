//! Form for a comparison of shadow methods: methods with settings, sample counts, picture size and output folder.

use crate::app::panels::browse::Browse;
use crate::app::panels::widgets::error_label;
use crate::error::{Error, Result};
use crate::files::output::check_output_dir;
use crate::measure::job::Effort;
use crate::shadow::{COMPARED, Entry, METHODS, Method, parse_list};
use eframe::egui;
use std::path::{Path, PathBuf};

/// Width of the label column in the form for a comparison of shadow methods, screen points.
const LABEL_WIDTH: f32 = 140.0;

/// Entry of a shadow method in the comparison form, with the method's settings as `--methods` takes them.
pub struct MethodRows {
    entry: &'static Entry,
    pub selected: bool,
    pub spec: String,
}

impl MethodRows {
    /// Creates the form entry of a shadow method, with the settings that `umbravox compare` uses by default. Only
    /// methods that it compares by default are selected.
    fn new(entry: &'static Entry) -> Self {
        let is_entry = |spec: &&str| spec.split(':').next().is_some_and(|name| name.trim() == entry.name);
        let default = COMPARED.split(';').find(is_entry);
        Self { entry, selected: default.is_some(), spec: default.unwrap_or(entry.name).trim().to_owned() }
    }

    fn methods(&self) -> Result<Vec<Box<dyn Method>>> {
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

/// Form with the settings of a comparison of shadow methods, as the user edits them.
pub struct Form {
    pub families: Vec<MethodRows>,
    pub effort: Effort,
    /// Width and height of the pictures in a comparison of shadow methods, pixels.
    pub size: [u32; 2],
    pub folder: String,
    /// Whether a comparison of shadow methods resumes from the measurements recorded in its output folder.
    pub resume: bool,
    pub folder_error: Option<Error>,
    browse: Browse,
}

impl Default for Form {
    fn default() -> Self {
        Self {
            families: METHODS.iter().map(|entry| MethodRows::new(entry)).collect(),
            effort: Effort { short_repeats: 0, ..Effort::default() },
            size: [512, 512],
            folder: "comparison".into(),
            resume: true,
            folder_error: None,
            browse: Browse::default(),
        }
    }
}

impl Form {
    /// Shadow methods with settings that are selected in the comparison form. Each becomes one row of the comparison
    /// table.
    ///
    /// # Errors
    /// Invalid settings of a shadow method, or no method is selected.
    pub fn methods(&self) -> Result<Vec<Box<dyn Method>>> {
        let selected = self.families.iter().filter(|f| f.selected);
        let methods = selected.map(MethodRows::methods).collect::<Result<Vec<_>>>()?;
        let methods: Vec<_> = methods.into_iter().flatten().collect();
        match methods.is_empty() {
            true => Err(Error::input("nothing to compare", "methods", "none is chosen")),
            false => Ok(methods),
        }
    }

    /// Output folder for the comparison of shadow methods, as entered in the form.
    ///
    /// # Errors
    /// The entered name is empty, or a folder of this name cannot be used.
    pub fn folder(&self) -> Result<PathBuf> {
        let folder = self.folder.trim();
        if folder.is_empty() {
            return Err(Error::input("cannot write to folder", "folder", "none is named"));
        }
        check_output_dir(Path::new(folder))?;
        Ok(folder.into())
    }

    /// Shows the form for a comparison of shadow methods. `view_size` is the size of the viewer's picture, pixels.
    pub fn show(&mut self, ui: &mut egui::Ui, view_size: Option<[u32; 2]>) {
        let field = (ui.available_width() - LABEL_WIDTH).clamp(120.0, 430.0);
        egui::Grid::new("families").num_columns(2).show(ui, |ui| {
            for family in &mut self.families {
                let Entry { name, summary, keys, .. } = family.entry;
                ui.checkbox(&mut family.selected, *name)
                    .on_hover_text(*summary)
                    .accessible_name(format!("compare {name}"));
                let help = keys
                    .iter()
                    .map(|k| format!("\n{}={} [default: {}] {}", k.name, k.values(), k.default, k.help));
                let edit = egui::TextEdit::singleline(&mut family.spec).desired_width(field);
                ui.add_enabled(family.selected, edit)
                    .on_hover_text(format!("{summary}{}", help.collect::<String>()))
                    .accessible_name(format!("settings of {name}"));
                ui.end_row();
                if let Some(e) = family.selected.then(|| family.methods().err()).flatten() {
                    ui.label("");
                    error_label(ui, &e);
                    ui.end_row();
                }
            }
        });
        ui.weak("A value without `=` is another value of the key before it; every combination is a row.");
        ui.add_space(4.0);
        egui::Grid::new("effort").num_columns(2).show(ui, |ui| {
            let Effort { repeats, points, rays, depths, .. } = &mut self.effort;
            let mut numbers = |label: &str, fields: Vec<(&mut usize, _, &str, &str)>| {
                ui.label(label);
                ui.horizontal(|ui| {
                    for (value, range, name, tooltip) in fields {
                        let range: std::ops::RangeInclusive<i64> = range;
                        let drag = egui::DragValue::new(value);
                        let drag = drag.range(*range.start() as usize..=*range.end() as usize);
                        ui.add(drag).on_hover_text(tooltip).accessible_name(format!("table {name}"));
                        ui.weak(name);
                    }
                });
                ui.end_row();
            };
            numbers("Times", vec![(repeats, Effort::REPEATS, "repeats", "Timed runs of each method")]);
            numbers(
                "Errors",
                vec![
                    (points, Effort::POINTS, "points", "Points visible to the camera"),
                    (rays, Effort::RAYS, "light rays", "Rays through texel centres"),
                    (depths, Effort::DEPTHS, "depths", "Depths on each light ray"),
                ],
            );
            ui.label("Picture").on_hover_text("Pixels");
            ui.horizontal(|ui| {
                for (side, name) in self.size.iter_mut().zip(["table width", "table height"]) {
                    ui.add(egui::DragValue::new(side).range(1..=8192)).accessible_name(name);
                }
                for (text, size) in [("512 x 512", Some([512, 512])), ("as the view", view_size)] {
                    if ui.add_enabled(size.is_some(), egui::Button::new(text).small()).clicked() {
                        self.size = size.unwrap_or(self.size);
                    }
                }
            });
            ui.end_row();
            ui.label("Folder").on_hover_text("For tables, plots, pictures and the report");
            ui.horizontal(|ui| self.folder_field(ui, (field - 70.0).min(360.0)));
            ui.end_row();
            if let Some(e) = &self.folder_error {
                ui.label("");
                error_label(ui, e);
                ui.end_row();
            }
            ui.label("");
            ui.checkbox(&mut self.resume, "Resume").on_hover_text(
                "Reuse rows and timed rounds in the folder that have the same program, adapter, volume, transfer \
                 function, scene and settings. Otherwise the table starts again and its old files are removed",
            );
            ui.end_row();
        });
    }

    fn folder_field(&mut self, ui: &mut egui::Ui, width: f32) {
        let edit = egui::TextEdit::singleline(&mut self.folder).desired_width(width);
        if ui.add(edit).accessible_name("table folder").changed() {
            self.folder_error = None;
        }
        let dialog = || rfd::FileDialog::new().set_title("Folder for the comparison");
        let path = PathBuf::from(self.folder.trim());
        if let Some(folder) = self.browse.show(ui, &path, dialog, |d| d.pick_folder()) {
            (self.folder, self.folder_error) = (folder, None);
        }
        if std::mem::take(&mut self.browse.is_unavailable) {
            let why = "the system shows none; type the folder's name";
            self.folder_error = Some(Error::runtime("cannot choose a folder", "file dialog", why));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_starts_with_the_default_comparison() {
        let form = Form::default();
        let names = |methods: Vec<Box<dyn Method>>| methods.iter().map(|m| m.spec()).collect::<Vec<_>>();
        // Rows with the settings of papers belong to the tables of the command line.
        let compared = parse_list(&COMPARED).unwrap();
        let compared = compared.into_iter().filter(|method| method.spec().paper().is_none()).collect();
        assert_eq!(names(form.methods().unwrap()), names(compared));
        assert_eq!(form.families.len(), METHODS.len());
    }

    #[test]
    fn invalid_settings_and_those_of_other_methods_are_refused() {
        let mut form = Form::default();
        for (spec, why) in
            [("dsm", "`osm` belong here"), ("osm:layers=0", "layers"), ("osm:colour=1", "there is")]
        {
            let family = form.families.iter_mut().find(|f| f.entry.name == "osm").unwrap();
            family.spec = spec.into();
            let e = form.methods().err().unwrap();
            assert!(e.to_string().contains(why), "{spec}: {e}");
        }
        form.families.iter_mut().for_each(|f| f.selected = false);
        assert!(form.methods().err().unwrap().why.contains("none is chosen"));
    }
}
