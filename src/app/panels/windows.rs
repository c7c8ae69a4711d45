//! Floating windows over the picture: path prompt, comparison, gradient opacity and help.

use super::comparison::{self, Comparison};
use super::gradient::{self, Gradient};
use super::prompt::Prompt;
use super::{help, probe};
use crate::app::model::Model;
use eframe::egui::{self, Key, Modifiers};

/// State of the floating windows over the picture: path prompt, comparison, gradient opacity and help.
#[derive(Default)]
pub struct Windows {
    pub prompt: Prompt,
    pub comparison: Comparison,
    pub gradient: Gradient,
    /// Whether the help window with keyboard shortcuts is open.
    pub help: bool,
    /// Whether a text field had the keyboard focus in the last frame. egui removes the focus before it reports
    /// Escape.
    pub typing: bool,
}

impl Windows {
    /// Closes the topmost floating window on Escape. Path prompts, open lists and text fields handle Escape
    /// themselves.
    pub fn close_topmost(&mut self, context: &egui::Context, model: &mut Model) {
        if self.typing || self.prompt.is_open() || egui::Popup::is_any_open(context) {
            return;
        }
        let open = [
            (probe::TITLE, model.probe.is_some()),
            (comparison::TITLE, self.comparison.open),
            (gradient::TITLE, self.gradient.open),
            (help::TITLE, self.help),
        ];
        // A window that has not been painted yet will be on top.
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
            help::TITLE => self.help = false,
            comparison::TITLE => self.comparison.open = false,
            gradient::TITLE => self.gradient.open = false,
            _ => model.probe = None,
        }
    }
}
