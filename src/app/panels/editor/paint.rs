//! Painting of the transfer-function editor: histogram, axes, opacity curve and colour bar.

use crate::app::curve::AmountAxis;
use crate::app::settings::Settings;
use crate::files::color;
use crate::report::number::trimmed;
use crate::transfer::TransferFunction;
use crate::volume::Histogram;
use eframe::egui::{self, Color32, FontId, Mesh, Pos2, Rect, Stroke, pos2};

/// Mapping between positions on screen and the scalar values and opacities in the transfer-function editor.
pub(super) struct Map {
    pub rect: Rect,
    pub range: [f64; 2],
    pub axis: AmountAxis,
    pub top: f64,
}

impl Map {
    pub fn x(&self, value: f64) -> f32 {
        let share = (value - self.range[0]) / (self.range[1] - self.range[0]);
        self.rect.left() + self.rect.width() * share.clamp(-10.0, 10.0) as f32
    }

    pub fn y(&self, amount: f64) -> f32 {
        self.rect.bottom() - self.rect.height() * self.axis.height(amount, self.top) as f32
    }

    pub fn value(&self, x: f32) -> f64 {
        let share = f64::from((x - self.rect.left()) / self.rect.width());
        self.range[0] + share * (self.range[1] - self.range[0])
    }

    pub fn amount(&self, y: f32) -> f64 {
        self.axis.amount(f64::from((self.rect.bottom() - y) / self.rect.height()), self.top)
    }
}

/// Formats a number with four significant digits.
pub(in crate::app::panels) fn short(x: f64) -> String {
    if x == 0.0 {
        // Avoids a negative zero.
        return "0".into();
    }
    if (1e-3..1e5).contains(&x.abs()) {
        let digits = (3.0 - x.abs().max(1e-3).log10().floor()).clamp(0.0, 6.0) as usize;
        trimmed(&format!("{x:.digits$}"))
    } else {
        format!("{x:.3e}")
    }
}

/// Adds the histogram bars of the transfer-function editor to one mesh, because separate shapes are much slower.
pub(super) fn add_histogram(
    mesh: &mut Mesh,
    map: &Map,
    histogram: &Histogram,
    settings: &Settings,
    color: Color32,
) {
    let bins = histogram.counts.len();
    let weight = |bin: usize| match settings.gradient_histogram {
        true => histogram.gradients[bin],
        false => histogram.counts[bin] as f64,
    };
    // Gradients have a unit; the logarithm takes them relative to their mean.
    let mean = (0..bins).map(weight).sum::<f64>() / bins.max(1) as f64;
    let height = |w: f64| {
        if settings.log_histogram { (1.0 + w / (1e-3 * mean).max(f64::MIN_POSITIVE)).ln() } else { w }
    };
    let largest = (0..bins).map(|b| height(weight(b))).fold(0.0, f64::max);
    if largest <= 0.0 {
        return;
    }
    let [lo, hi] = histogram.range;
    let width = (hi - lo).max(f64::MIN_POSITIVE);
    for bin in 0..bins {
        let [left, right] = [bin, bin + 1].map(|b| map.x(lo + width * b as f64 / bins as f64));
        if right < map.rect.left() || left > map.rect.right() {
            continue;
        }
        let y = map.rect.bottom() - 0.96 * map.rect.height() * (height(weight(bin)) / largest) as f32;
        let column = Rect::from_min_max(pos2(left, y), pos2(right.max(left + 1.0), map.rect.bottom()));
        mesh.add_colored_rect(column.intersect(map.rect), color);
    }
}

