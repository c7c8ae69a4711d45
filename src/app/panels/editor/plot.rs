//! Plot of the transfer-function editor: opacity curve over the histogram, and its pointer input.

use super::paint::{Map, add_bar, add_histogram, paint_axes, paint_curve, short};
use crate::app::curve::{Edit, top_of};
use crate::app::document::Document;
use crate::app::model::Model;
use crate::app::theme;
use crate::files::color;
use crate::transfer::{Quantity, TransferFunction};
use eframe::egui::{self, Align2, Color32, FontId, Rect, Sense, Stroke, pos2, vec2};
use std::sync::Arc;

const BAR_HEIGHT: f32 = 16.0;
const GRIP: f32 = 6.0;

/// Shows the plot of the transfer-function editor in the remaining space: opacity curve, control points and colour
/// bar.
pub fn show(ui: &mut egui::Ui, model: &mut Model) {
    let Some(document) = &model.document else { return };
    let tf = Arc::clone(&document.tf);
    // The whole remaining height, since a panel takes the height of its contents, but not beyond the panel.
    let whole = ui.available_rect_before_wrap().intersect(ui.clip_rect());
    ui.allocate_rect(whole, Sense::hover());
    let whole = whole.shrink(2.0);
    if whole.width() < 40.0 || whole.height() < 50.0 {
        return;
    }
    let rect = Rect::from_min_max(
        pos2(whole.left() + 56.0, whole.top() + 2.0),
        pos2(whole.right() - 4.0, whole.bottom() - BAR_HEIGHT - 18.0),
    );
    let range = document.value_window.unwrap_or_else(|| padded(document.histogram.range));
    let map = Map { rect, range, axis: model.settings.amount_axis, top: top_of(&tf) };
    let response = ui.interact(rect, ui.scope_id().with("curve"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, "opacity curve"));
    paint(ui, whole, &map, model);
    let Some(document) = &mut model.document else { return };
    zoom_values(ui, &response, &map, document);
    let mut edits = Vec::new();
    if !points(ui, &ui.painter_at(whole), &map, &tf, &mut document.selected, &mut edits) {
        beside_points(&response, &map, &tf, &mut document.selected, &mut edits);
    }
    if !ui.ctx().text_edit_focused()
        && ui.input(|i| i.key_pressed(egui::Key::Delete))
        && let Some(index) = document.selected.take()
    {
        edits.push(Edit::Remove { index });
    }
    edits.into_iter().for_each(|edit| model.edit(edit));
}

/// Paints the transfer-function plot without its control points. `whole` is the rectangle with the axis labels.
fn paint(ui: &egui::Ui, whole: Rect, map: &Map, model: &Model) {
    let Some(document) = &model.document else { return };
    let (rect, tf) = (map.rect, &document.tf);
    let bar = Rect::from_min_max(
        pos2(rect.left(), rect.bottom() + 3.0),
        pos2(rect.right(), rect.bottom() + 3.0 + BAR_HEIGHT),
    );
    let (painter, visuals) = (ui.painter_at(whole), ui.visuals());
    let mut back = egui::Mesh::default();
    back.add_colored_rect(rect, visuals.extreme_bg_color);
    let colors = theme::colors(visuals);
    add_histogram(&mut back, map, &document.histogram, &model.settings, colors.histogram);
    add_bar(&mut back, bar, map, tf);
    painter.add(back);
    let inside = ui.painter_at(rect);
    paint_axes(&painter, map, tf, bar.bottom(), visuals.weak_text_color());
    paint_curve(&inside, map, tf, visuals.strong_text_color());
    if let Some(value) = model.probe.as_ref().map(|probe| probe.value) {
        let (x, color) = (map.x(value), colors.probe);
        inside.vline(x, rect.y_range(), Stroke::new(1.0, color));
        // Places the text on the side with more space.
        let (dx, align) =
            if x > rect.right() - 90.0 { (-4.0, Align2::RIGHT_TOP) } else { (4.0, Align2::LEFT_TOP) };
        let font = FontId::proportional(11.0);
        inside.text(pos2(x + dx, rect.top() + 2.0), align, format!("probe {}", short(value)), font, color);
    }
}

/// Shows the control points of the transfer function and collects the user's edits of them. Returns whether the
/// pointer is on a control point.
fn points(
    ui: &egui::Ui,
    painter: &egui::Painter,
    map: &Map,
    tf: &TransferFunction,
    selected: &mut Option<usize>,
    edits: &mut Vec<Edit>,
) -> bool {
    let mut over_point = false;
    let places: Vec<egui::Pos2> = tf.points.iter().map(|p| pos2(map.x(p.value), map.y(p.amount))).collect();
    let around = map.rect.expand(GRIP);
    let pointer = ui.input(|i| i.pointer.hover_pos()).filter(|p| around.contains(*p));
    for index in point_order(&places, pointer, *selected) {
        let (point, at) = (&tf.points[index], places[index]);
        if !around.contains(at) {
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
            *selected = Some(index);
        }
        if grip.dragged()
            && let Some(p) = grip.interact_pointer_pos()
        {
            edits.push(Edit::Move { index, value: map.value(p.x), amount: map.amount(p.y) });
        }
        let [r, g, b] = point.color.map(color::srgb8_from_linear);
        let (is_selected, visuals) = (*selected == Some(index), ui.visuals());
        let radius = if is_selected || grip.hovered() { GRIP + 1.0 } else { GRIP - 1.0 };
        let ring = if is_selected { visuals.selection.bg_fill } else { visuals.strong_text_color() };
        painter.circle(at, radius, Color32::from_rgb(r, g, b), Stroke::new(2.0, ring));
        let what = if tf.quantity == Quantity::Opacity { "opacity" } else { "per mm" };
        let (value, amount) = (short(point.value), short(point.amount));
        let menu = grip.on_hover_text(format!("{value} {}, {amount} {what}", tf.units));
        menu.context_menu(|ui| {
            if ui.button("Make a jump").clicked() {
                let amount = if point.amount > 0.5 * map.top { 0.0 } else { 0.8 * map.top };
                edits.push(Edit::Jump { index, amount });
                ui.close();
            }
            if ui.button("Remove").clicked() {
                edits.push(Edit::Remove { index });
                ui.close();
            }
        });
    }
    over_point
}

