//! The table's rows in the window.

use super::super::method_choice::MethodChoice;
use crate::measure::table::Row;
use crate::measure::timing::clock_name;
use crate::report::best::{Held, best_within};
use crate::report::number::significant;
use crate::report::tables::{best_at_equal, best_question};
use eframe::egui;
use egui_extras::{Column as Width, TableBuilder};
use std::cmp::Ordering;

/// A longer table is scrolled within, points.
const TABLE_HEIGHT: f32 = 380.0;

/// A column's cells, which sort as what they are.
enum Cells {
    Text(fn(&Row) -> String),
    Number(fn(&Row) -> Option<f64>),
    Flag(fn(&Row) -> Option<bool>),
    /// Whether it is the best at equal bytes or time.
    Best,
}

struct Column {
    heading: &'static str,
    tooltip: &'static str,
    cells: Cells,
}

const fn column(heading: &'static str, tooltip: &'static str, cells: Cells) -> Column {
    Column { heading, tooltip, cells }
}

const COLUMNS: &[Column] = &[
    column("method", "Method", Cells::Text(|r| r.method.clone())),
    column("settings", "What differs from the method's defaults", Cells::Text(|r| r.params.clone())),
    column("map", "Texels a side of the shadow map", Cells::Number(|r| r.map.map(f64::from))),
    column(
        "error rms",
        "Of transmittance at the points that the camera sees, root mean square",
        Cells::Number(|r| r.point_err_rms),
    ),
    column("error max", "The same, the largest", Cells::Number(|r| r.point_err_max)),
    column(
        "ray error max",
        "Of transmittance along light rays, the largest",
        Cells::Number(|r| r.ray_err_max),
    ),
    column(
        "MiB",
        "Memory of the shadow structure",
        Cells::Number(|r| Some(r.bytes? as f64 / f64::from(1 << 20))),
    ),
    column("build ms", "To make the shadow structure, median", Cells::Number(|r| r.build_ms)),
    column("frame ms", "One picture with it made, median", Cells::Number(|r| r.frame_ms)),
    column("fps moving", "Pictures a second while the light moves", Cells::Number(|r| r.fps_moving)),
    column("PSNR dB", "Of the picture, against the exact one", Cells::Number(|r| r.image_psnr)),
    column(
        "bound held",
        "Whether the promised bound held at every depth tested",
        Cells::Flag(|r| r.bound_held),
    ),
    column("Pareto", "No other row is at once faster and closer", Cells::Flag(|r| r.pareto)),
    column("best", "The smallest rms error at equal bytes, or equal time, as a dsm row", Cells::Best),
];

impl Column {
    /// Numbers stand at the right of a column that is as wide as its heading or five digits.
    fn width(&self) -> Width {
        match self.cells {
            Cells::Number(_) => Width::exact((7.0 * self.heading.len() as f32 + 24.0).max(58.0)),
            _ => Width::auto().at_least(36.0),
        }
    }
}

/// A row with what is known of it.
struct Entry {
    row: Row,
    /// As the shadows panel has it.
    choice: Option<MethodChoice>,
    /// At equal bytes, and at equal time.
    best: [bool; 2],
}

/// A row that was clicked.
pub struct Picked {
    pub choice: MethodChoice,
    /// For the second method.
    pub shift: bool,
}

/// Rows of a table, finished or not.
#[derive(Default)]
pub struct Results {
    entries: Vec<Entry>,
    /// What is best at equal bytes and time, each question with its lines.
    answers: Vec<(String, Vec<String>)>,
    /// Column, and whether the largest come first.
    sort: Option<(usize, bool)>,
}

impl Results {
    /// Forgets the rows.
    pub fn clear(&mut self) {
        *self = Self { sort: self.sort, ..Self::default() };
    }

    /// Takes a row of a table that is being made; `place` is its place in the table.
    pub fn put(&mut self, place: usize, row: Row) {
        // Rows come in the table's order, again and again.
        match self.entries.get_mut(place) {
            Some(entry) => entry.row = row,
            None => self.entries.push(Entry::of(row)),
        }
    }

    /// Takes a whole table.
    pub fn finish(&mut self, rows: Vec<Row>) {
        self.clear();
        let held = [Held::Bytes, Held::Time];
        let best = held.map(|held| best_within(&rows, held));
        let is_best = |row: &Row| [0, 1].map(|i| best[i].iter().any(|b| std::ptr::eq(b.best, row)));
        let marks: Vec<_> = rows.iter().map(is_best).collect();
        let answers = held.map(|held| (best_question(held), best_at_equal(&rows, held)));
        self.answers = answers.into_iter().filter(|(_, lines)| !lines.is_empty()).collect();
        self.entries = rows.into_iter().map(Entry::of).collect();
        self.entries.iter_mut().zip(marks).for_each(|(entry, best)| entry.best = best);
    }

