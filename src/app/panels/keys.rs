//! What keys do.

use super::difference::Difference;
use super::prompt::Purpose;
use super::windows::Windows;
use crate::app::model::Model;
use eframe::egui::{self, Key, KeyboardShortcut, Modifiers};

/// Each key with what it does.
pub const KEYS: [(&str, &str); 18] = [
    ("Ctrl+O", "open a volume, strands or a scene"),
    ("Ctrl+S", "save the scene"),
    ("Ctrl+E", "export a picture"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo (transfer function)"),
    ("1 … 6", "look from anterior, posterior, left, right, superior, inferior"),
    ("Home", "reset the camera"),
    ("0", "frame what the transfer function shows"),
    ("C", "split view on or off"),
    ("X", "switch the two methods"),
    ("F", "flicker between the two methods on or off"),
    ("D", "error against exact: of the light, of the picture, off"),
    ("T", "compare methods: errors and times as a table"),
    ("V", "slices on or off"),
    ("M", "anatomical letters on or off"),
    ("O", "orientation cube on or off"),
    ("Delete", "remove the selected point"),
    ("Esc", "close what lies on top: a question, this list, the comparison, the probe"),
    ("F1", "this list"),
];

/// Does what the keys say that were pressed.
pub fn shortcuts(
    context: &egui::Context,
    model: &mut Model,
    windows: &mut Windows,
    difference: &mut Difference,
) {
    let hit = |modifiers: Modifiers, key: Key| {
        context.input_mut(|i| i.consume_shortcut(&KeyboardShortcut::new(modifiers, key)))
    };
    if hit(Modifiers::NONE, Key::F1) {
        windows.help = !windows.help;
    }
    if hit(Modifiers::COMMAND, Key::O) {
        windows.prompt.ask(model, Purpose::OpenVolume);
    }
    // Letters and digits belong to whatever is being typed, and nothing goes past a question that is open.
    if context.text_edit_focused() || windows.prompt.is_open() || model.document.is_none() {
        return;
    }
    if hit(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || hit(Modifiers::COMMAND, Key::Y) {
        model.redo();
    }
    if hit(Modifiers::COMMAND, Key::Z) {
        model.undo();
    }
    if hit(Modifiers::COMMAND, Key::S) {
        windows.prompt.ask(model, Purpose::SaveScene);
    }
    if hit(Modifiers::COMMAND, Key::E) {
        windows.prompt.ask(model, Purpose::ExportPicture);
    }
    for (i, key) in [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6].into_iter().enumerate()
    {
        if hit(Modifiers::NONE, key) {
            model.look_from(i);
        }
    }
    if hit(Modifiers::NONE, Key::Home) {
        model.reset_camera();
    }
    if hit(Modifiers::NONE, Key::Num0)
        && let Some(document) = &mut model.document
    {
        document.frame_seen();
    }
    if hit(Modifiers::NONE, Key::C) {
        model.split.set(model.split.share.is_none());
    }
    if hit(Modifiers::NONE, Key::D) {
        difference.show_next();
    }
    if hit(Modifiers::NONE, Key::X)
        && let Some(document) = &mut model.document
    {
        std::mem::swap(&mut document.method, &mut document.other);
    }
    if hit(Modifiers::NONE, Key::F) {
        model.split.set_flicker(!model.split.flickers(), context.input(|i| i.time));
    }
    if hit(Modifiers::NONE, Key::T) {
        windows.comparison.open = !windows.comparison.open;
    }
    if hit(Modifiers::NONE, Key::V) {
        model.settings.slices = !model.settings.slices;
    }
    if hit(Modifiers::NONE, Key::M) {
        model.settings.marks = !model.settings.marks;
    }
    if hit(Modifiers::NONE, Key::O) {
        model.settings.cube = !model.settings.cube;
    }
}
