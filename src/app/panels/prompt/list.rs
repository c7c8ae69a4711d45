//! A field for a path with a list of what it may go on to. Up and down choose from the list, Enter takes what is chosen (a
//! folder is entered) or confirms what is typed, Tab types on as far as all that is listed agrees.

use super::listing::{Listing, expanded, path_of, split};
use eframe::egui::text::{CCursor, CCursorRange};
use eframe::egui::text_edit::TextEditState;
use eframe::egui::{self, Key, Modifiers};

/// Rows of the list that are seen at once.
const ROWS: usize = 9;

/// The field, and the list below it.
#[derive(Default)]
pub struct PathField {
    /// What is typed.
    pub text: String,
    endings: Vec<&'static str>,
    /// A file of the list would be written over: it is put into the field, and no more.
    saves: bool,
    listing: Listing,
    /// The path that the list is for: what was typed, and not what was clicked since.
    begun: String,
    /// The entry that the arrow keys have come to.
    chosen: Option<usize>,
    /// That one is to be scrolled to.
    scroll: bool,
    /// The cursor is to come back, wherever it is.
    focus: bool,
    /// The name that is suggested is to be selected, so that typing replaces it.
    select: bool,
}

impl PathField {
    /// With a text to begin with, for files with these endings, which are to be saved or else opened.
    pub fn new(text: String, endings: Vec<&'static str>, saves: bool) -> Self {
        // A name that is suggested is not to hide what is there.
        let begun = split(&text).0.to_owned();
        Self { text, endings, saves, begun, select: true, ..Self::default() }
    }

    /// The path that is typed, with the home folder in place of `~`.
    pub fn path(&self) -> String {
        expanded(self.text.trim())
    }

    /// The folder that is typed; `None` where there is none.
    pub fn folder(&self) -> Option<String> {
        let path = self.path();
        let folder = split(&path).0;
        std::path::Path::new(folder).is_dir().then(|| folder.to_owned())
    }

    /// Puts a path in place of what is typed.
    pub fn put(&mut self, path: String) {
        self.begun.clone_from(&path);
        (self.text, self.chosen) = (path, None);
    }

    /// Puts a path that was chosen elsewhere, and the cursor back into the field.
    pub fn choose(&mut self, path: String) {
        self.put(path);
        self.focus = true;
    }

    /// Puts the cursor behind what is typed.
    fn go_to_end(&self, ui: &egui::Ui) {
        self.select_behind(ui, &self.text);
    }

    /// Selects what stands behind a beginning of what is typed.
    fn select_behind(&self, ui: &egui::Ui, beginning: &str) {
        let [from, to] = [beginning, self.text.as_str()].map(CCursor::end_of_str);
        let mut state = TextEditState::load(ui.ctx(), field_id()).unwrap_or_default();
        state.cursor.set_char_range(Some(CCursorRange::two(from, to)));
        state.store(ui.ctx(), field_id());
    }

    /// Shows the field: whether Enter confirms what is typed, or chosen.
    pub fn show(&mut self, ui: &mut egui::Ui, width: f32) -> bool {
        self.listing.follow(&self.begun, &self.endings);
        let mut done = false;
        if std::mem::take(&mut self.select) {
            self.select_behind(ui, split(&self.text).0);
            self.focus = true;
        }
        // What the list takes the field must not see.
        if ui.memory(|m| m.has_focus(field_id())) {
            done = self.follow_keys(ui);
        }
        let field = egui::TextEdit::singleline(&mut self.text).id(field_id()).desired_width(width);
        let field = ui.add(field.hint_text("path").lock_focus(true)).accessible_name("path");
        if field.changed() {
            self.put(self.text.clone());
        }
        // Before the field takes the cursor back, which Enter has taken from it.
        done |= field.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
        let lost = !field.has_focus() && ui.memory(|m| m.focused().is_none());
        if lost || std::mem::take(&mut self.focus) {
            field.request_focus();
        }
        done
    }