    /// The rows in the table's order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &Row> {
        self.entries.iter().map(|e| &e.row)
    }

    /// The rows as they are sorted.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.entries.len()).collect();
        if let Some((column, largest_first)) = self.sort {
            let key = |i: &usize| COLUMNS[column].cells.key(&self.entries[*i]);
            order.sort_by(|a, b| compare(&key(a), &key(b), largest_first));
        }
        order
    }

    /// The table, and which row was clicked; `current` is the method in the view.
    pub fn show(&mut self, ui: &mut egui::Ui, current: Option<&MethodChoice>) -> Option<Picked> {
        let mut picked = None;
        if let Some(Entry { row, .. }) = self.entries.first() {
            let clock = row.clock.map_or(String::new(), |clock| format!(" · {} clock", clock_name(clock)));
            ui.weak(format!("{} · {} x {} pixels{clock}", row.scene, row.width, row.height));
        }
        egui::ScrollArea::horizontal().id_salt("comparison table").show(ui, |ui| {
            let line = ui.text_style_height(&egui::TextStyle::Body) + 4.0;
            let table = TableBuilder::new(ui)
                .striped(true)
                .sense(egui::Sense::click())
                .min_scrolled_height(TABLE_HEIGHT)
                .max_scroll_height(TABLE_HEIGHT)
                .cell_layout(egui::Layout::left_to_right(egui::Align::Center));
            let table = COLUMNS.iter().fold(table, |table, column| table.column(column.width()));
            let order = self.order();
            table
                .header(line + 2.0, |mut header| {
                    for (i, column) in COLUMNS.iter().enumerate() {
                        header.col(|ui| self.heading(ui, i, column));
                    }
                })
                .body(|body| {
                    body.rows(line, order.len(), |mut table_row| {
                        let entry = &self.entries[order[table_row.index()]];
                        table_row.set_selected(entry.choice.is_some() && entry.choice.as_ref() == current);
                        for column in COLUMNS {
                            table_row.col(|ui| column.cells.show(ui, entry));
                        }
                        let response = table_row.response();
                        let shift = response.ctx.input(|i| i.modifiers.shift);
                        if let Some(choice) = entry.choice.clone().filter(|_| response.clicked()) {
                            picked = Some(Picked { choice, shift });
                        }
                        response.on_hover_text(entry.tooltip());
                    });
                });
            // The scroll bar floats: without this it lies over the last row.
            ui.add_space(12.0);
        });
        for (question, lines) in &self.answers {
            ui.add_space(4.0);
            ui.weak(question);
            for line in lines {
                ui.label(line);
            }
        }
        picked
    }

    /// A heading, which sorts: smallest first, then largest first, then as the table was made.
    fn heading(&mut self, ui: &mut egui::Ui, i: usize, column: &Column) {
        let arrow = match self.sort {
            Some((sorted, false)) if sorted == i => "↑",
            Some((sorted, true)) if sorted == i => "↓",
            _ => "",
        };
        // Only the monospaced font has arrows.
        let text = (egui::RichText::new(column.heading).strong(), egui::RichText::new(arrow).monospace());
        let button = ui.add(egui::Button::new(text).frame(false)).on_hover_text(column.tooltip);
        if button.accessible_name(format!("sort by {}", column.heading)).clicked() {
            self.sort = match self.sort {
                Some((sorted, false)) if sorted == i => Some((i, true)),
                Some((sorted, true)) if sorted == i => None,
                _ => Some((i, false)),
            };
        }
    }
}

impl Entry {
    fn of(row: Row) -> Self {
        let choice = MethodChoice::parse(&row.spec()).ok();
        Self { row, choice, best: [false; 2] }
    }

    fn tooltip(&self) -> String {
        let row = &self.row;
        let mut text = String::from("Click: into the shadows panel; Shift-click: as the second method");
        for more in [&row.note, &row.left_out].into_iter().filter(|t| !t.is_empty()) {
            text += "\n";
            text += more;
        }
        text
    }
}

/// What a cell sorts by.
#[derive(Debug, PartialEq)]
enum Key {
    Text(String),
    Number(f64),
    /// Nothing is there: last, whichever way the table is sorted.
    Nothing,
}

fn compare(a: &Key, b: &Key, largest_first: bool) -> Ordering {
    let order = match (a, b) {
        (Key::Nothing, Key::Nothing) => return Ordering::Equal,
        (Key::Nothing, _) => return Ordering::Greater,
        (_, Key::Nothing) => return Ordering::Less,
        (Key::Number(a), Key::Number(b)) => a.total_cmp(b),
        (Key::Text(a), Key::Text(b)) => a.cmp(b),
        (Key::Number(_), Key::Text(_)) => Ordering::Less,
        (Key::Text(_), Key::Number(_)) => Ordering::Greater,
    };
    if largest_first { order.reverse() } else { order }
}

impl Cells {
    fn key(&self, entry: &Entry) -> Key {
        match self {
            Self::Text(text) => match text(&entry.row) {
                text if text.is_empty() => Key::Nothing,
                text => Key::Text(text),
            },
            Self::Number(number) => number(&entry.row).map_or(Key::Nothing, Key::Number),
            Self::Flag(flag) => {
                flag(&entry.row).map_or(Key::Nothing, |f| Key::Number(f64::from(u8::from(f))))
            }
            Self::Best => match entry.best.iter().filter(|b| **b).count() {
                0 => Key::Nothing,
                count => Key::Number(-(count as f64)),
            },
        }
    }

    fn text(&self, entry: &Entry) -> String {
        match self {
            Self::Text(text) => text(&entry.row),
            Self::Number(number) => number(&entry.row).map_or(String::new(), |x| significant(x, 3)),
            Self::Flag(flag) => flag(&entry.row).map_or("", |yes| if yes { "yes" } else { "no" }).to_owned(),
            Self::Best => {
                let marks = ["bytes", "time"].into_iter().zip(entry.best).filter(|(_, best)| *best);
                marks.map(|(mark, _)| mark).collect::<Vec<_>>().join(", ")
            }
        }
    }

    fn show(&self, ui: &mut egui::Ui, entry: &Entry) {
        let mut text = egui::RichText::new(self.text(entry));
        if entry.row.has_failed() {
            text = text.color(ui.visuals().error_fg_color);
        } else if matches!(self, Self::Best) {
            text = text.strong();
        }
        let label = egui::Label::new(text).selectable(false).wrap_mode(egui::TextWrapMode::Extend);
        match self {
            Self::Number(_) => {
                let right = egui::Layout::right_to_left(egui::Align::Center);
                ui.with_layout(right, |ui| ui.add(label));
            }
            _ => _ = ui.add(label),
        }
    }
}
