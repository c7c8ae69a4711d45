//! The transfer-function editor: the volume's histogram with the opacity curve over it, points to drag, a colour bar.

mod paint;

use super::curve::{AmountAxis, Edit, top_of};
use super::prompt::Purpose;
use super::{App, grips};
use crate::files::color;
use crate::transfer::Quantity;
use eframe::egui::{self, Color32, FontId, Rect, Sense, Stroke, pos2, vec2};
use eframe::egui_wgpu::RenderState;
use paint::{Map, add_bar, add_histogram, paint_axes, paint_curve, short};

const BAR_HEIGHT: f32 = 16.0;
const GRIP: f32 = 6.0;

/// What the editor remembers between frames.
#[derive(Default)]
pub struct EditorState {
    /// Values at the left and right edge; `None`: all of the volume's.
    pub range: Option<[f64; 2]>,
    pub selected: Option<usize>,
    /// The value of the sample that was probed last.
    pub picked: Option<f64>,
}

impl App {
    pub(super) fn editor_panel(&mut self, ui: &mut egui::Ui, render_state: Option<&RenderState>) {
        if self.document.is_none() {
            return;
        }
        egui::Panel::bottom("editor")
            .frame(super::unfilled(ui))
            .resizable(true)
            .default_size(250.0)
            .min_size(170.0)
            .show(ui, |ui| {
                ui.add_space(4.0);
                self.editor_tools(ui, render_state);
                self.point_row(ui);
                ui.add_space(2.0);
                self.plot(ui);
            });
    }

    fn editor_tools(&mut self, ui: &mut egui::Ui, render_state: Option<&RenderState>) {
        ui.horizontal_wrapped(|ui| {
            ui.strong("Transfer function");
            self.preset_list(ui, render_state);
            if ui.button("Load…").on_hover_text("Read a .json file").clicked() {
                self.ask_path(Purpose::LoadTransfer);
            }
            if ui.button("Save…").on_hover_text("Write the function as a .json file").clicked() {
                self.ask_path(Purpose::SaveTransfer);
            }
            ui.separator();
            let undo = ui.add_enabled(self.history.can_undo(), egui::Button::new("Undo"));
            if undo.on_hover_text("Ctrl+Z").clicked() {
                self.undo();
            }
            let redo = ui.add_enabled(self.history.can_redo(), egui::Button::new("Redo"));
            if redo.on_hover_text("Ctrl+Shift+Z").clicked() {
                self.redo();
            }
            ui.separator();
            let log = &mut self.settings.amount_axis;
            ui.label("Axis");
            ui.selectable_value(log, AmountAxis::Linear, "linear").on_hover_text("Opacity from 0 to the top");
            ui.selectable_value(log, AmountAxis::Logarithmic, "log")
                .on_hover_text("Four decades of opacity: low ones are set finely");
            ui.separator();
            ui.label("Histogram");
            ui.toggle_value(&mut self.settings.log_histogram, "log")
                .on_hover_text("Counts on a logarithmic scale");
            ui.toggle_value(&mut self.settings.gradient_histogram, "gradient").on_hover_text(
                "Each voxel weighs as much as the value changes there, per mm: peaks are boundaries",
            );
            ui.separator();
            if ui.button("Fit").on_hover_text("Show all values of the volume (the wheel zooms)").clicked() {
                self.editor.range = None;
            }
        });
    }

