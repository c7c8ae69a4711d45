//! What the heat maps' colours mean, in figures.

use super::Difference;
use crate::app::model::Model;
use crate::app::panels::flicker;
use crate::app::panels::parts::tag;
use crate::app::render_thread::messages::Differences;
use crate::measure::error_map::Quantity;
use crate::report::heat::inferno;
use eframe::egui::{self, Align2, Color32, FontId, Rect, pos2, vec2};
use std::sync::Arc;

/// The scale, the figures of each method, and the error under the pointer.
pub fn paint(difference: &Difference, model: &Model, ui: &egui::Ui, rect: Rect) {
    let painter = ui.painter_at(rect);
    let Some(quantity) = difference.shows else { return };
    let what = match quantity {
        Quantity::Light => "error of the light on what is seen (transmittance)",
        Quantity::Picture => "error of the picture (linear RGB)",
    };
    let mut lines = Vec::new();
    if let Some(found) = &difference.found {
        for side in &found.sides {
            lines.push(match &side.map.stats {
                Some(s) => format!(
                    "{}: rms {:.4}, mean {:+.4}, 99 % {:.4}, max {:.4}",
                    side.spec, s.rms, s.mean, s.p99_abs, s.max_abs
                ),
                None => format!("{}: nothing is seen", side.spec),
            });
        }
        let scene = &found.request.view.scene;
        let more = if difference.is_done() { "" } else { ", finer follows …" };
        lines.push(format!("{what} · {} x {}{more}", scene.width, scene.height));
    } else {
        lines.push(format!("{what} · computing the exact answer …"));
    }
    let font = FontId::proportional(12.0);
    let color = Color32::from_gray(230);
    let bar = vec2(220.0, 10.0);
    let lines: Vec<_> =
        lines.into_iter().map(|line| painter.layout_no_wrap(line, font.clone(), color)).collect();
    let widest = lines.iter().map(|l| l.size().x).fold(bar.x + 120.0, f32::max);
    let height = 17.0 * lines.len() as f32 + bar.y + 14.0;
    let (left, top) = (rect.center().x - 0.5 * bar.x, rect.bottom() - height - 34.0);
    let back = pos2(rect.center().x - 0.5 * widest - 10.0, top - 6.0);
    let back = Rect::from_min_size(back, vec2(widest + 20.0, height));
    painter.rect_filled(back, 4.0, Color32::from_black_alpha(190));
    for (i, line) in lines.iter().enumerate() {
        let at = pos2(rect.center().x - 0.5 * line.size().x, top + 17.0 * i as f32);
        painter.galley(at, Arc::clone(line), color);
    }
    let Some(found) = &difference.found else { return };
    let y = top + 17.0 * lines.len() as f32 + 2.0;
    let mut scale = egui::Mesh::default();
    const STEPS: usize = 44;
    for i in 0..STEPS {
        let column = Rect::from_min_size(
            pos2(left + bar.x * i as f32 / STEPS as f32, y),
            vec2(bar.x / STEPS as f32, bar.y),
        );
        let [r, g, b] = inferno((i as f64 + 0.5) / STEPS as f64).0;
        scale.add_colored_rect(column, Color32::from_rgb(r, g, b));
    }
    painter.add(scale);
    let (y, sign) = (y + 0.5 * bar.y, if found.request.logarithmic { "≤ " } else { "" });
    painter.text(
        pos2(left - 6.0, y),
        Align2::RIGHT_CENTER,
        format!("{sign}{}", found.least),
        font.clone(),
        color,
    );
    let end = pos2(left + bar.x + 6.0, y);
    painter.text(end, Align2::LEFT_CENTER, format!("≥ {}", found.largest), font, color);
    if let Some((at, error)) = under_pointer(found, model, ui, rect) {
        let text = if error.is_finite() { format!("{error:+.4}") } else { "no number".to_owned() };
        tag(&painter, at + vec2(14.0, 12.0), Align2::LEFT_TOP, &text);
    }
}

fn under_pointer(found: &Differences, model: &Model, ui: &egui::Ui, rect: Rect) -> Option<(egui::Pos2, f32)> {
    let at = ui.input(|i| i.pointer.hover_pos()).filter(|p| rect.contains(*p))?;
    let right = model.split.share.is_some_and(|share| at.x > rect.left() + share * rect.width());
    let side = flicker::side(model, ui.ctx()).unwrap_or(usize::from(right));
    let side = found.sides.get(side).or(found.sides.first())?;
    let (height, width) = side.map.errors.dim();
    let index = |share: f32, n: usize| ((share * n as f32) as usize).min(n.saturating_sub(1));
    let (x, y) = ((at.x - rect.left()) / rect.width(), (at.y - rect.top()) / rect.height());
    let error = side.map.errors[[index(y, height), index(x, width)]];
    (!error.is_nan()).then_some((at, error))
}
