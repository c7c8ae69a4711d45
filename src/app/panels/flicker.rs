//! Flicker between the two pictures of a split: which one fills the view, and its controls.

use super::parts::tag;
use crate::app::model::Model;
use crate::app::split::RATES_HZ;
use eframe::egui::{self, Align2, Rect, Sense, vec2};
use std::time::Duration;

/// The side of the comparison that fills the view, and how long it will, seconds; `None` while there is nothing to flicker
/// between.
fn now(model: &Model, context: &egui::Context) -> Option<(usize, f64)> {
    model.frame.as_ref()?.other.as_ref()?;
    model.split.flicker_at(context.input(|i| i.time), model.settings.flicker_hz)
}

/// The side of the comparison that fills the view.
pub fn side(model: &Model, context: &egui::Context) -> Option<usize> {
    now(model, context).map(|(side, _)| side)
}

/// Wakes the interface when the next change is due, and no sooner.
pub fn wake(model: &Model, context: &egui::Context) {
    if let Some((_, wait_s)) = now(model, context) {
        context.request_repaint_after(Duration::from_secs_f64(wait_s));
    }
}

/// The method that fills the view now, at the top; returns how far down its name reaches, where there is flicker.
pub fn paint(model: &Model, ui: &egui::Ui, rect: Rect) -> Option<f32> {
    let side = model.frame.as_ref()?.sides().nth(side(model, ui.ctx())?)?;
    let at = rect.center_top() + vec2(0.0, 8.0);
    let shown = tag(ui, rect, at, Align2::CENTER_TOP, &side.spec, rect.width() - 16.0);
    let place = Rect::from_center_size(at, vec2(2.0, 2.0));
    let label = ui.interact(place, ui.scope_id().with("flicker"), Sense::empty());
    label.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, format!("shown: {}", side.spec)));
    Some(shown.bottom())
}

/// The switch and the rate, below the second method.
pub fn controls(model: &mut Model, ui: &mut egui::Ui) {
    ui.horizontal(|ui| {
        let mut on = model.split.flickers();
        let toggle = ui.checkbox(&mut on, "Flicker");
        let tooltip = "The two finished pictures in turn over the whole view; nothing is drawn for it (F)";
        if toggle.on_hover_text(tooltip).changed() {
            model.split.set_flicker(on, ui.input(|i| i.time));
        }
        let rate = egui::DragValue::new(&mut model.settings.flicker_hz)
            .range(RATES_HZ)
            .speed(0.05)
            .max_decimals(2)
            .suffix(" Hz");
        ui.add(rate)
            .on_hover_text("Changes a second, 0.5 to 8 Hz; at 2 Hz each picture stays for half a second")
            .accessible_name("flicker rate");
    });
}
