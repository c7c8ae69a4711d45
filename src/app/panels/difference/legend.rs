//! Legend of the error heat maps: colour scale and error statistics of each shadow method.

use super::Difference;
use crate::app::model::Model;
use crate::app::panels::widgets::{NARROW_VIEW, method_name, tag};
use crate::app::theme;
use crate::engine::messages::Differences;
use crate::measure::error_map::Quantity;
use crate::report::heat::inferno;
use eframe::egui::{self, Align2, Color32, FontId, Rect, pos2, vec2};
use std::sync::Arc;

/// Vertical space between the text lines of the heat map legend, screen points.
const LINE_GAP: f32 = 2.0;
/// Width reserved at each lower corner of the picture for other overlays than the heat map legend, screen points.
const CORNERS: f32 = 104.0;
/// Height reserved at the lower corners of a narrow picture. The heat map legend is above it, screen points.
const ABOVE_CORNERS: f32 = 86.0;

/// Paints the legend of the error heat maps, and the error at the pixel under the pointer.
// Long: each element of the legend is placed below the one before.
pub fn paint(difference: &Difference, model: &Model, ui: &egui::Ui, rect: Rect) {
    let painter = ui.painter_at(rect);
    let Some(quantity) = difference.shows else { return };
    // In a narrow view the legend is above the corners and shorter.
    let is_narrow = rect.width() < NARROW_VIEW;
    let what = match quantity {
        Quantity::Light if is_narrow => "light error",
        Quantity::Picture if is_narrow => "picture error",
        Quantity::Bound if is_narrow => "error bound",
        Quantity::Light => "transmittance error at visible points",
        Quantity::Picture => "picture error (linear RGB)",
        Quantity::Bound => "estimated bound on the error of the certified picture (linear RGB)",
    };
    let mut lines = Vec::new();
    if let Some(found) = &difference.found {
        for side in &found.sides {
            lines.push(match &side.map.stats {
                Some(s) if is_narrow => {
                    format!("{}: rms {:.4}, max {:.4}", method_name(&side.spec), s.rms, s.max_abs)
                }
                Some(s) => format!(
                    "{}: rms {:.4}, mean {:+.4}, 99 % {:.4}, max {:.4}",
                    side.spec, s.rms, s.mean, s.p99_abs, s.max_abs
                ),
                None => format!("{}: nothing visible", side.spec),
            });
        }
        let scene = &found.request.view.scene;
        let more = if difference.is_done() { "" } else { ", refining …" };
        lines.push(format!("{what} · {} x {}{more}", scene.width, scene.height));
    } else {
        lines.push(format!("{what} · computing …"));
    }
    let font = FontId::proportional(12.0);
    let color = theme::OVER_PICTURE;
    let bar = vec2((rect.width() - 240.0).clamp(60.0, 220.0), 10.0);
    let room = (rect.width() - if is_narrow { 80.0 } else { 2.0 * CORNERS }).max(100.0);
    let margin = if is_narrow { ABOVE_CORNERS } else { 34.0 };
    let lines: Vec<_> =
        lines.into_iter().map(|line| painter.layout(line, font.clone(), color, room)).collect();
    let widest = lines.iter().map(|l| l.size().x).fold(bar.x + 120.0, f32::max);
    let text_height: f32 = lines.iter().map(|l| l.size().y + LINE_GAP).sum();
    let height = text_height + bar.y + 14.0;
    let (left, top) = (rect.center().x - 0.5 * bar.x, rect.bottom() - height - margin);
    let back = pos2(rect.center().x - 0.5 * widest - 10.0, top - 6.0);
    let back = Rect::from_min_size(back, vec2(widest + 20.0, height));
    painter.rect_filled(back, 4.0, theme::PLATE);
    let mut y = top;
    for line in &lines {
        painter.galley(pos2(rect.center().x - 0.5 * line.size().x, y), Arc::clone(line), color);
        y += line.size().y + LINE_GAP;
    }
    let Some(found) = &difference.found else { return };
    let y = y + 2.0;
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
        let text = match quantity {
            _ if !error.is_finite() => "no number".to_owned(),
            Quantity::Bound => format!("± {error:.4}"),
            _ => format!("{error:+.4}"),
        };
        // Places the text on the side with more space.
        let (dx, right) = if at.x > rect.right() - 90.0 { (-12.0, 1) } else { (14.0, 0) };
        let (dy, low) = if at.y > rect.bottom() - 40.0 { (-10.0, 1) } else { (12.0, 0) };
        let align =
            [[Align2::LEFT_TOP, Align2::RIGHT_TOP], [Align2::LEFT_BOTTOM, Align2::RIGHT_BOTTOM]][low][right];
        tag(ui, rect, at + vec2(dx, dy), align, &text, rect.width());
    }
}

fn under_pointer(found: &Differences, model: &Model, ui: &egui::Ui, rect: Rect) -> Option<(egui::Pos2, f32)> {
    let at = ui.input(|i| i.pointer.hover_pos()).filter(|p| rect.contains(*p))?;
    let right = model.split.share.is_some_and(|share| at.x > rect.left() + share * rect.width());
    let side = model.flicker(ui.ctx()).map_or(usize::from(right), |(side, _)| side);
    let side = found.sides.get(side).or(found.sides.first())?;
    let (height, width) = side.map.errors.dim();
    let index = |share: f32, n: usize| ((share * n as f32) as usize).min(n.saturating_sub(1));
    let (x, y) = ((at.x - rect.left()) / rect.width(), (at.y - rect.top()) / rect.height());
    let error = side.map.errors[[index(y, height), index(x, width)]];
    (!error.is_nan()).then_some((at, error))
}