    /// Exact values of the selected point.
    fn point_row(&mut self, ui: &mut egui::Ui) {
        let Some(document) = &self.document else { return };
        let tf = std::sync::Arc::clone(&document.tf);
        let [lo, hi] = document.volume.value_range();
        let mut edits = Vec::new();
        let mut selected = self.editor.selected.filter(|i| *i < tf.points.len());
        ui.horizontal(|ui| {
            let Some(index) = selected else {
                let hint = "Drag a point; double-click to add one; drag beside them to shift (left, right) and spread (up, down) all. \
                    Right-click a point for more.";
                ui.weak(hint);
                return;
            };
            let point = tf.points[index];
            ui.label(format!("Point {} of {}", index + 1, tf.points.len()));
            let mut value = point.value;
            let speed = ((hi - lo) / 500.0).max(1e-9);
            let unit = if tf.units.is_empty() { String::new() } else { format!(" {}", tf.units) };
            let drag = egui::DragValue::new(&mut value).speed(speed).max_decimals(4).suffix(unit);
            if labelled(ui.add(drag), "point value").on_hover_text("Value").changed() {
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
            if labelled(ui.add(drag), "point opacity").on_hover_text(what).changed() {
                edits.push(Edit::Move { index, value: point.value, amount });
            }
            let mut rgb = point.color.map(color::srgb8_from_linear);
            if ui.color_edit_button_srgb(&mut rgb).on_hover_text("Colour").changed() {
                let color = rgb.map(|c| color::linear_from_srgb(f64::from(c) / 255.0));
                edits.push(Edit::Color { index, color });
            }
            if ui.button("Jump").on_hover_text("Add a second point of this value: the curve jumps there").clicked() {
                let amount = if point.amount > 0.5 * top_of(&tf) { 0.0 } else { (2.0 * point.amount).max(0.1 * top_of(&tf)) };
                edits.push(Edit::Jump { index, amount });
            }
            let remove = ui.add_enabled(tf.points.len() > 1, egui::Button::new("Remove"));
            if remove.on_hover_text("Delete").clicked() {
                edits.push(Edit::Remove { index });
                selected = None;
            }
            ui.separator();
            ui.weak(format!("{:.5} /mm", tf.extinction_of_amount(point.amount)))
                .on_hover_text("Extinction at this point");
            ui.weak(format!("{} mm", tf.reference_length_mm)).on_hover_text("Reference length of an opacity");
        });
        self.editor.selected = selected;
        edits.into_iter().for_each(|edit| self.edit(edit));
    }

    fn plot(&mut self, ui: &mut egui::Ui) {
        let Some(document) = &self.document else { return };
        let (tf, histogram) =
            (std::sync::Arc::clone(&document.tf), std::sync::Arc::clone(&document.histogram));
        // All that is left, to the last point: a panel takes the height that its contents take.
        let whole = ui.available_rect_before_wrap();
        ui.allocate_rect(whole, Sense::hover());
        let whole = whole.shrink(2.0);
        if whole.width() < 40.0 || whole.height() < 50.0 {
            return;
        }
        let rect = Rect::from_min_max(
            pos2(whole.left() + 46.0, whole.top() + 2.0),
            pos2(whole.right() - 4.0, whole.bottom() - BAR_HEIGHT - 18.0),
        );
        let range = self.editor.range.unwrap_or_else(|| padded(histogram.range));
        let map = Map { rect, range, axis: self.settings.amount_axis, top: top_of(&tf) };
        let response = ui.interact(rect, ui.scope_id().with("curve"), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, "opacity curve"));
        let bar = Rect::from_min_max(
            pos2(rect.left(), rect.bottom() + 3.0),
            pos2(rect.right(), rect.bottom() + 3.0 + BAR_HEIGHT),
        );

        let painter = ui.painter_at(whole);
        let visuals = ui.visuals().clone();
        let mut back = egui::Mesh::default();
        back.add_colored_rect(rect, visuals.extreme_bg_color);
        let columns = visuals.weak_text_color().gamma_multiply(0.45);
        add_histogram(&mut back, &map, &histogram, &self.settings, columns);
        add_bar(&mut back, bar, &map, &tf);
        painter.add(back);
        let inside = ui.painter_at(rect);
        paint_axes(&painter, &map, &tf, bar.bottom(), visuals.weak_text_color());
        paint_curve(&inside, &map, &tf, visuals.strong_text_color());
        if let Some(value) = self.editor.picked {
            let x = map.x(value);
            inside.vline(x, rect.y_range(), Stroke::new(1.0, Color32::from_rgb(255, 200, 60)));
            inside.text(
                pos2(x + 4.0, rect.top() + 2.0),
                egui::Align2::LEFT_TOP,
                format!("probe {}", short(value)),
                FontId::proportional(11.0),
                Color32::from_rgb(255, 200, 60),
            );
        }

        let mut edits = Vec::new();
        self.zoom_range(ui, &response, &map);
        let mut over_point = false;
        let places: Vec<egui::Pos2> =
            tf.points.iter().map(|p| pos2(map.x(p.value), map.y(p.amount))).collect();
        let hand = ui.input(|i| i.pointer.hover_pos()).filter(|p| rect.expand(GRIP).contains(*p));
        for index in grips::order(&places, hand, self.editor.selected) {
            let (point, at) = (&tf.points[index], places[index]);
            if !rect.expand(GRIP).contains(at) {
                continue;
            }
            let grip = ui.interact(
                Rect::from_center_size(at, vec2(3.0 * GRIP, 3.0 * GRIP)),
                ui.scope_id().with(("point", index)),
                Sense::click_and_drag(),
            );
            grip.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::Button, true, format!("point {}", index + 1))
            });
            over_point |= grip.hovered() || grip.dragged();
            if grip.drag_started() || grip.clicked() {
                self.editor.selected = Some(index);
            }
            if grip.dragged()
                && let Some(p) = grip.interact_pointer_pos()
            {
                edits.push(Edit::Move { index, value: map.value(p.x), amount: map.amount(p.y) });
            }
            let [r, g, b] = point.color.map(color::srgb8_from_linear);
            let radius =
                if self.editor.selected == Some(index) || grip.hovered() { GRIP + 1.0 } else { GRIP - 1.0 };
            let ring = if self.editor.selected == Some(index) {
                visuals.selection.bg_fill
            } else {
                visuals.strong_text_color()
            };
            painter.circle(at, radius, Color32::from_rgb(r, g, b), Stroke::new(2.0, ring));
            let menu = grip.on_hover_text(format!(
                "{} {}, {} {}",
                short(point.value),
                tf.units,
                short(point.amount),
                if tf.quantity == Quantity::Opacity { "opacity" } else { "per mm" }
            ));
            menu.context_menu(|ui| {
                if ui.button("Make a jump").clicked() {
                    edits.push(Edit::Jump {
                        index,
                        amount: if point.amount > 0.5 * map.top { 0.0 } else { 0.8 * map.top },
                    });
                    ui.close();
                }
                if ui.button("Remove").clicked() {
                    edits.push(Edit::Remove { index });
                    ui.close();
                }
            });
        }
        if response.double_clicked()
            && !over_point
            && let Some(p) = response.interact_pointer_pos()
        {
            let (value, amount) = (map.value(p.x), map.amount(p.y));
            edits.push(Edit::Add { value, amount });
            self.editor.selected = Some(tf.points.partition_point(|q| q.value <= value));
        } else if response.dragged() && !over_point {
            let delta = response.drag_delta();
            let shift = f64::from(delta.x / rect.width()) * (map.range[1] - map.range[0]);
            edits.push(Edit::Window { shift, spread: (-f64::from(delta.y) / 200.0).exp() });
        } else if response.clicked() && !over_point {
            self.editor.selected = None;
        }
        let typing = ui.ctx().text_edit_focused();
        if !typing
            && ui.input(|i| i.key_pressed(egui::Key::Delete))
            && let Some(index) = self.editor.selected.take()
        {
            edits.push(Edit::Remove { index });
        }
        edits.into_iter().for_each(|edit| self.edit(edit));
    }

    /// The wheel zooms the values about the cursor; with the right button held they are dragged along.
    fn zoom_range(&mut self, ui: &egui::Ui, response: &egui::Response, map: &Map) {
        let [lo, hi] = map.range;
        let mut range = map.range;
        if let Some(p) = response.hover_pos() {
            let scroll = ui.input(|i| i.smooth_scroll_delta().y);
            if scroll != 0.0 {
                let (at, factor) = (map.value(p.x), 1.01_f64.powf(-f64::from(scroll)));
                range = [at + (lo - at) * factor, at + (hi - at) * factor];
            }
        }
        if response.dragged_by(egui::PointerButton::Secondary)
            || response.dragged_by(egui::PointerButton::Middle)
        {
            let shift = f64::from(response.drag_delta().x / map.rect.width()) * (hi - lo);
            range = [lo - shift, hi - shift];
        }
        let width = range[1] - range[0];
        let magnitude = range[0].abs().max(range[1].abs());
        if range != map.range && width > 1e-9 * magnitude.max(1e-20) && magnitude < 1e29 {
            self.editor.range = Some(range);
        }
    }
}

/// The widget by its name, for screen readers and tests.
fn labelled(response: egui::Response, name: &str) -> egui::Response {
    response.accessible_name(name)
}

/// A little more than all values; something where there is only one.
fn padded([lo, hi]: [f64; 2]) -> [f64; 2] {
    let margin = if hi > lo { 0.02 * (hi - lo) } else { 0.5 * lo.abs().max(1.0) };
    [lo - margin, hi + margin]
}
