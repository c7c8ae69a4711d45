//! Small parts that several panels paint.

use crate::app::theme;
use crate::error::Error;
use crate::scene::Camera;
use eframe::egui::text::LayoutJob;
use eframe::egui::{self, Align2, Color32, FontId, Painter, Pos2, Rect, vec2};
use glam::DVec3;

/// A tag that has less room, points, would show no word.
const LEAST_TAG_WIDTH: f32 = 40.0;
/// Lines of a tag.
const MOST_TAG_ROWS: usize = 3;
/// In a view that is narrower, points, a tag has one line, and a legend no room between the corners.
pub const NARROW_VIEW: f32 = 480.0;

/// The frame of a panel without its fill: the window is cleared to that colour.
pub fn unfilled(ui: &egui::Ui) -> egui::Frame {
    egui::Frame::side_top_panel(ui.style()).fill(Color32::TRANSPARENT)
}

/// Text on a dark plate, so that it can be read over any picture.
pub fn shadowed_text(painter: &Painter, at: Pos2, align: Align2, text: &str, size: f32, color: Color32) {
    if text.is_empty() {
        return;
    }
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(size), color);
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand2(vec2(3.0, 1.0)), 3.0, theme::PLATE);
    painter.galley(rect.min, galley, color);
}

/// A method's name, or a figure, on a dark plate that is no wider than `width`: what does not fit is elided and shown
/// whole under the pointer. Returns where it is; nothing is painted where there is no room for a word.
pub fn tag(ui: &egui::Ui, clip: Rect, at: Pos2, align: Align2, text: &str, width: f32) -> Rect {
    if width < LEAST_TAG_WIDTH {
        return Rect::from_min_size(at, egui::Vec2::ZERO);
    }
    let painter = ui.painter_at(clip);
    let mut job = LayoutJob::simple(text.to_owned(), FontId::monospace(12.0), theme::OVER_PICTURE, width);
    job.wrap.max_rows = if clip.width() < NARROW_VIEW { 1 } else { MOST_TAG_ROWS };
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

/// An error beside the field that it is about.
pub fn complaint(ui: &mut egui::Ui, e: &Error) {
    ui.colored_label(ui.visuals().error_fg_color, format!("{}: {}", e.place, e.why));
}

/// A method without its settings.
pub fn method_name(spec: &str) -> &str {
    spec.split(':').next().unwrap_or(spec)
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
