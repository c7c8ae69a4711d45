//! The menus, and what is open.

use super::App;
use super::camera::AXIS_VIEWS;
use super::prompt::Purpose;
use crate::strands::StrandSet;
use crate::volume::Phantom;
use eframe::egui;

impl App {
    pub(super) fn top_bar(&mut self, ui: &mut egui::Ui) {
        egui::Panel::top("menu").frame(super::unfilled(ui)).show(ui, |ui| {
            egui::MenuBar::new().ui(ui, |ui| {
                ui.menu_button("File", |ui| self.file_menu(ui));
                ui.menu_button("View", |ui| self.view_menu(ui));
                if ui.button("Help").on_hover_text("Keys and hands (F1)").clicked() {
                    self.show_help = !self.show_help;
                }
                ui.separator();
                if let Some(document) = &self.document {
                    let source = &document.volume.provenance.source;
                    let name = source.rsplit(['/', '\\']).next().unwrap_or(source);
                    ui.add(egui::Label::new(egui::RichText::new(name).strong()).truncate())
                        .on_hover_text(source);
                }
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    let icon = if self.settings.dark { "Light" } else { "Dark" };
                    if ui.button(icon).on_hover_text("Light or dark appearance").clicked() {
                        self.settings.dark = !self.settings.dark;
                    }
                    if let Some(exporting) = &self.exporting {
                        if ui.button("Cancel").clicked() {
                            self.worker.cancel_export();
                        }
                        let bar =
                            egui::ProgressBar::new(exporting.share).desired_width(160.0).show_percentage();
                        ui.add(bar).on_hover_text(&exporting.path);
                        ui.label("Exporting");
                    }
                    if let Some(share) = self.comparison.share() {
                        let text = format!("Comparing {:.0} %", 100.0 * share);
                        if ui.button(text).on_hover_text("Shows the comparison (T)").clicked() {
                            self.toggle_comparison();
                        }
                    }
                });
            });
        });
    }

    fn file_menu(&mut self, ui: &mut egui::Ui) {
        let has_document = self.document.is_some();
        if ui.add(egui::Button::new("Open…").shortcut_text("Ctrl+O")).clicked() {
            self.ask_path(Purpose::OpenVolume);
            ui.close();
        }
        let mut chosen = None;
        ui.menu_button("Built-in", |ui| {
            for phantom in Phantom::ALL {
                if ui.button(phantom.name()).on_hover_text(phantom.description()).clicked() {
                    chosen = Some(format!("phantom:{}", phantom.name()));
                }
            }
            ui.separator();
            for set in StrandSet::ALL {
                if ui.button(set.name()).on_hover_text(set.description()).clicked() {
                    chosen = Some(format!("phantom:{}", set.name()));
                }
            }
        });
        ui.add_enabled_ui(!self.settings.recent.is_empty(), |ui| {
            ui.menu_button("Recent", |ui| {
                for source in &self.settings.recent {
                    if ui.button(source).clicked() {
                        chosen = Some(source.clone());
                    }
                }
            });
        });
        if let Some(source) = chosen {
            self.open_source(&source);
            ui.close();
        }
        ui.separator();
        let mut item = |text: &str, keys: &str, tooltip: &str, purpose: Purpose| {
            let button = egui::Button::new(text).shortcut_text(keys);
            if ui.add_enabled(has_document, button).on_hover_text(tooltip).clicked() {
                self.ask_path(purpose);
                ui.close();
            }
        };
        item(
            "Save scene…",
            "Ctrl+S",
            "A .toml file that the command line draws to the same pixels",
            Purpose::SaveScene,
        );
        item("Export picture…", "Ctrl+E", "PNG, EXR or NPY of any size", Purpose::ExportPicture);
        let compare = egui::Button::new("Compare methods…").shortcut_text("T");
        let tooltip = "Errors and times of several methods on what is shown, as tables, plots and a report";
        if ui.add_enabled(has_document, compare).on_hover_text(tooltip).clicked() {
            self.toggle_comparison();
            ui.close();
        }
        ui.separator();
        if ui.button("Quit").clicked() {
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn view_menu(&mut self, ui: &mut egui::Ui) {
        for (i, view) in AXIS_VIEWS.iter().enumerate() {
            if ui
                .add(
                    egui::Button::new(format!("From {}", view.name.to_lowercase()))
                        .shortcut_text((i + 1).to_string()),
                )
                .clicked()
            {
                self.look_from(i);
                ui.close();
            }
        }
        if ui.add(egui::Button::new("Reset camera").shortcut_text("Home")).clicked() {
            self.reset_camera();
            ui.close();
        }
        ui.separator();
        ui.checkbox(&mut self.settings.slices, "Slices");
        ui.checkbox(&mut self.settings.marks, "Anatomical marks");
        let mut split = self.split.is_some();
        if ui.checkbox(&mut split, "Split view").changed() {
            self.set_split(split);
        }
    }
}
