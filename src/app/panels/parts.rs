//! Small parts that several panels paint.

use crate::error::Error;
use crate::scene::Camera;
use eframe::egui::{self, Align2, Color32, FontId, Painter, Pos2, Rect, vec2};
use glam::DVec3;

/// The frame of a panel without its fill: the window is cleared to that colour.
pub fn unfilled(ui: &egui::Ui) -> egui::Frame {
    egui::Frame::side_top_panel(ui.style()).fill(Color32::TRANSPARENT)
}

/// Text that can be read over any picture.
pub fn shadowed_text(painter: &Painter, at: Pos2, align: Align2, text: &str, size: f32, color: Color32) {
    let font = FontId::proportional(size);
    painter.text(at + vec2(1.0, 1.0), align, text, font.clone(), Color32::from_black_alpha(200));
    painter.text(at, align, text, font, color);
}

/// A method's name, or a figure, on a dark plate.
pub fn tag(painter: &Painter, at: Pos2, align: Align2, text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::monospace(12.0), Color32::from_gray(235));
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(4.0), 3.0, Color32::from_black_alpha(150));
    painter.galley(rect.min, galley, Color32::WHITE);
}

/// An error beside the field that it is about.
pub fn complaint(ui: &mut egui::Ui, e: &Error) {
    ui.colored_label(ui.visuals().error_fg_color, format!("{}: {}", e.place, e.why));
}

/// The last part of a path or a source.
pub fn file_name(source: &str) -> &str {
    source.rsplit(['/', '\\']).next().unwrap_or(source)
}

/// Where a world point is in the view; `None` behind the eye and beside the view.
pub(super) fn project(camera: &Camera, rect: Rect, point: DVec3) -> Option<Pos2> {
    project_anywhere(camera, rect, point).filter(|p| rect.contains(*p))
}

/// Where a world point is on screen, also beside the view; `None` behind the eye.
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
