//! Orientation cube over the picture. A click on a face, edge or corner selects that view; a drag rotates the camera.

use crate::app::camera;
use crate::app::cube;
use crate::app::model::Model;
use crate::scene::{AXIS_VIEWS, CameraFrame};
use eframe::egui::{
    self, Align2, Color32, FontId, PointerButton, Pos2, Rect, Sense, Shape, Stroke, Vec2, vec2,
};
use glam::{DVec2, IVec3};

/// Half the edge length of the orientation cube, screen points.
const HALF: f32 = 21.0;
/// Half size of the clickable square around the orientation cube, screen points. A cube corner extends to sqrt(3)
/// times the half edge.
const REACH: f32 = 37.0;
/// Offset of the orientation cube from the upper right corner of the picture, below the names of the shadow methods,
/// in screen points.
const PLACE: Vec2 = vec2(-44.0, 66.0);
/// Minimum size of the picture at which the orientation cube is shown, screen points.
const LEAST_VIEW: Vec2 = vec2(240.0, 190.0);
/// Camera rotation for a drag across the whole orientation cube, radians.
const TURN: f64 = std::f64::consts::PI;
/// Colour of the orientation-cube cell under the pointer. Its contrast to white text is 6.
const CHOSEN: Color32 = Color32::from_rgb(40, 100, 170);
/// Minimum cosine between the normal of a cube face and the view direction at which the orientation cube shows the
/// anatomical letter of the face.
const LEGIBLE: f64 = 0.3;

/// Shows the orientation cube over the picture and handles its clicks and drags.
pub fn show(ui: &egui::Ui, rect: Rect, model: &mut Model) {
    if !model.settings.cube || rect.width() < LEAST_VIEW.x || rect.height() < LEAST_VIEW.y {
        return;
    }
    let Some(document) = &mut model.document else { return };
    let center = rect.right_top() + PLACE;
    let square = Rect::from_center_size(center, Vec2::splat(2.0 * REACH));
    let response = ui.interact(square, ui.scope_id().with("cube"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, "orientation cube"));
    let target = &mut document.scene.camera;
    if response.dragged_by(PointerButton::Primary) {
        let by = response.drag_delta() / (2.0 * HALF);
        camera::orbit(target, model.settings.orbit, TURN * f64::from(by.x), TURN * f64::from(by.y));
    }
    let frame = target.frame();
    let at = |p: Pos2| DVec2::new(f64::from(p.x - center.x), f64::from(center.y - p.y)) / f64::from(HALF);
    let hit = |p: Option<Pos2>| p.and_then(|p| cube::hit(&frame, at(p)));
    let hovered = hit(response.hover_pos()).filter(|_| !response.dragged());
    if response.clicked()
        && let Some(from) = hit(response.interact_pointer_pos())
    {
        let (away, up) = cube::view(from);
        camera::look_along(target, away, up);
    }
    paint(&ui.painter_at(rect), center, &target.frame(), hovered);
    if let Some(from) = hovered {
        ui.ctx().set_cursor_icon(egui::CursorIcon::PointingHand);
        let key = AXIS_VIEWS.iter().position(|view| view.away.as_ivec3() == from);
        let key = key.map_or(String::new(), |i| format!(" ({})", i + 1));
        response.on_hover_text(format!("Look from {}{key}; drag to turn", cube::name(from)));
    }
}

fn paint(painter: &egui::Painter, center: Pos2, frame: &CameraFrame, hovered: Option<IVec3>) {
    let on_screen = |p: DVec2| center + HALF * vec2(p.x as f32, -p.y as f32);
    for cell in cube::cells(frame) {
        let chosen = hovered == Some(cell.away);
        let facing = cell.face.as_dvec3().dot(-frame.forward) as f32;
        let plain = Color32::from_gray((56.0 + 50.0 * facing) as u8);
        let fill = if chosen { CHOSEN } else { plain };
        let corners = cell.corners.map(on_screen).to_vec();
        painter.add(Shape::convex_polygon(corners, fill, Stroke::NONE));
    }
    for (face, facing) in cube::faces(frame) {
        let corners: Vec<Pos2> =
            cube::outline(face).map(|corner| on_screen(cube::on_screen(frame, corner))).to_vec();
        painter.add(Shape::closed_line(corners, Stroke::new(1.0, Color32::from_gray(190))));
        if facing > LEGIBLE
            && let Some(view) = AXIS_VIEWS.iter().find(|view| view.away.as_ivec3() == face)
        {
            let place = on_screen(cube::on_screen(frame, face.as_dvec3()));
            let font = FontId::proportional(10.0 + 8.0 * facing as f32);
            painter.text(place, Align2::CENTER_CENTER, view.mark, font, Color32::WHITE);
        }
    }
}
