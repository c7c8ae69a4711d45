//! What Escape closes: of all that lies over the view the topmost alone.

use super::windows::Windows;
use super::{comparison, help, probe};
use crate::app::model::Model;
use eframe::egui::{self, Key, Modifiers};

/// Closes the topmost of the windows over the view where Escape was pressed. A question that is open takes the key itself,
/// and so do a list that is open and a field that is being typed into.
pub fn leave_topmost(context: &egui::Context, model: &mut Model, windows: &mut Windows) {
    if windows.typing || windows.prompt.is_open() || egui::Popup::is_any_open(context) {
        return;
    }
    let open = [
        (probe::TITLE, model.probe.is_some()),
        (comparison::TITLE, windows.comparison.open),
        (help::TITLE, windows.help),
    ];
    // Windows are called by their titles ([`egui::Window::id`]); one that is not painted yet comes on top.
    let place = |title: &str| {
        let layer = egui::LayerId::new(egui::Order::Middle, egui::Id::unique(title));
        context.memory(|m| m.layer_ids().position(|other| other == layer)).unwrap_or(usize::MAX)
    };
    let open = open.into_iter().filter_map(|(title, open)| open.then_some(title));
    let Some(topmost) = open.max_by_key(|title| place(title)) else { return };
    if !context.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape)) {
        return;
    }
    match topmost {
        help::TITLE => windows.help = false,
        comparison::TITLE => windows.comparison.open = false,
        _ => model.probe = None,
    }
}
