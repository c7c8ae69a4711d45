//! Shadow section of the side panel: the shadow method with its settings, and the build report of its shadow map.

use super::difference::Difference;
use super::widgets::{error_label, property};
use crate::app::model::Model;
use crate::app::split::RATES_HZ;
use crate::engine::messages::MethodFrame;
use crate::error::Error;
use crate::shadow::{Key, Kind, METHODS, MethodSpec};
use eframe::egui;

/// Width of the value buttons beside a setting of a shadow method, screen points.
const BUTTONS_WIDTH: f32 = 122.0;
/// Maximum number of named values of a shadow-method setting that are shown as buttons instead of a list.
const MAX_BUTTONS: usize = 4;
/// Largest number of letters on the buttons of one setting.
const MAX_LETTERS: usize = 22;

/// Settings that are shown before the others, beside the first one of a shadow method, such as `epsilon` or `layers`.
const SHOWN_FIRST: [&str; 2] = ["map", "near"];

/// Shows the shadow section of the side panel: shadow method, settings and build report.
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
        ui.horizontal(|ui| {
            let mut on = model.split.flickers();
            let toggle = ui.checkbox(&mut on, "Flicker");
            if toggle.on_hover_text("Alternates the two pictures over the whole view (F)").changed() {
                model.split.set_flicker(on, ui.input(|i| i.time));
            }
            let rate = egui::DragValue::new(&mut model.settings.flicker_hz).range(RATES_HZ).speed(0.05);
            ui.add(rate.max_decimals(2).suffix(" Hz"))
                .on_hover_text("Changes per second, 0.5 to 8 Hz")
                .accessible_name("flicker rate");
        });
    }
    difference.choice(ui);
    let Some(frame) = &model.frame else { return };
    ui.add_space(4.0);
    for side in frame.sides() {
        report(ui, side, frame.other.is_some(), frame.is_final);
    }
    egui::CollapsingHeader::new(format!("Skipped: {}", frame.main.skipped.len())).show(ui, |ui| {
        for omission in &frame.main.skipped {
            let saved = omission.saved.as_ref().map_or(String::new(), |s| format!(" – {s}"));
            ui.label(format!("{}{saved}", omission.what)).on_hover_text(&omission.why);
            ui.weak(format!("    {}", omission.why));
        }
    });
}

/// Shows the build report of a shadow map: memory, number of curve nodes and error bound.
fn report(ui: &mut egui::Ui, side: &MethodFrame, split: bool, is_final: bool) {
    egui::Grid::new(("report", &side.spec, split)).num_columns(2).show(ui, |ui| {
        let mut row = |name, value, tooltip| property(ui, name, value, tooltip);
        if split || !is_final {
            row("as drawn", side.spec.clone(), "Coarser settings during interaction");
        }
        row("memory", format!("{:.2} MB", side.report.bytes as f64 * 1e-6), "Bytes that lookups read");
        if let (Some(total), Some(most)) = (side.report.nodes_total, side.report.nodes_max) {
            let per = total as f64 / side.report.texels_hit.unwrap_or(1).max(1) as f64;
            let text = format!("{total}, {per:.1} a texel, at most {most}");
            row("nodes", text, "Texels that hit anything");
        }
        if let Some(bound) = side.bound {
            let text = format!("± {:.4} within {:.3} mm", bound.transmittance, bound.depth_mm);
            row("error bound", text, "On transmittance, along light rays through texel centres");
            let depth_mm = bound.depth_mm + bound.align_mm;
            let text = format!("± {:.4} within {depth_mm:.3} mm, {:.2} mm aside", bound.transmittance, bound.reach_mm);
            let tooltip = "On transmittance at any point: beyond the extremes of the exact one within these distances along \
                the light ray and aside. It does not cover pixels";
            row("at points", text, tooltip);
        }
    });
}

