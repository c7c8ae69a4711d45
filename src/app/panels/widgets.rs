//! Helper widgets that several panels of the viewer use.

use crate::app::theme;
use crate::error::Error;
use crate::scene::Camera;
use eframe::egui::text::LayoutJob;
use eframe::egui::{self, Align2, Color32, FontId, Painter, Pos2, Rect, vec2};
use glam::DVec3;

/// Minimum width of a text label over the picture, screen points.
const MIN_TAG_WIDTH: f32 = 40.0;
/// Maximum number of lines of a text label over the picture.
const MAX_TAG_ROWS: usize = 3;
/// Picture width below which its overlays use a compact layout: labels of one line, and the heat map legend above the
/// corners. Points.
pub const NARROW_VIEW: f32 = 480.0;

/// egui frame of a panel without background fill, since the window is already cleared to the panel colour.
pub fn unfilled(ui: &egui::Ui) -> egui::Frame {
    egui::Frame::side_top_panel(ui.style()).fill(Color32::TRANSPARENT)
}

/// Paints text on a dark background, so that it is readable over any picture.
pub fn shadowed_text(painter: &Painter, at: Pos2, align: Align2, text: &str, size: f32, color: Color32) {
    if text.is_empty() {
        return;
    }
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(size), color);
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand2(vec2(3.0, 1.0)), 3.0, theme::PLATE);
    painter.galley(rect.min, galley, color);
}

/// Paints a text label at most `width` points wide on a dark background. Shortened text is shown in full as a
/// tooltip. Returns the label's rectangle, which is empty if there is no space for a word.
pub fn tag(ui: &egui::Ui, clip: Rect, at: Pos2, align: Align2, text: &str, width: f32) -> Rect {
    if width < MIN_TAG_WIDTH {
        return Rect::from_min_size(at, egui::Vec2::ZERO);
    }
    let painter = ui.painter_at(clip);
    let mut job = LayoutJob::simple(text.to_owned(), FontId::monospace(12.0), theme::OVER_PICTURE, width);
    job.wrap.max_rows = if clip.width() < NARROW_VIEW { 1 } else { MAX_TAG_ROWS };
    job.halign = egui::Align::LEFT;
    let galley = painter.layout_job(job);
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(4.0), 3.0, theme::PLATE);
    if galley.elided {
        let id = ui.scope_id().with(("tag", text));
        ui.interact(rect, id, egui::Sense::hover()).on_hover_text(text);
    }
    painter.galley(rect.min, galley, theme::OVER_PICTURE);
    rect.expand(4.0)
}

/// Shows an error beside the input field that caused it.
pub fn error_label(ui: &mut egui::Ui, e: &Error) {
    ui.colored_label(ui.visuals().error_fg_color, format!("{}: {}", e.place, e.why));
}

/// Adds a row with a property's name and value to a grid of a panel.
pub fn property(ui: &mut egui::Ui, name: &str, value: String, tooltip: &str) {
    let label = ui.weak(name);
    if !tooltip.is_empty() {
        label.on_hover_text(tooltip);
    }
    ui.add(egui::Label::new(value).wrap());
    ui.end_row();
}

/// Returns the name of a shadow method from a text with its settings: `dsm` from `dsm:map=64`.
pub fn method_name(spec: &str) -> &str {
    spec.split(':').next().unwrap_or(spec)
}

/// Projects a world point onto the picture on screen. `None` if it is behind the camera or outside the picture.
pub(super) fn project(camera: &Camera, rect: Rect, point: DVec3) -> Option<Pos2> {
    project_anywhere(camera, rect, point).filter(|p| rect.contains(*p))
}

/// Projects a world point onto the image plane on screen, also outside the picture. `None` if it is behind the
/// camera.
pub(super) fn project_anywhere(camera: &Camera, rect: Rect, point: DVec3) -> Option<Pos2> {
    let frame = camera.frame();
    let d = point - camera.eye;
    let depth = d.dot(frame.forward);
    if depth <= 0.0 {
        return None;
    }
    let half = f64::from(0.5 * rect.height()) / (0.5 * camera.fov_deg.to_radians()).tan() / depth;
    let offset = vec2((d.dot(frame.right) * half) as f32, (-d.dot(frame.up) * half) as f32);
    Some(rect.center() + offset)
}
