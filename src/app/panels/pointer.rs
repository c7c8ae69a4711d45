//! Pointer input in the view: camera, light, split line and probes.

use super::clip;
use crate::app::camera;
use crate::app::model::Model;
use crate::app::split::Split;
use crate::engine::messages::ProbeTarget;
use crate::scene::Light;
use eframe::egui::{self, Rect, vec2};

/// Rotation of a drag across the height of the view, radians.
const TURN: f64 = 1.2 * std::f64::consts::PI;
/// Zoom factor of one wheel notch (50 points).
const NOTCH: f64 = 1.15;

/// Handles drags, the wheel and clicks in the view.
pub fn follow(ui: &egui::Ui, rect: Rect, model: &mut Model, response: &egui::Response) {
    let Some(document) = &mut model.document else { return };
    let height = f64::from(rect.height().max(1.0));
    let delta = response.drag_delta();
    let (right, down) = (f64::from(delta.x) / height, f64::from(delta.y) / height);
    let modifiers = ui.input(|i| i.modifiers);
    let (_, radius) = document.bounding_sphere();
    let wiping = is_wiping(ui, rect, &model.split, response);
    let holds = !wiping && clip::follow(ui, rect, document, response);
    if response.dragged_by(egui::PointerButton::Primary) && !holds {
        if wiping && let Some(p) = response.interact_pointer_pos() {
            let share = ((p.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
            model.split.share = model.split.share.map(|_| share);
        } else if modifiers.shift {
            let scale = match document.light().light {
                Light::Directional { .. } => TURN,
                Light::Point { .. } => 2.0 * (0.5 * document.scene.camera.fov_deg.to_radians()).tan(),
            };
            let camera = document.scene.camera;
            camera::drag_light(&mut document.light_mut().light, &camera, scale * right, scale * down);
        } else if modifiers.ctrl || modifiers.command {
            camera::pan(&mut document.scene.camera, right, down);
        } else {
            camera::orbit(&mut document.scene.camera, model.settings.orbit, TURN * right, TURN * down);
        }
    }
    if response.dragged_by(egui::PointerButton::Middle) || response.dragged_by(egui::PointerButton::Secondary)
    {
        camera::pan(&mut document.scene.camera, right, down);
    }
    if let Some(p) = response.hover_pos() {
        let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
        let factor = NOTCH.powf(-f64::from(scroll) / 50.0) / f64::from(pinch);
        if factor != 1.0 {
            let half = 0.5 * rect.height();
            let cursor = [(p.x - rect.center().x) / half, (rect.center().y - p.y) / half].map(f64::from);
            camera::zoom(&mut document.scene.camera, factor, cursor, radius);
        }
    }
    if response.clicked()
        && let Some(p) = response.interact_pointer_pos()
    {
        let scene = &document.scene;
        let pixel =
            (p - rect.min) / rect.size() * vec2(scene.width as f32, scene.height as f32) - vec2(0.5, 0.5);
        let direction =
            scene.camera.ray_direction(f64::from(pixel.x), f64::from(pixel.y), scene.width, scene.height);
        let target = ProbeTarget::Ray { origin: scene.camera.eye, direction };
        model.probe(target);
    }
}

/// Whether the split line is dragged.
fn is_wiping(ui: &egui::Ui, rect: Rect, split: &Split, response: &egui::Response) -> bool {
    let near = split.share.filter(|_| !split.flickers()).is_some_and(|share| {
        let x = rect.left() + share * rect.width();
        let from = response.interact_pointer_pos().or_else(|| response.hover_pos());
        from.is_some_and(|p| (p.x - x).abs() < 8.0)
    });
    if near {
        ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
    }
    let wipe = ui.scope_id().with("wipe");
    if response.drag_started_by(egui::PointerButton::Primary) {
        ui.data_mut(|d| d.insert_temp(wipe, near));
    }
    ui.data(|d| d.get_temp::<bool>(wipe)).unwrap_or(false)
}
