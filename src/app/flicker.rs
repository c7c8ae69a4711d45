//! Flicker: the two pictures of a comparison in turn over the whole view. Both are finished, nothing is drawn for it.

use super::App;
use super::viewport::tag;
use super::worker::{Frame, Side};
use eframe::egui::{self, Align2, Rect, Sense, vec2};
use std::ops::RangeInclusive;
use std::time::Duration;

/// Changes a second.
pub const RATES_HZ: RangeInclusive<f64> = 0.5..=8.0;
pub const DEFAULT_RATE_HZ: f64 = 2.0;

/// Flicker that is on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flicker {
    /// When it began, seconds of the interface's clock.
    since_s: f64,
}

impl Flicker {
    /// Which picture is shown at a time, 0 or 1, and how long until the other one is, seconds.
    fn at(&self, now_s: f64, rate_hz: f64) -> (usize, f64) {
        let changes = ((now_s - self.since_s) * rate_hz).max(0.0);
        let count = changes.floor();
        ((count % 2.0) as usize, (count + 1.0 - changes) / rate_hz)
    }
}

impl App {
    /// Turns flicker on, with the second picture that it needs, or off.
    pub fn set_flicker(&mut self, on: bool, context: &egui::Context) {
        self.flicker = on.then(|| Flicker { since_s: context.input(|i| i.time) });
        if on {
            self.split.get_or_insert(0.5);
        }
    }

    /// Splits the view between two methods, or not.
    pub fn set_split(&mut self, on: bool) {
        self.split = on.then_some(0.5);
        if !on {
            self.flicker = None;
        }
    }

    /// The side of the comparison that fills the view; `None` while there is nothing to flicker between.
    pub fn flicker_side(&self, context: &egui::Context) -> Option<usize> {
        let flicker = self.flicker.filter(|_| self.split.is_some())?;
        self.frame.as_ref()?.other.as_ref()?;
        Some(flicker.at(context.input(|i| i.time), self.settings.flicker_hz).0)
    }

    /// Wakes the interface when the next change is due, and no sooner.
    pub(super) fn tick_flicker(&self, context: &egui::Context) {
        let (Some(flicker), Some(_)) = (self.flicker, self.flicker_side(context)) else { return };
        let (_, wait_s) = flicker.at(context.input(|i| i.time), self.settings.flicker_hz);
        context.request_repaint_after(Duration::from_secs_f64(wait_s));
    }

    /// The method that fills the view now.
    pub(super) fn paint_flicker(&self, ui: &egui::Ui, rect: Rect) {
        let (Some(frame), Some(side)) = (&self.frame, self.flicker_side(ui.ctx())) else { return };
        let spec = &side_of(frame, side).spec;
        let at = rect.center_top() + vec2(0.0, 34.0);
        tag(&ui.painter_at(rect), at, Align2::CENTER_TOP, spec);
        let place = Rect::from_center_size(at, vec2(2.0, 2.0));
        let label = ui.interact(place, ui.scope_id().with("flicker"), Sense::empty());
        label.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, format!("shown: {spec}")));
    }

    /// The switch and the rate, below the second method.
    pub(super) fn flicker_controls(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            let mut on = self.flicker.is_some();
            let toggle = ui.checkbox(&mut on, "Flicker");
            let tooltip =
                "The two finished pictures in turn over the whole view; nothing is drawn for it (F)";
            if toggle.on_hover_text(tooltip).changed() {
                self.set_flicker(on, ui.ctx());
            }
            let rate = egui::DragValue::new(&mut self.settings.flicker_hz)
                .range(RATES_HZ)
                .speed(0.05)
                .max_decimals(2)
                .suffix(" Hz");
            ui.add(rate)
                .on_hover_text("Changes a second, 0.5 to 8 Hz; at 2 Hz each picture stays for half a second")
                .accessible_name("flicker rate");
        });
    }
}

/// A frame's picture by its place in the comparison.
pub fn side_of(frame: &Frame, side: usize) -> &Side {
    match (&frame.other, side) {
        (Some(other), 1) => other,
        _ => &frame.main,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_change_as_often_as_the_rate_says() {
        let flicker = Flicker { since_s: 10.0 };
        for (now_s, side, wait_s) in [(10.0, 0, 0.5), (10.25, 0, 0.25), (10.5, 1, 0.5), (11.75, 1, 0.25)] {
            assert_eq!(flicker.at(now_s, 2.0), (side, wait_s), "{now_s}");
        }
        assert_eq!(flicker.at(9.0, 2.0), (0, 0.5), "a clock that was set back");
        let mut changes = 0;
        let mut before = 0;
        for step in 0..10_000 {
            let (side, wait_s) = flicker.at(10.0 + 0.001 * f64::from(step), 8.0);
            assert!(wait_s > 0.0 && wait_s <= 0.125);
            changes += usize::from(side != before);
            before = side;
        }
        assert_eq!(changes, 79, "8 a second for 10 seconds, the first of them at the start");
    }
}
