//! Pointer input on the picture: moves camera, light and split line, and probes the transmittance at a clicked point.

use super::clip;
use crate::app::camera;
use crate::app::model::Model;
use crate::app::split::Split;
use crate::engine::messages::ProbeTarget;
use crate::scene::Light;
use eframe::egui::{self, Rect, Sense, vec2};

/// Camera or light rotation for a drag across the height of the picture, radians.
const TURN: f64 = 1.2 * std::f64::consts::PI;
/// Camera zoom factor for one notch of the mouse wheel (50 points of scrolling).
const NOTCH: f64 = 1.15;

/// Handles drags, wheel and clicks on the picture: they move the camera, lights and clip planes, or probe the
/// transmittance at a point.
pub fn follow(ui: &egui::Ui, rect: Rect, model: &mut Model, response: &egui::Response) {
    let Some(document) = &mut model.document else { return };
    let height = f64::from(rect.height().max(1.0));
    let modifiers = ui.input(|i| i.modifiers);
    let (_, radius) = document.bounding_sphere();
    // Handles take only drags with the primary button; other input passes through them.
    let mut any = response.clone();
    clip::follow(ui, rect, document, &mut any);
    drag_split(ui, rect, &mut model.split, &mut any);
    let delta = any.drag_delta();
    let (right, down) = (f64::from(delta.x) / height, f64::from(delta.y) / height);
    if response.dragged_by(egui::PointerButton::Primary) {
        if modifiers.shift {
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
    if any.dragged_by(egui::PointerButton::Middle) || any.dragged_by(egui::PointerButton::Secondary) {
        camera::pan(&mut document.scene.camera, right, down);
    }
    if let Some(p) = any.hover_pos() {
        let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
        let factor = NOTCH.powf(-f64::from(scroll) / 50.0) / f64::from(pinch);
        if factor != 1.0 {
            let half = 0.5 * rect.height();
            let cursor = [(p.x - rect.center().x) / half, (rect.center().y - p.y) / half].map(f64::from);
            camera::zoom(&mut document.scene.camera, factor, cursor, radius);
        }
    }
    if any.clicked()
        && let Some(p) = any.interact_pointer_pos()
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

/// Moves the split line between two shadow methods when the user drags it. The line's pointer response (egui) is
/// merged into `any`.
fn drag_split(ui: &egui::Ui, rect: Rect, split: &mut Split, any: &mut egui::Response) {
    let flickers = split.flickers();
    let Some(share) = split.share.as_mut().filter(|_| !flickers) else { return };
    let x = rect.left() + *share * rect.width();
    let line = Rect::from_x_y_ranges(x..=x, rect.y_range());
    let line =
        ui.interact(line.expand2(vec2(8.0, 0.0)), ui.scope_id().with("split"), Sense::click_and_drag());
    if line.dragged_by(egui::PointerButton::Primary)
        && let Some(p) = line.interact_pointer_pos()
    {
        *share = ((p.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
    }
    *any |= line.on_hover_and_drag_cursor(egui::CursorIcon::ResizeHorizontal);
}
