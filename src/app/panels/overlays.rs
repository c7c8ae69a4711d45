//! Overlays over the picture: anatomical letters, lights, the probed point and the picture size.

use super::clip;
use super::difference::{Difference, legend};
use super::light;
use super::widgets::{project, shadowed_text};
use crate::app::model::Model;
use crate::app::theme;
use crate::scene::{Light, anatomical_marks};
use eframe::egui::{self, Align2, Color32, Rect, Stroke, vec2};

/// Minimum distance between an anatomical letter and the split line of the picture, screen points.
const BESIDE_LINE: f32 = 22.0;

/// Paints the overlays over the picture, such as anatomical letters and lights. `below_tags` is the lower edge of the
/// method names.
pub fn paint(ui: &egui::Ui, rect: Rect, below_tags: f32, model: &Model, difference: &Difference) {
    let painter = &ui.painter_at(rect);
    let Some(document) = &model.document else { return };
    let camera = document.scene.camera;
    let frame = camera.frame();
    if model.settings.marks {
        let c = rect.center();
        let top = below_tags + if below_tags > rect.top() { 4.0 } else { 10.0 };
        // Letters in the centre keep a distance from the split line.
        let line =
            model.split.share.filter(|_| !model.split.flickers()).map(|s| rect.left() + s * rect.width());
        let middle = line.filter(|x| (x - c.x).abs() < BESIDE_LINE).map_or(c.x, |x| x - BESIDE_LINE);
        for (at, align, direction) in [
            (egui::pos2(rect.left() + 10.0, c.y), Align2::LEFT_CENTER, -frame.right),
            (egui::pos2(rect.right() - 10.0, c.y), Align2::RIGHT_CENTER, frame.right),
            (egui::pos2(middle, top), Align2::CENTER_TOP, frame.up),
            (egui::pos2(middle, rect.bottom() - 10.0), Align2::CENTER_BOTTOM, -frame.up),
        ] {
            let letters = anatomical_marks(direction);
            shadowed_text(painter, at, align, &letters, 15.0, theme::OVER_PICTURE);
        }
    }
    if let Some(p) = model.probe.as_ref().and_then(|probe| project(&camera, rect, probe.point)) {
        painter.circle_stroke(p, 7.0, Stroke::new(3.0, Color32::from_black_alpha(160)));
        painter.circle_stroke(p, 7.0, Stroke::new(1.5, Color32::from_rgb(255, 200, 60)));
    }
    for (place, source) in document.scene.lights.iter().enumerate() {
        if let Light::Point { position } = source.light
            && let Some(p) = project(&camera, rect, position)
        {
            painter.circle_filled(p, 6.0, Color32::from_rgb(255, 230, 140));
            if place == document.chosen_light() {
                painter.circle_stroke(p, 9.0, Stroke::new(1.5, Color32::from_rgb(255, 230, 140)));
            }
        }
    }
    clip::paint(painter, rect, document);
    legend::paint(difference, model, ui, rect);
    let Some(picture) = &model.frame else { return };
    let (w, h) = (picture.main.texture.width, picture.main.texture.height);
    let more = if rect.width() < 260.0 {
        " …"
    } else if picture.is_reduced {
        " of a reduced volume, refining block by block …"
    } else {
        ", refining …"
    };
    let quality = format!("{w} x {h}{}", if picture.is_final { "" } else { more });
    let at = rect.right_bottom() - vec2(10.0, 10.0);
    shadowed_text(painter, at, Align2::RIGHT_BOTTOM, &quality, 11.5, theme::DIM_OVER_PICTURE);
    let shift = ui.input(|i| i.modifiers.shift);
    if shift && let Light::Directional { toward } = document.light().light {
        let radius = 0.4 * rect.height().min(rect.width());
        let behind = Color32::from_black_alpha(120);
        light::paint_light(painter, (rect.center(), radius), &camera, toward, behind);
    }
}
