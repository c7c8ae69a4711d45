//! Keyboard shortcuts of the viewer window.

use super::difference::Difference;
use super::prompt::Purpose;
use super::windows::Windows;
use crate::app::model::Model;
use eframe::egui::{self, Key, KeyboardShortcut, Modifiers};

/// Handles the keyboard shortcuts pressed in this frame.
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
    // Text fields and prompts take letters and digits.
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
    let keys = [Key::Home, Key::Num0, Key::C, Key::D, Key::X, Key::F, Key::T, Key::V, Key::M, Key::O];
    for key in keys.into_iter().filter(|key| hit(Modifiers::NONE, *key)) {
        let Some(document) = &mut model.document else { return };
        let settings = &mut model.settings;
        match key {
            Key::Home => document.scene.camera = document.home,
            Key::Num0 => document.frame_visible(),
            Key::C => model.split.set(model.split.share.is_none()),
            Key::D => difference.show_next(),
            Key::X => std::mem::swap(&mut document.method, &mut document.other),
            Key::F => model.split.set_flicker(!model.split.flickers(), context.input(|i| i.time)),
            Key::T => windows.comparison.open = !windows.comparison.open,
            Key::V => settings.slices = !settings.slices,
            Key::M => settings.marks = !settings.marks,
            _ => settings.cube = !settings.cube,
        }
    }
}
