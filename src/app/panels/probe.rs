//! Probe window: plots transmittance against depth along the light ray through a point, exact and by each shadow
//! method.

use super::widgets::method_name;
use crate::app::model::Model;
use crate::app::theme;
use crate::engine::messages::{MethodCurve, NearestRay, ProbedBound};
use eframe::egui;
use egui_plot::{Legend, Line, Plot, PlotPoints, VLine};

/// Title of the probe window, which plots transmittance along a light ray.
pub const TITLE: &str = "Probe";

/// Minimum height of the transmittance plot in the probe window, screen points.
const MIN_HEIGHT: f32 = 140.0;

/// Shows the probe window, a plot of transmittance along a light ray, while a point is probed.
pub fn show(context: &egui::Context, model: &mut Model) {
    let Some(probe) = &model.probe else { return };
    let units = model.document.as_ref().map_or("", |d| d.tf.units.as_str());
    let mut open = true;
    let rect = model.view.unwrap_or(context.content_rect());
    egui::Window::new(TITLE)
        .id(egui::Id::unique(TITLE))
        .open(&mut open)
        .default_pos(rect.left_top() + egui::vec2(12.0, 12.0))
        .default_size(egui::vec2(430.0, 320.0).min(rect.size() - egui::vec2(40.0, 70.0)))
        .max_size(context.content_rect().size() - egui::vec2(40.0, 70.0))
        .vscroll(true)
        .show(context, |ui| {
            let colors = theme::colors(ui.visuals());
            let p = probe.point;
            ui.label(format!(
                "{:.2}, {:.2}, {:.2} mm (RAS) · value {:.2} {units} · {:.2} mm along the light ray",
                p.x, p.y, p.z, probe.value, probe.depth_mm
            ));
            egui::Grid::new("probe").num_columns(3).striped(true).spacing([18.0, 3.0]).show(ui, |ui| {
                ui.weak("method");
                ui.weak("T here").on_hover_text("Transmittance from the light to the point");
                ui.weak("error").on_hover_text("T of the method minus the exact one");
                ui.end_row();
                ui.strong("exact");
                ui.monospace(format!("{:.5}", probe.exact_at_point));
                ui.end_row();
                for (i, curve) in probe.methods.iter().enumerate() {
                    ui.colored_label(colors.methods[i % 2], &curve.spec);
                    ui.monospace(format!("{:.5}", curve.at_point));
                    ui.monospace(format!("{:+.5}", curve.at_point - probe.exact_at_point));
                    ui.end_row();
                }
            });
            for curve in &probe.methods {
                ui.add(egui::Label::new(egui::RichText::new(describe_bound(curve)).weak()).wrap());
            }
            let exact = ui.visuals().strong_text_color();
            let names = probe.methods.iter().map(|curve| method_name(&curve.spec)).collect::<Vec<_>>();
            let same = names.len() == 2 && names[0] == names[1];
            // Height that remains for the plot.
            let used = ui.cursor().top() - ui.min_rect().top();
            let height = (ui.clip_rect().height() - used - 16.0).max(MIN_HEIGHT);
            Plot::new("transmittance")
                .height(height)
                // The last tick label extends beyond the axis.
                .width(ui.available_width() - 14.0)
                .legend(Legend::default())
                .include_y(0.0)
                .include_y(1.0)
                .x_axis_label("depth along the light ray, mm")
                .y_axis_label("T")
                .allow_scroll(false)
                .show(ui, |plot| {
                    for (i, curve) in probe.methods.iter().enumerate() {
                        let points = PlotPoints::from(curve.points.clone());
                        // The settings are above: the legend has no space for them.
                        let name = if same { curve.spec.as_str() } else { method_name(&curve.spec) };
                        plot.line(Line::new(name.to_owned(), points).color(colors.methods[i % 2]).width(2.0));
                    }
                    let points = PlotPoints::from(probe.exact.clone());
                    plot.line(Line::new("exact", points).color(exact).width(1.2));
                    plot.vline(VLine::new("the point", probe.depth_mm).color(colors.probe));
                });
        });
    if !open {
        model.probe = None;
    }
}

/// Describes the error bound of a shadow method, and whether it is satisfied on a light ray near the probed point.
fn describe_bound(curve: &MethodCurve) -> String {
    let name = method_name(&curve.spec);
    let Some(ProbedBound { bound, nearest }) = curve.bound else {
        return format!("{name} has no error bound with these settings.");
    };
    let bound = format!(
        "Error bound of {name}: ± {:.4} within {:.3} mm of depth, on light rays through texel centres, not between them.",
        bound.transmittance, bound.depth_mm
    );
    let Some(NearestRay { texels_away, largest, satisfied }) = nearest else {
        return format!("{bound} No texel lies here.");
    };
    let result = match satisfied {
        true => {
            format!("satisfied; the largest error at one depth is {largest:.4}, without the depth tolerance.")
        }
        false => "not satisfied: please report this.".to_owned(),
    };
    format!("{bound} On the nearest such ray, {texels_away:.2} texels away, it is {result}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::Bound;

    #[test]
    fn the_error_bound_is_described_with_its_test() {
        let curve = |bound| MethodCurve { spec: "dsm:map=64".into(), points: vec![], at_point: 0.5, bound };
        let words = |nearest| {
            let bound = Bound { transmittance: 0.0235, depth_mm: 0.31, ..Bound::default() };
            describe_bound(&curve(Some(ProbedBound { bound, nearest })))
        };
        let ray = NearestRay { texels_away: 0.4, largest: 0.2, satisfied: true };
        let text = words(Some(ray));
        for part in [
            "dsm: ± 0.0235 within 0.310 mm",
            "centres",
            "not between",
            "0.40 texels",
            "is satisfied",
            "0.2000",
        ] {
            assert!(text.contains(part), "{text}");
        }
        assert!(words(Some(NearestRay { satisfied: false, ..ray })).contains("not satisfied"));
        assert!(words(None).contains("No texel lies here"));
        let none = describe_bound(&curve(None));
        assert!(none.contains("dsm has no error bound") && !none.contains('±'), "{none}");
    }
}
