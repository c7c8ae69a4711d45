//! Clip planes in the viewer: their section of the side panel, and their handles over the picture.

use super::widgets::{project, project_anywhere};
use crate::app::clip;
use crate::app::document::Document;
use crate::app::model::Model;
use crate::scene::AXIS_VIEWS;
use crate::transfer::{ClipPlane, MOST_CLIP_PLANES};
use eframe::egui::{self, Color32, Pos2, Rect, Sense, Shape, Stroke, Vec2, vec2};
use glam::DVec3;

/// Radius around the handle of a clip plane within which a pointer drag moves the plane, screen points.
const REACH: f32 = 11.0;
/// Threshold below which a clip plane counts as facing the camera, so that vertical drags move it. It applies to the
/// plane's screen movement (points per mm), relative to picture height over camera distance.
const FACING: f32 = 1e-3;
/// Colour of the outlines and handles of clip planes.
const COLOR: Color32 = Color32::from_rgb(120, 215, 255);

/// Shows the clip planes section of the side panel.
pub fn show(ui: &mut egui::Ui, model: &mut Model) {
    let Some(document) = &mut model.document else { return };
    let corners = document.volume.corners_mm();
    let mut planes = document.tf.clip.clone();
    // A drag is one undo step, which begins with the drag.
    let mut begins = false;
    let mut removed = None;
    for (i, plane) in planes.iter_mut().enumerate() {
        ui.horizontal_wrapped(|ui| {
            let [low, high] = clip::offsets_mm(&corners, plane.normal);
            let speed = (high - low).max(1e-6) * 2e-3;
            let offset =
                egui::DragValue::new(&mut plane.offset_mm).speed(speed).max_decimals(2).suffix(" mm");
            let offset = ui.add(offset.range(low..=high)).accessible_name(format!("clip {} offset", i + 1));
            begins |= offset.drag_started() || offset.gained_focus();
            offset.on_hover_text("Signed distance from the world origin along the normal");
            let mut normal = plane.normal;
            let mut turned = false;
            for (axis, name) in [&mut normal.x, &mut normal.y, &mut normal.z].into_iter().zip(["R", "A", "S"])
            {
                let drag = egui::DragValue::new(axis).speed(0.01).max_decimals(2).range(-1.0..=1.0);
                let drag = ui.add(drag.prefix(format!("{name} ")));
                let drag = drag.accessible_name(format!("clip {} normal {name}", i + 1));
                begins |= drag.drag_started() || drag.gained_focus();
                turned |= drag.changed();
            }
            if turned && normal.length() > 1e-6 {
                // Rotation about the handle keeps it in the picture.
                let fixed = clip::handle(&corners, plane);
                let normal = normal.normalize();
                *plane = ClipPlane { normal, offset_mm: normal.dot(fixed) };
            }
            let remove = ui.small_button("−").on_hover_text("Remove this plane");
            if remove.accessible_name(format!("clip {} remove", i + 1)).clicked() {
                removed = Some(i);
            }
        });
    }
    if let Some(i) = removed {
        planes.remove(i);
    }
    begins |= removed.is_some();
    ui.add_enabled_ui(planes.len() < MOST_CLIP_PLANES, |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            ui.label("Cut from").on_hover_text("Plane through the centre that removes that side");
            for view in &AXIS_VIEWS {
                let button = ui.small_button(view.mark).on_hover_text(view.name);
                if button.accessible_name(format!("clip from {}", view.name)).clicked() {
                    planes.push(clip::from_side(&corners, view));
                    begins = true;
                }
            }
            if ui.small_button("eye").on_hover_text("Remove everything in front of the centre").clicked() {
                planes.push(clip::through_middle(&corners, document.scene.camera.frame().forward));
                begins = true;
            }
        });
    });
    if !planes.is_empty() {
        ui.weak("Squares in the view move the planes");
    }
    document.set_clip(planes, begins);
}

/// Paints the outlines and handles of the clip planes over the picture.
pub fn paint(painter: &egui::Painter, rect: Rect, document: &Document) {
    let (camera, corners) = (document.scene.camera, document.volume.corners_mm());
    for plane in &document.tf.clip {
        let points = clip::outline(&corners, plane);
        let outline: Option<Vec<Pos2>> = points.iter().map(|p| project_anywhere(&camera, rect, *p)).collect();
        if let Some(outline) = outline.filter(|outline| outline.len() > 2) {
            painter.add(Shape::closed_line(outline, Stroke::new(1.0, COLOR.gamma_multiply(0.45))));
        }
        if let Some(at) = project(&camera, rect, clip::handle(&corners, plane)) {
            let square = Rect::from_center_size(at, Vec2::splat(9.0));
            painter.rect_filled(square.expand(1.5), 2.0, Color32::from_black_alpha(170));
            painter.rect_filled(square, 1.5, COLOR);
        }
    }
}

/// Moves clip planes of the open volume when the user drags their handles. The handles' pointer responses (egui) are
/// merged into `any`.
pub fn follow(ui: &egui::Ui, rect: Rect, document: &mut Document, any: &mut egui::Response) {
    let (camera, corners) = (document.scene.camera, document.volume.corners_mm());
    let mut planes = document.tf.clip.clone();
    let mut begins = false;
    for (i, plane) in planes.iter_mut().enumerate() {
        let handle = clip::handle(&corners, plane);
        let Some(at) = project_anywhere(&camera, rect, handle) else { continue };
        let grip = Rect::from_center_size(at, Vec2::splat(2.0 * REACH));
        let grip = ui.interact(grip, ui.scope_id().with(("clip handle", i)), Sense::click_and_drag());
        if grip.dragged_by(egui::PointerButton::Primary) {
            let moved = drag_mm(&camera, rect, handle, plane.normal, grip.drag_delta());
            let [low, high] = clip::offsets_mm(&corners, plane.normal);
            plane.offset_mm = (plane.offset_mm + moved).clamp(low, high);
        }
        begins |= grip.drag_started();
        *any |= grip.on_hover_cursor(egui::CursorIcon::Grab);
    }
    document.set_clip(planes, begins);
}

/// Converts a pointer drag on screen, at a world point, to a movement of this point along `normal`, mm.
fn drag_mm(camera: &crate::scene::Camera, rect: Rect, at: DVec3, normal: DVec3, drag: Vec2) -> f64 {
    let away = (at - camera.eye).length().max(1e-9);
    // Short enough to be straight on screen.
    let step = 1e-3 * away;
    let ends = [at, at + step * normal].map(|p| project_anywhere(camera, rect, p));
    let [Some(a), Some(b)] = ends else { return 0.0 };
    let points_a_mm = (b - a) / step as f32;
    if points_a_mm.length() > FACING * rect.height() / away as f32 {
        return f64::from(drag.dot(points_a_mm) / points_a_mm.length_sq());
    }
    let mm_a_point =
        2.0 * away * (0.5 * camera.fov_deg.to_radians()).tan() / f64::from(rect.height().max(1.0));
    f64::from(drag.dot(vec2(0.0, -1.0))) * mm_a_point
}
