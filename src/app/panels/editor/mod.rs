//! Transfer-function editor: histogram, opacity curve, control points and colour bar.

mod paint;
mod plot;

use super::presets::Presets;
use super::prompt::{Prompt, Purpose};
use super::widgets::unfilled;
use crate::app::curve::{AmountAxis, Edit, top_of};
use crate::app::model::Model;
use crate::files::color;
use crate::transfer::Quantity;
use eframe::egui;
use eframe::egui_wgpu::RenderState;
pub(super) use paint::short;
use std::sync::Arc;

/// Width of the transfer-function editor below which the fields of the selected control point take two lines, screen
/// points.
const POINT_ROW_WIDTH: f32 = 500.0;

/// Minimum height of the transfer-function editor, and of the picture above it, screen points.
const MIN_HEIGHT: f32 = 170.0;
const MIN_VIEW_HEIGHT: f32 = 120.0;

/// Shows the transfer-function editor while a volume is open.
pub fn show(
    ui: &mut egui::Ui,
    model: &mut Model,
    presets: &mut Presets,
    (prompt, gradient_open): (&mut Prompt, &mut bool),
    render_state: Option<&RenderState>,
) {
    if model.document.is_none() {
        return;
    }
    // In a low window, the picture takes half of the height.
    let most = (0.5 * ui.available_height()).max(MIN_HEIGHT);
    egui::Panel::bottom("editor")
        .frame(unfilled(ui))
        .resizable(true)
        .default_size(250.0_f32.min(most))
        .min_size(MIN_HEIGHT)
        .max_size(ui.available_height() - MIN_VIEW_HEIGHT)
        .show(ui, |ui| {
            ui.add_space(4.0);
            tools(ui, model, presets, (prompt, gradient_open), render_state);
            point_row(ui, model);
            ui.add_space(2.0);
            plot::show(ui, model);
        });
}

fn tools(
    ui: &mut egui::Ui,
    model: &mut Model,
    presets: &mut Presets,
    (prompt, gradient_open): (&mut Prompt, &mut bool),
    render_state: Option<&RenderState>,
) {
    let [can_undo, can_redo] =
        model.document.as_ref().map_or([false; 2], |document| document.history.is_possible(&document.tf));
    ui.horizontal_wrapped(|ui| {
        ui.strong("Transfer function");
        presets.show(ui, model, render_state);
        let tooltip = "Load a file of this program (.json), ParaView, 3D Slicer, MRIcroGL, NiiVue or Inviwo";
        if ui.button("Load…").on_hover_text(tooltip).clicked() {
            prompt.ask(model, Purpose::LoadTransfer);
        }
        if ui.button("Save…").on_hover_text("Save the function as a .json file").clicked() {
            prompt.ask(model, Purpose::SaveTransfer);
        }
        ui.separator();
        let undo = ui.add_enabled(can_undo, egui::Button::new("Undo"));
        if undo.on_hover_text("Ctrl+Z").clicked() {
            model.undo();
        }
        let redo = ui.add_enabled(can_redo, egui::Button::new("Redo"));
        if redo.on_hover_text("Ctrl+Shift+Z").clicked() {
            model.redo();
        }
        ui.separator();
        let log = &mut model.settings.amount_axis;
        ui.label("Axis");
        ui.selectable_value(log, AmountAxis::Linear, "linear").on_hover_text("Linear scale");
        ui.selectable_value(log, AmountAxis::Logarithmic, "log")
            .on_hover_text("Logarithmic scale of four decades, for low opacities");
        ui.separator();
        ui.label("Histogram");
        ui.toggle_value(&mut model.settings.log_histogram, "log")
            .on_hover_text("Counts on a logarithmic scale");
        ui.toggle_value(&mut model.settings.gradient_histogram, "gradient")
            .on_hover_text("Weighted by the gradient magnitude: peaks are boundaries");
        ui.separator();
        opacity_scale(ui, model);
        if ui.button("Fit").on_hover_text("Show all values of the volume (the wheel zooms)").clicked()
            && let Some(document) = &mut model.document
        {
            document.value_window = None;
        }
        ui.toggle_value(gradient_open, "Gradient…")
            .on_hover_text("Factor on the extinction by gradient magnitude, over the joint histogram");
    });
}