/// Shows controls to choose a shadow method and edit its settings.
fn method_editor(ui: &mut egui::Ui, name: &str, spec: &mut MethodSpec) {
    let shown = spec.entry().name;
    let response = egui::ComboBox::from_id_salt(name).selected_text(shown).width(200.0).show_ui(ui, |ui| {
        for entry in METHODS {
            let label = ui.selectable_label(entry.name == shown, entry.name).on_hover_text(entry.summary);
            if label.clicked() && entry.name != shown {
                *spec = MethodSpec::default_of(entry);
            }
        }
    });
    response.response.accessible_name(name);
    let entry = spec.entry();
    ui.add(egui::Label::new(egui::RichText::new(entry.summary).weak().small()).wrap());
    let mut invalid = None;
    let (first, more): (Vec<_>, Vec<_>) =
        entry.keys.iter().enumerate().partition(|(at, key)| *at == 0 || SHOWN_FIRST.contains(&key.name));
    let [first, more] = [first, more].map(|keys| keys.into_iter().map(|(_, key)| key).collect::<Vec<_>>());
    settings_grid(ui, name, spec, &first, &mut invalid);
    if !more.is_empty() {
        more_settings(ui, name, spec, &more, &mut invalid);
    }
    if let Some(e) = invalid {
        error_label(ui, &e);
    }
}

/// Shows the less common settings of a shadow method, folded until the user opens them. They open by themselves when one
/// of them is no longer at its default, such as with a method from a scene file.
fn more_settings(
    ui: &mut egui::Ui,
    name: &str,
    spec: &mut MethodSpec,
    keys: &[&Key],
    invalid: &mut Option<Error>,
) {
    let is_changed =
        |key: &&&Key| spec.value(key.name).is_some_and(|value| Some(value) != key.parse(key.default));
    let changed = keys.iter().filter(is_changed).count();
    let title = if changed == 0 { "More".to_owned() } else { format!("More ({changed} changed)") };
    let id = ui.scope_id().with((name, spec.entry().name, "more"));
    let was_changed = ui.data(|d| d.get_temp::<bool>(id)).unwrap_or(false);
    ui.data_mut(|d| d.insert_temp(id, changed > 0));
    let opened = (changed > 0 && !was_changed).then_some(true);
    let header = egui::CollapsingHeader::new(title).id_salt(id).open(opened);
    let response = header.show_unindented(ui, |ui| settings_grid(ui, name, spec, keys, invalid));
    response.header_response.on_hover_text("Other settings of this shadow method");
}

/// Shows some settings of a shadow method, a row each. An invalid text is reported in `invalid` and changes nothing.
fn settings_grid(
    ui: &mut egui::Ui,
    name: &str,
    spec: &mut MethodSpec,
    keys: &[&Key],
    invalid: &mut Option<Error>,
) {
    let entry = spec.entry();
    let first = keys.first().map(|key| key.name);
    egui::Grid::new((name, entry.name, first)).num_columns(2).show(ui, |ui| {
        for key in keys {
            let Some(value) = spec.value(key.name) else { continue };
            ui.label(key.name).on_hover_text(format!("{} [default: {}]", key.help, key.default));
            // A typed text stays as it is, valid or not, until the value changes elsewhere.
            let id = ui.scope_id().with((name, entry.name, key.name));
            let typed = ui.data(|d| d.get_temp::<(String, String)>(id));
            let typed = typed.filter(|(_, of)| *of == value.to_string());
            let mut text = typed.map_or_else(|| value.to_string(), |(text, _)| text);
            setting(ui, name, key, &mut text);
            match spec.clone().with(key.name, text.trim()) {
                Some(changed) => *spec = changed,
                None => *invalid = format!("{}:{}={text}", entry.name, key.name).parse::<MethodSpec>().err(),
            }
            let now = spec.value(key.name).unwrap_or(value).to_string();
            ui.data_mut(|d| d.insert_temp(id, (text, now)));
            ui.end_row();
        }
    });
}

/// Shows the control for one setting of a shadow method: buttons or a list for named values, or else a text field.
fn setting(ui: &mut egui::Ui, method: &str, key: &Key, value: &mut String) {
    let tooltip = format!("{} ({}) [default: {}]", key.help, key.values(), key.default);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let options = if let Kind::Choice(names) = key.kind { names } else { &[] };
        let letters = options.iter().map(|option| option.len()).sum::<usize>();
        if options.len() > MAX_BUTTONS || letters > MAX_LETTERS {
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
        let width = (ui.available_width() - BUTTONS_WIDTH).clamp(36.0, 90.0);
        let edit = egui::TextEdit::singleline(value).desired_width(width);
        ui.add(edit).on_hover_text(&tooltip).accessible_name(format!("{method} {}", key.name));
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
