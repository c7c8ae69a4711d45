//! Menu bar of the viewer window.

use super::prompt::Purpose;
use super::widgets::unfilled;
use super::windows::Windows;
use crate::app::model::Model;
use crate::files::input::source_name;
use crate::phantom::Phantom;
use crate::scene::AXIS_VIEWS;
use crate::strands::StrandSet;
use eframe::egui;
use std::sync::atomic::Ordering;

/// Width above which the path of a recently opened volume is shortened in the menu, screen points.
const RECENT_WIDTH: f32 = 380.0;

/// Shows the menu bar of the viewer window.
pub fn show(ui: &mut egui::Ui, model: &mut Model, windows: &mut Windows) {
    egui::Panel::top("menu").frame(unfilled(ui)).show(ui, |ui| {
        egui::MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| file_menu(ui, model, windows));
            ui.menu_button("View", |ui| view_menu(ui, model));
            if ui.button("Help").on_hover_text("Keys and pointer (F1)").clicked() {
                windows.help = !windows.help;
            }
            ui.separator();
            // From the right, so that the file name takes the remaining width.
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                status(ui, model, windows);
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    let Some(document) = &model.document else { return };
                    let source = &document.volume.provenance.source;
                    ui.add(egui::Label::new(egui::RichText::new(source_name(source)).strong()).truncate())
                        .on_hover_text(source);
                });
            });
        });
    });
}

/// Shows the theme button and the progress of background tasks at the right end of the menu bar.
fn status(ui: &mut egui::Ui, model: &mut Model, windows: &mut Windows) {
    let (now, other) = if model.settings.dark { ("dark", "light") } else { ("light", "dark") };
    let theme = ui.button(format!("Theme: {now}"));
    if theme.on_hover_text(format!("Change to the {other} theme")).clicked() {
        model.settings.dark = !model.settings.dark;
    }
    if let Some(exporting) = &model.exporting {
        if ui.button("Cancel").on_hover_text("End the export").clicked() {
            exporting.cancelled.store(true, Ordering::Relaxed);
        }
        let bar = egui::ProgressBar::new(exporting.share).desired_width(120.0).show_percentage();
        ui.add(bar).on_hover_text(&exporting.path);
        ui.label("Exporting");
    }
    if let Some(share) = windows.comparison.share() {
        let text = format!("Comparing {:.0} %", 100.0 * share);
        if ui.button(text).on_hover_text("Show the comparison (T)").clicked() {
            windows.comparison.open = !windows.comparison.open;
        }
    }
}

/// Shows one menu entry with its keyboard shortcut. Returns whether the user chose it.
fn entry(ui: &mut egui::Ui, enabled: bool, text: &str, keys: &str, tooltip: &str) -> bool {
    let button = ui.add_enabled(enabled, egui::Button::new(text).shortcut_text(keys));
    let chosen = if tooltip.is_empty() { button } else { button.on_hover_text(tooltip) }.clicked();
    if chosen {
        ui.close();
    }
    chosen
}

fn file_menu(ui: &mut egui::Ui, model: &mut Model, windows: &mut Windows) {
    let has_document = model.document.is_some();
    if entry(ui, true, "Open…", "Ctrl+O", "") {
        windows.prompt.ask(model, Purpose::OpenVolume);
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
    ui.add_enabled_ui(!model.settings.recent.is_empty(), |ui| {
        ui.menu_button("Recent", |ui| {
            ui.set_max_width(RECENT_WIDTH);
            for source in &model.settings.recent {
                if ui.add(egui::Button::new(source).truncate()).on_hover_text(source).clicked() {
                    chosen = Some(source.clone());
                }
            }
        });
    });
    if let Some(source) = chosen {
        model.open_source(&source);
        ui.close();
    }
    ui.separator();
    let tooltip = "A .toml file for the command line, which draws identical pixels";
    if entry(ui, has_document, "Save scene…", "Ctrl+S", tooltip) {
        windows.prompt.ask(model, Purpose::SaveScene);
    }
    if entry(ui, has_document, "Export picture…", "Ctrl+E", "PNG, EXR or NPY of any size") {
        windows.prompt.ask(model, Purpose::ExportPicture);
    }
    let tooltip = "Errors and times of several methods as tables, plots and a report";
    if entry(ui, has_document, "Compare methods…", "T", tooltip) {
        windows.comparison.open = !windows.comparison.open;
    }
    ui.separator();
    if ui.button("Quit").clicked() {
        ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
    }
}

fn view_menu(ui: &mut egui::Ui, model: &mut Model) {
    for (i, view) in AXIS_VIEWS.iter().enumerate() {
        let text = format!("From {}", view.name.to_lowercase());
        if entry(ui, true, &text, &(i + 1).to_string(), "") {
            model.look_from(i);
        }
    }
    if entry(ui, true, "Reset camera", "Home", "") {
        model.reset_camera();
    }
    ui.separator();
    ui.checkbox(&mut model.settings.slices, "Slices");
    ui.checkbox(&mut model.settings.marks, "Anatomical letters");
    ui.checkbox(&mut model.settings.cube, "Orientation cube");
    let mut split = model.split.share.is_some();
    if ui.checkbox(&mut split, "Split view").changed() {
        model.split.set(split);
    }
}