pub(super) fn paint_axes(
    painter: &egui::Painter,
    map: &Map,
    tf: &TransferFunction,
    below: f32,
    color: Color32,
) {
    let font = FontId::proportional(10.5);
    let heights: &[f64] = match map.axis {
        AmountAxis::Linear => &[0.0, 0.25, 0.5, 0.75, 1.0],
        AmountAxis::Logarithmic => &[0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0],
    };
    let mut free_below = f32::INFINITY;
    for share in heights {
        let y = map.y(share * map.top);
        painter.hline(map.rect.x_range(), y, Stroke::new(0.5, color.gamma_multiply(0.35)));
        let at = pos2(map.rect.left() - 4.0, y.clamp(map.rect.top() + 6.0, map.rect.bottom() - 5.0));
        // Skips labels that would overlap.
        if at.y > free_below {
            continue;
        }
        let text = short(share * map.top);
        free_below = painter.text(at, egui::Align2::RIGHT_CENTER, text, font.clone(), color).top() - 5.0;
    }
    let width = map.range[1] - map.range[0];
    let rough = width / f64::from((map.rect.width() / 90.0).max(1.0));
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= rough).unwrap_or(rough);
    let corner = pos2(map.rect.right(), below + 2.0);
    let unit = painter.text(corner, egui::Align2::RIGHT_TOP, &tf.units, font.clone(), color);
    let mut value = (map.range[0] / step).ceil() * step;
    for _ in 0..64 {
        if value > map.range[1] {
            break;
        }
        let x = map.x(value);
        painter.vline(x, map.rect.y_range(), Stroke::new(0.5, color.gamma_multiply(0.25)));
        let figure = painter.layout_no_wrap(short(value), font.clone(), color);
        // The unit may take the place of the last label.
        if x + 0.5 * figure.size().x < unit.left() - 4.0 {
            painter.galley(pos2(x - 0.5 * figure.size().x, below + 2.0), figure, color);
        }
        value += step;
    }
}

/// Paints the opacity curve of the transfer function. Between control points, opacity is linear in the scalar value,
/// also on a logarithmic axis.
pub(super) fn paint_curve(painter: &egui::Painter, map: &Map, tf: &TransferFunction, color: Color32) {
    let mut line: Vec<Pos2> = Vec::new();
    let mut push = |value: f64, amount: f64| line.push(pos2(map.x(value), map.y(amount)));
    let first = tf.points[0];
    push(map.range[0].min(first.value), first.amount);
    for pair in tf.points.windows(2) {
        push(pair[0].value, pair[0].amount);
        if map.axis == AmountAxis::Logarithmic {
            for i in 1..24 {
                let t = f64::from(i) / 24.0;
                // Finer towards the lower end, where the logarithm is steep.
                let t = if pair[0].amount < pair[1].amount { t.powi(3) } else { 1.0 - (1.0 - t).powi(3) };
                push(
                    pair[0].value + t * (pair[1].value - pair[0].value),
                    pair[0].amount + t * (pair[1].amount - pair[0].amount),
                );
            }
        }
    }
    let last = tf.points[tf.points.len() - 1];
    push(last.value, last.amount);
    push(map.range[1].max(last.value), last.amount);
    painter.line(line, Stroke::new(1.8, color));
}

/// Adds the colour bar of the transfer function to a mesh, in columns two screen points wide.
pub(super) fn add_bar(mesh: &mut Mesh, bar: Rect, map: &Map, tf: &TransferFunction) {
    let steps = (bar.width() / 2.0).ceil() as usize;
    for i in 0..steps {
        let x = bar.left() + 2.0 * i as f32;
        let [r, g, b] = tf.color(map.value(x + 1.0)).map(color::srgb8_from_linear);
        let column = Rect::from_min_max(pos2(x, bar.top()), pos2((x + 2.0).min(bar.right()), bar.bottom()));
        mesh.add_colored_rect(column, Color32::from_rgb(r, g, b));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, -0.0, 0.25, 0.1234567, 1234.56, -700.0, 1e-5, 123456.0].map(short);
        assert_eq!(texts, ["0", "0", "0.25", "0.1235", "1235", "-700", "1.000e-5", "1.235e5"]);
    }
}
