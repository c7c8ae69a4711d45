//! The shadow methods that are shown, with whatever settings the registry lists, and what they made.

use super::difference::Difference;
use super::flicker;
use super::parts::complaint;
use crate::app::model::Model;
use crate::engine::messages::Side;
use crate::engine::method_choice::MethodChoice;
use crate::shadow::{Key, Kind, METHODS};
use eframe::egui;

/// Width of the buttons beside a setting with the space between them, points.
const BUTTONS_WIDTH: f32 = 122.0;
/// Named values of a setting that fit beside each other.
const MOST_ABREAST: usize = 4;

/// The section of the shadow method, and of the second one.
pub fn show(ui: &mut egui::Ui, model: &mut Model, difference: &mut Difference) {
    let Some(document) = &mut model.document else { return };
    method_editor(ui, "method", &mut document.method);
    ui.add_space(2.0);
    let mut split = model.split.share.is_some();
    let toggle = ui.checkbox(&mut split, "Split view with a second method");
    if toggle.on_hover_text("Drag the line in the view; X switches sides").changed() {
        model.split.set(split);
    }
    if model.split.share.is_some()
        && let Some(document) = &mut model.document
    {
        ui.indent("second", |ui| method_editor(ui, "second method", &mut document.other));
        flicker::controls(model, ui);
    }
    difference.choice(ui);
    let Some(frame) = &model.frame else { return };
    ui.add_space(4.0);
    for side in frame.sides() {
        report(ui, side, frame.other.is_some(), frame.whole);
    }
    egui::CollapsingHeader::new(format!("Left out: {}", frame.main.left_out.len())).show(ui, |ui| {
        for omission in &frame.main.left_out {
            let saved = omission.saved.as_ref().map_or(String::new(), |s| format!(" – {s}"));
            ui.label(format!("{}{saved}", omission.what)).on_hover_text(&omission.why);
            ui.weak(format!("    {}", omission.why));
        }
    });
}

/// What a method has made, as drawn.
fn report(ui: &mut egui::Ui, side: &Side, split: bool, whole: bool) {
    egui::Grid::new(("report", &side.spec, split)).num_columns(2).show(ui, |ui| {
        let mut row = |name: &str, value: String, tooltip: &str| {
            ui.weak(name).on_hover_text(tooltip);
            ui.add(egui::Label::new(value).wrap());
            ui.end_row();
        };
        if split || !whole {
            row("as drawn", side.spec.clone(), "While a hand moves, coarser settings keep the pace");
        }
        row("memory", format!("{:.2} MB", side.report.bytes as f64 * 1e-6), "Bytes that lookups read");
        if let (Some(total), Some(most)) = (side.report.nodes_total, side.report.nodes_max) {
            let per = total as f64 / side.report.texels_hit.unwrap_or(1).max(1) as f64;
            let text = format!("{total}, {per:.1} a texel, at most {most}");
            row("nodes", text, "Of texels that meet anything");
        }
        if let Some(bound) = side.bound {
            let text = format!("± {:.4} within {:.3} mm", bound.transmittance, bound.depth_mm);
            row("promise", text, "Of the exact transmittance, on light rays through texel centres");
        }
    });
}

/// A method of the registry with whatever settings it lists.
fn method_editor(ui: &mut egui::Ui, name: &str, choice: &mut MethodChoice) {
    let response =
        egui::ComboBox::from_id_salt(name).selected_text(choice.name).width(200.0).show_ui(ui, |ui| {
            for entry in METHODS {
                let label =
                    ui.selectable_label(entry.name == choice.name, entry.name).on_hover_text(entry.summary);
                if label.clicked() && entry.name != choice.name {
                    *choice = MethodChoice::of(entry);
                }
            }
        });
    response.response.accessible_name(name);
    let entry = choice.entry();
    ui.add(egui::Label::new(egui::RichText::new(entry.summary).weak().small()).wrap());
    egui::Grid::new((name, choice.name)).num_columns(2).show(ui, |ui| {
        for (key, value) in entry.keys.iter().zip(&mut choice.values) {
            ui.label(key.name).on_hover_text(format!("{} [default: {}]", key.help, key.default));
            setting(ui, name, key, value);
            ui.end_row();
        }
    });
    if let Err(e) = choice.method() {
        complaint(ui, &e);
    }
}

/// One setting: a list where the registry names its values, a field with a slider's range otherwise.
fn setting(ui: &mut egui::Ui, method: &str, key: &Key, value: &mut String) {
    let tooltip = format!("{} ({}) [default: {}]", key.help, key.values(), key.default);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let options = if let Kind::Choice(names) = key.kind { names } else { &[] };
        if options.len() > MOST_ABREAST {
            let list = egui::ComboBox::from_id_salt((method, key.name)).selected_text(value.as_str());
            let list = list.show_ui(ui, |ui| {
                for option in options {
                    ui.selectable_value(value, option.to_string(), *option);
                }
            });
            list.response.on_hover_text(&tooltip).accessible_name(format!("{method} {}", key.name));
            return;
        }
        if options.len() > 1 {
            for option in options {
                if ui.selectable_label(value == option, *option).on_hover_text(&tooltip).clicked() {
                    *value = option.to_string();
                }
            }
            return;
        }
        // What the buttons leave.
        let width = (ui.available_width() - BUTTONS_WIDTH).clamp(36.0, 90.0);
        let edit = egui::TextEdit::singleline(value).desired_width(width);
        ui.add(edit).on_hover_text(&tooltip).accessible_name(format!("{method} {}", key.name));
        // Halves and doubles are what a hand wants of sizes and tolerances alike.
        let number = value.parse::<f64>().ok();
        for (text, factor) in [("÷2", 0.5), ("×2", 2.0)] {
            let button = ui.add_enabled(number.is_some_and(|n| n != 0.0), egui::Button::new(text).small());
            if let Some(number) = number.filter(|_| button.clicked()) {
                let scaled = number * factor;
                let whole = !key.default.contains('.') && number.fract() == 0.0;
                *value = if whole { scaled.round().max(1.0).to_string() } else { scaled.to_string() };
            }
        }
        if value != key.default
            && ui.small_button("reset").on_hover_text(format!("Back to {}", key.default)).clicked()
        {
            *value = key.default.to_owned();
        }
    });
}