    /// Follows the keys that are the list's: whether a file was taken.
    fn follow_keys(&mut self, ui: &egui::Ui) -> bool {
        let hit = |key: Key| ui.input_mut(|i| i.consume_key(Modifiers::NONE, key));
        let count = self.listing.matching(&self.begun).len();
        if ui.input_mut(|i| i.consume_key(Modifiers::SHIFT, Key::Tab)) {
            ui.memory_mut(|m| m.move_focus(egui::FocusDirection::Previous));
        } else if hit(Key::Tab) {
            if let Some(path) = self.listing.completed(&self.text).filter(|path| *path != self.text) {
                self.put(path);
                self.go_to_end(ui);
            } else {
                // Nothing to add: on to the next widget, as ever.
                ui.memory_mut(|m| m.move_focus(egui::FocusDirection::Next));
            }
        }
        let moved = match (hit(Key::ArrowDown), hit(Key::ArrowUp), self.chosen) {
            _ if count == 0 => None,
            (true, _, None) => Some(0),
            (true, _, Some(at)) => Some((at + 1) % count),
            (_, true, at) => Some(at.unwrap_or(0).checked_sub(1).unwrap_or(count - 1)),
            _ => None,
        };
        if moved.is_some() {
            (self.chosen, self.scroll) = (moved, true);
        }
        let Some(chosen) = self.chosen.filter(|chosen| *chosen < count) else { return false };
        hit(Key::Enter) && self.take(ui, chosen) && !self.saves
    }

    /// Takes an entry of the list: whether it is a file.
    fn take(&mut self, ui: &egui::Ui, at: usize) -> bool {
        let matching = self.listing.matching(&self.begun);
        let Some(entry) = matching.get(at) else { return false };
        let (path, is_file) = (path_of(split(&self.begun).0, entry), !entry.is_folder);
        if is_file {
            (self.text, self.chosen) = (path, Some(at));
        } else {
            self.put(path);
        }
        self.go_to_end(ui);
        self.focus = true;
        is_file
    }

    /// Shows the list, always as high, so that nothing moves while a name is typed: whether a file was taken from it.
    pub fn list(&mut self, ui: &mut egui::Ui) -> bool {
        self.listing.follow(&self.begun, &self.endings);
        let row = ui.spacing().interact_size.y;
        let step = row + ui.spacing().item_spacing.y;
        let size = egui::vec2(ui.available_width(), ROWS as f32 * step);
        let taken = ui.allocate_ui_with_layout(size, egui::Layout::top_down(egui::Align::Min), |ui| {
            ui.set_min_size(size);
            self.entries(ui, [row, step])
        });
        let Some((at, twice)) = taken.inner else { return false };
        // A folder that is entered puts another entry below the pointer before the second click.
        let same = self.chosen == Some(at);
        self.take(ui, at) && twice && same && !self.saves
    }

    /// The entries, whose rows are so high, without and with what lies between them: the one that was clicked, and whether
    /// twice.
    fn entries(&mut self, ui: &mut egui::Ui, [row, step]: [f32; 2]) -> Option<(usize, bool)> {
        // What names a built-in volume is no path.
        if self.text.starts_with("phantom:") {
            return None;
        }
        let found = self.listing.matching(&self.begun);
        if found.is_empty() {
            ui.weak(self.listing.trouble.as_deref().unwrap_or("Nothing here begins so"));
            return None;
        }
        let mut area = egui::ScrollArea::vertical().auto_shrink(false);
        if let Some(at) = self.chosen.filter(|_| std::mem::take(&mut self.scroll)) {
            area = area.vertical_scroll_offset(step * at.saturating_sub(ROWS / 2) as f32);
        }
        let chosen = self.chosen;
        let mut taken = None;
        area.show_rows(ui, row, found.len(), |ui, rows| {
            for at in rows {
                let entry = found[at];
                let name = if entry.is_folder { format!("{}/", entry.name) } else { entry.name.clone() };
                let response = ui.selectable_label(chosen == Some(at), name);
                if response.clicked() || response.double_clicked() {
                    taken = Some((at, response.double_clicked()));
                }
            }
        });
        taken
    }
}

fn field_id() -> egui::Id {
    egui::Id::unique("path field")
}