/// Handles pointer input beside the control points of the transfer function: adds a point, changes window and level,
/// or deselects.
fn beside_points(
    response: &egui::Response,
    map: &Map,
    tf: &TransferFunction,
    selected: &mut Option<usize>,
    edits: &mut Vec<Edit>,
) {
    if response.double_clicked()
        && let Some(p) = response.interact_pointer_pos()
    {
        let (value, amount) = (map.value(p.x), map.amount(p.y));
        edits.push(Edit::Add { value, amount });
        *selected = Some(tf.points.partition_point(|q| q.value <= value));
    } else if response.dragged() {
        let delta = response.drag_delta();
        let shift = f64::from(delta.x / map.rect.width()) * (map.range[1] - map.range[0]);
        edits.push(Edit::Window { shift, spread: (-f64::from(delta.y) / 200.0).exp() });
    } else if response.clicked() {
        *selected = None;
    }
}

/// Zooms the value axis of the transfer-function editor with the wheel, and pans it with the right button.
fn zoom_values(ui: &egui::Ui, response: &egui::Response, map: &Map, document: &mut Document) {
    let [lo, hi] = map.range;
    let mut range = map.range;
    if let Some(p) = response.hover_pos() {
        let scroll = ui.input(|i| i.smooth_scroll_delta().y);
        if scroll != 0.0 {
            let (at, factor) = (map.value(p.x), 1.01_f64.powf(-f64::from(scroll)));
            range = [at + (lo - at) * factor, at + (hi - at) * factor];
        }
    }
    if response.dragged_by(egui::PointerButton::Secondary) || response.dragged_by(egui::PointerButton::Middle)
    {
        let shift = f64::from(response.drag_delta().x / map.rect.width()) * (hi - lo);
        range = [lo - shift, hi - shift];
    }
    let width = range[1] - range[0];
    let magnitude = range[0].abs().max(range[1].abs());
    if range != map.range && width > 1e-9 * magnitude.max(1e-20) && magnitude < 1e29 {
        document.value_window = Some(range);
    }
}

/// Adds a margin on both sides to the range of scalar values that the transfer-function editor shows.
fn padded([lo, hi]: [f64; 2]) -> [f64; 2] {
    let margin = if hi > lo { 0.02 * (hi - lo) } else { 0.5 * lo.abs().max(1.0) };
    [lo - margin, hi + margin]
}

/// Distance on screen by which the selected control point may be farther from the pointer than another one and still
/// be picked, screen points.
const SELECTION_BONUS: f32 = 6.0;

/// Drawing order of the control points of the transfer function. The point drawn last, i.e. on top, takes the pointer
/// input: the nearest, or the selected one.
fn point_order(places: &[egui::Pos2], pointer: Option<egui::Pos2>, selected: Option<usize>) -> Vec<usize> {
    let far = |i: usize| {
        let distance = pointer.map_or(0.0, |pointer| pointer.distance(places[i]));
        if selected == Some(i) { distance - SELECTION_BONUS } else { distance }
    };
    let mut order: Vec<usize> = (0..places.len()).collect();
    // The sort is stable: of control points at one position, the later one is on top.
    order.sort_by(|a, b| far(*b).total_cmp(&far(*a)));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_or_selected_point_is_on_top() {
        let places = [pos2(0.0, 0.0), pos2(4.0, 0.0), pos2(4.0, 0.0), pos2(50.0, 0.0)];
        let top = |pointer, selected| *point_order(&places, pointer, selected).last().unwrap();
        assert_eq!(point_order(&places, None, None), [0, 1, 2, 3]);
        assert_eq!(top(None, Some(1)), 1);
        assert_eq!(top(Some(pos2(-1.0, 0.0)), None), 0);
        assert_eq!(top(Some(pos2(5.0, 0.0)), None), 2);
        assert_eq!(top(Some(pos2(5.0, 0.0)), Some(0)), 0, "only a little farther");
        assert_eq!(top(Some(pos2(5.0, 0.0)), Some(1)), 1, "under another");
        assert_eq!(top(Some(pos2(49.0, 0.0)), Some(0)), 3, "nowhere near");
        let mut all = point_order(&places, Some(pos2(9.0, 9.0)), Some(3));
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3]);
    }
}