/// Shows a field for the opacity scale of the transfer function, relative to the function as loaded.
fn opacity_scale(ui: &mut egui::Ui, model: &mut Model) {
    let Some(document) = &model.document else { return };
    // The scale changes the reference length, which only opacities have.
    if document.tf.quantity != Quantity::Opacity || document.tf_source.1.quantity != Quantity::Opacity {
        return;
    }
    let now = document.tf_source.1.reference_length_mm / document.tf.reference_length_mm;
    let mut factor = now;
    let drag = egui::DragValue::new(&mut factor)
        .speed(0.01 * now)
        .range(1e-6..=1e6)
        .max_decimals(4)
        .prefix("Opacity x ");
    let drag = ui.add(drag).accessible_name("opacity scale");
    if drag.on_hover_text("Factor of the extinction relative to the loaded function").changed() {
        model.edit(Edit::Scale { factor: factor / now });
    }
    ui.separator();
}

/// Shows fields for the value, opacity and colour of the control point selected in the transfer-function editor.
fn point_row(ui: &mut egui::Ui, model: &mut Model) {
    let Some(document) = &mut model.document else { return };
    let tf = Arc::clone(&document.tf);
    let [lo, hi] = document.volume.value_range();
    let mut edits = Vec::new();
    let mut selected = document.selected.filter(|i| *i < tf.points.len());
    // A constant height keeps the curve in place when a point is selected.
    let rows = if ui.available_width() < POINT_ROW_WIDTH { 2.0 } else { 1.0 };
    let height = rows * ui.spacing().interact_size.y + (rows - 1.0) * ui.spacing().item_spacing.y;
    let row = egui::vec2(ui.available_width(), height);
    let layout = egui::Layout::left_to_right(egui::Align::Center).with_main_wrap(true);
    ui.allocate_ui_with_layout(row, layout, |ui| {
        ui.set_min_size(row);
        let Some(index) = selected else {
            let hint = "Drag a point; double-click to add one; drag beside them to shift (left, right) and scale (up, down) all. \
                Right-click a point for more.";
            ui.add(egui::Label::new(egui::RichText::new(hint).weak()).truncate());
            return;
        };
        let point = tf.points[index];
        ui.label(format!("Point {} of {}", index + 1, tf.points.len()));
        let mut value = point.value;
        let speed = ((hi - lo) / 500.0).max(1e-9);
        let unit = if tf.units.is_empty() { String::new() } else { format!(" {}", tf.units) };
        let drag = egui::DragValue::new(&mut value).speed(speed).max_decimals(4).suffix(unit);
        if ui.add(drag).accessible_name("point value").on_hover_text("Value").changed() {
            edits.push(Edit::Move { index, value, amount: point.amount });
        }
        let mut amount = point.amount;
        let (what, unit) = match tf.quantity {
            Quantity::Opacity => ("Opacity per reference length, 0 to 1", ""),
            Quantity::Extinction => ("Extinction, 1/mm", " /mm"),
        };
        let speed = (0.01 * point.amount).clamp(1e-5 * top_of(&tf), 0.01 * top_of(&tf));
        let drag = egui::DragValue::new(&mut amount)
            .speed(speed)
            .range(0.0..=if tf.quantity == Quantity::Opacity { 1.0 } else { 1e6 })
            .min_decimals(3)
            .max_decimals(6)
            .suffix(unit);
        if ui.add(drag).accessible_name("point opacity").on_hover_text(what).changed() {
            edits.push(Edit::Move { index, value: point.value, amount });
        }
        let mut rgb = point.color.map(color::srgb8_from_linear);
        if ui.color_edit_button_srgb(&mut rgb).on_hover_text("Colour").changed() {
            let color = rgb.map(|c| color::linear_from_srgb(f64::from(c) / 255.0));
            edits.push(Edit::Color { index, color });
        }
        if ui.button("Jump").on_hover_text("Add a second point of this value, for a jump of the curve").clicked() {
            let amount = if point.amount > 0.5 * top_of(&tf) { 0.0 } else { (2.0 * point.amount).max(0.1 * top_of(&tf)) };
            edits.push(Edit::Jump { index, amount });
        }
        let remove = ui.add_enabled(tf.points.len() > 1, egui::Button::new("Remove"));
        if remove.on_hover_text("Delete").clicked() {
            edits.push(Edit::Remove { index });
            selected = None;
        }
        let extinction = tf.extinction_of_amount(point.amount);
        let of_length = format!("{extinction:.5} /mm · {} mm", short(tf.reference_length_mm));
        let label = egui::Label::new(egui::RichText::new(&of_length).weak()).truncate();
        ui.add(label).on_hover_text(format!("{of_length}: extinction at this point, reference length of an opacity"));
    });
    document.selected = selected;
    edits.into_iter().for_each(|edit| model.edit(edit));
}
