//! Help window: keyboard shortcuts and pointer actions of the viewer.

use eframe::egui;

/// Title of the help window with the keyboard shortcuts and pointer actions.
pub const TITLE: &str = "Keys and pointer";

/// Keyboard shortcuts and pointer actions of the viewer, each with its description.
const KEYS: [(&str, &str); 18] = [
    ("Ctrl+O", "open a volume, strands or a scene"),
    ("Ctrl+S", "save the scene"),
    ("Ctrl+E", "export a picture"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo (transfer function)"),
    ("1 … 6", "look from anterior, posterior, left, right, superior, inferior"),
    ("Home", "reset the camera"),
    ("0", "frame the visible part"),
    ("C", "split view on or off"),
    ("X", "switch the two methods"),
    ("F", "flicker between the two methods on or off"),
    ("D", "error against exact: light, picture, off"),
    ("T", "compare methods in a table"),
    ("V", "slices on or off"),
    ("M", "anatomical letters on or off"),
    ("O", "orientation cube on or off"),
    ("Delete", "remove the selected point"),
    ("Esc", "close the topmost: prompt, this list, comparison, gradient opacity, probe"),
    ("F1", "this list"),
];

const POINTER: [(&str, &str); 10] = [
    ("Drag", "rotate the camera"),
    ("Shift + drag", "move the light"),
    ("Right or middle drag, Ctrl + drag", "pan"),
    ("Wheel", "zoom to the cursor"),
    ("Click", "probe: transmittance against depth there"),
    ("Drag the line (split view)", "move the split"),
    ("Editor: drag a point", "change value and opacity"),
    ("Editor: double-click", "add a point"),
    ("Editor: drag beside the points", "window and level"),
    ("Drop a file", "open a volume, strands or a scene; load a transfer function"),
];

/// Size of the help window that shows all keyboard shortcuts without scrolling, screen points.
const SIZE: egui::Vec2 = egui::vec2(720.0, 760.0);

/// Shows the help window with the keyboard shortcuts while `open` is set.
pub fn show(context: &egui::Context, open: &mut bool) {
    let most = context.content_rect().size() - egui::vec2(40.0, 70.0);
    egui::Window::new(TITLE)
        .id(egui::Id::unique(TITLE))
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
        .scroll(true)
        .default_size(SIZE.min(most))
        .max_size(most)
        .show(context, |ui| {
            for (title, rows) in [("Pointer", &POINTER[..]), ("Keys", &KEYS[..])] {
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
}
