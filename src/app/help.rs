//! Keys, and the overlay that lists them.

use super::App;
use super::prompt::Purpose;
use eframe::egui::{self, Key, KeyboardShortcut, Modifiers};

const HANDS: [(&str, &str); 10] = [
    ("Drag", "turn the camera"),
    ("Shift + drag", "move the light"),
    ("Right or middle drag, Ctrl + drag", "pan"),
    ("Wheel", "zoom to the cursor"),
    ("Click", "probe: transmittance against depth there"),
    ("Drag the line (split view)", "wipe between the two methods"),
    ("Editor: drag a point", "change value and opacity"),
    ("Editor: double-click", "add a point"),
    ("Editor: drag beside the points", "window and level"),
    ("Drop a file", "open a volume, strands or a scene; load a transfer function"),
];

const KEYS: [(&str, &str); 16] = [
    ("Ctrl+O", "open a volume, strands or a scene"),
    ("Ctrl+S", "save the scene"),
    ("Ctrl+E", "export a picture"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo (transfer function)"),
    ("1 … 6", "look from anterior, posterior, left, right, superior, inferior"),
    ("Home", "reset the camera"),
    ("C", "split view on or off"),
    ("X", "switch the two methods"),
    ("F", "flicker between the two methods on or off"),
    ("D", "error against exact: of the light, of the picture, off"),
    ("T", "compare methods: errors and times as a table"),
    ("V", "slices on or off"),
    ("M", "anatomical marks on or off"),
    ("Delete", "remove the selected point"),
    ("Esc", "close the probe"),
    ("F1", "this list"),
];

impl App {
    pub(super) fn shortcuts(&mut self, context: &egui::Context) {
        let hit = |modifiers: Modifiers, key: Key| {
            context.input_mut(|i| i.consume_shortcut(&KeyboardShortcut::new(modifiers, key)))
        };
        if hit(Modifiers::NONE, Key::F1) {
            self.show_help = !self.show_help;
        }
        if hit(Modifiers::COMMAND, Key::O) {
            self.ask_path(Purpose::OpenVolume);
        }
        // Letters and digits belong to whatever is being typed, Escape to a question that is open.
        if context.text_edit_focused() || self.is_asking() || self.document.is_none() {
            return;
        }
        if hit(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || hit(Modifiers::COMMAND, Key::Y) {
            self.redo();
        }
        if hit(Modifiers::COMMAND, Key::Z) {
            self.undo();
        }
        if hit(Modifiers::COMMAND, Key::S) {
            self.ask_path(Purpose::SaveScene);
        }
        if hit(Modifiers::COMMAND, Key::E) {
            self.ask_path(Purpose::ExportPicture);
        }
        for (i, key) in
            [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6].into_iter().enumerate()
        {
            if hit(Modifiers::NONE, key) {
                self.look_from(i);
            }
        }
        if hit(Modifiers::NONE, Key::Home) {
            self.reset_camera();
        }
        if hit(Modifiers::NONE, Key::C) {
            self.set_split(self.split.is_none());
        }
        if hit(Modifiers::NONE, Key::D) {
            self.next_difference();
        }
        if hit(Modifiers::NONE, Key::X)
            && let Some(document) = &mut self.document
        {
            std::mem::swap(&mut document.method, &mut document.other);
        }
        if hit(Modifiers::NONE, Key::F) {
            self.set_flicker(self.flicker.is_none(), context);
        }
        if hit(Modifiers::NONE, Key::T) {
            self.toggle_comparison();
        }
        if hit(Modifiers::NONE, Key::V) {
            self.settings.slices = !self.settings.slices;
        }
        if hit(Modifiers::NONE, Key::M) {
            self.settings.marks = !self.settings.marks;
        }
        // Without a probe it belongs to whatever list is open.
        if self.probe.is_some() && hit(Modifiers::NONE, Key::Escape) {
            self.close_probe();
        }
    }

    pub(super) fn help_window(&mut self, context: &egui::Context) {
        let mut open = self.show_help;
        egui::Window::new("Keys and hands")
            .open(&mut open)
            .collapsible(false)
            .resizable(false)
            .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
            .show(context, |ui| {
                for (title, rows) in [("Hands", &HANDS[..]), ("Keys", &KEYS[..])] {
                    ui.strong(title);
                    egui::Grid::new(title).num_columns(2).striped(true).spacing([24.0, 4.0]).show(ui, |ui| {
                        for (what, does) in rows {
                            ui.monospace(*what);
                            ui.label(*does);
                            ui.end_row();
                        }
                    });
                    ui.add_space(6.0);
                }
            });
        self.show_help = open;
    }
}
