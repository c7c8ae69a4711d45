//! The table's rows in the window.

use crate::engine::method_choice::MethodChoice;
use crate::measure::table::Row;
use crate::measure::timing::clock_name;
use crate::report::number::significant;
use eframe::egui;
use egui_extras::{Column as Width, TableBuilder};
use std::cmp::Ordering;

/// A longer table is scrolled within, points.
const TABLE_HEIGHT: f32 = 380.0;
/// Of the sign of a sorted column, with the space before it, points.
const ARROW_WIDTH: f32 = 12.0;

/// A column's cells, which sort as what they are.
enum Cells {
    Text(fn(&Row) -> String),
    Number(fn(&Row) -> Option<f64>),
    Flag(fn(&Row) -> Option<bool>),
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
    column(
        "PSNR dB",
        "Of the whole picture, shading included, against the exact one: peak signal over noise; 20 dB more are a tenth \
         of the error",
        Cells::Number(|r| r.image_psnr),
    ),
    column(
        "bound held",
        "Whether the promised bound held at every depth tested",
        Cells::Flag(|r| r.bound_held),
    ),
    column("Pareto", "No other row is at once faster and closer", Cells::Flag(|r| r.pareto)),
];

impl Column {
    /// Numbers stand at the right of a column that is as wide as its heading, with an arrow, or as seven digits.
    fn width(&self, ui: &egui::Ui) -> Width {
        match self.cells {
            Cells::Number(_) => {
                let font = egui::TextStyle::Body.resolve(ui.style());
                let wide = |text: &str| {
                    ui.painter().layout_no_wrap(text.to_owned(), font.clone(), egui::Color32::WHITE).size().x
                };
                Width::exact((wide(self.heading) + wide("0") + ARROW_WIDTH).max(wide("0000000")).ceil())
            }
            _ => Width::auto().at_least(44.0),
        }
    }

    fn is_number(&self) -> bool {
        matches!(self.cells, Cells::Number(_))
    }
}

/// A row with what is known of it.
struct Line {
    row: Row,
    /// As the shadows panel has it.
    choice: Option<MethodChoice>,
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
    lines: Vec<Line>,
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
        match self.lines.get_mut(place) {
            Some(line) => line.row = row,
            None => self.lines.push(Line::of(row)),
        }
    }

    /// Takes a whole table.
    pub fn finish(&mut self, rows: Vec<Row>) {
        self.clear();
        self.lines = rows.into_iter().map(Line::of).collect();
    }

    /// The rows in the table's order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &Row> {
        self.lines.iter().map(|e| &e.row)
    }

    /// The rows as they are sorted.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.lines.len()).collect();
        if let Some((column, largest_first)) = self.sort {
            let key = |i: &usize| COLUMNS[column].cells.key(&self.lines[*i]);
            order.sort_by(|a, b| compare(&key(a), &key(b), largest_first));
        }
        order
    }

    /// The table, and which row was clicked; `current` is the method in the view.
    pub fn show(&mut self, ui: &mut egui::Ui, current: Option<&MethodChoice>) -> Option<Picked> {
        let mut picked = None;
        if let Some(Line { row, .. }) = self.lines.first() {
            let clock = row.clock.map_or(String::new(), |clock| format!(" · {} clock", clock_name(clock)));
            ui.weak(format!("{} · {} x {} pixels{clock}", row.scene, row.width, row.height));
        }
        egui::ScrollArea::horizontal().id_salt("comparison table").show(ui, |ui| {
            let height = ui.text_style_height(&egui::TextStyle::Body) + 4.0;
            let widths: Vec<Width> = COLUMNS.iter().map(|column| column.width(ui)).collect();
            let table = TableBuilder::new(ui)
                .striped(true)
                .sense(egui::Sense::click())
                .min_scrolled_height(TABLE_HEIGHT)
                .max_scroll_height(TABLE_HEIGHT)
                .cell_layout(egui::Layout::left_to_right(egui::Align::Center));
            let table = widths.into_iter().fold(table, TableBuilder::column);
            let order = self.order();
            table
                .header(height + 2.0, |mut header| {
                    for (i, column) in COLUMNS.iter().enumerate() {
                        header.col(|ui| match column.is_number() {
                            // Over its figures.
                            true => {
                                let right = egui::Layout::right_to_left(egui::Align::Center);
                                ui.with_layout(right, |ui| self.heading(ui, i, column));
                            }
                            false => self.heading(ui, i, column),
                        });
                    }
                })
                .body(|body| {
                    body.rows(height, order.len(), |mut table_row| {
                        let line = &self.lines[order[table_row.index()]];
                        table_row.set_selected(line.choice.is_some() && line.choice.as_ref() == current);
                        for column in COLUMNS {
                            table_row.col(|ui| column.cells.show(ui, line));
                        }
                        let response = table_row.response();
                        let shift = response.ctx.input(|i| i.modifiers.shift);
                        if let Some(choice) = line.choice.clone().filter(|_| response.clicked()) {
                            picked = Some(Picked { choice, shift });
                        }
                        response.on_hover_text(line.tooltip());
                    });
                });
        });
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
        let (text, arrow) =
            (egui::RichText::new(column.heading).strong(), egui::RichText::new(arrow).monospace());
        let button = match column.is_number() {
            true => egui::Button::new((arrow, text)),
            false => egui::Button::new((text, arrow)),
        };
        let button = ui.add(button.frame(false).gap(2.0)).on_hover_text(column.tooltip);
        if button.accessible_name(format!("sort by {}", column.heading)).clicked() {
            self.sort = match self.sort {
                Some((sorted, false)) if sorted == i => Some((i, true)),
                Some((sorted, true)) if sorted == i => None,
                _ => Some((i, false)),
            };
        }
    }
}

impl Line {
    fn of(row: Row) -> Self {
        let choice = MethodChoice::parse(&row.spec()).ok();
        Self { row, choice }
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
enum SortKey {
    Text(String),
    Number(f64),
    /// Nothing is there: last, whichever way the table is sorted.
    Nothing,
}

fn compare(a: &SortKey, b: &SortKey, largest_first: bool) -> Ordering {
    let order = match (a, b) {
        (SortKey::Nothing, SortKey::Nothing) => return Ordering::Equal,
        (SortKey::Nothing, _) => return Ordering::Greater,
        (_, SortKey::Nothing) => return Ordering::Less,
        (SortKey::Number(a), SortKey::Number(b)) => a.total_cmp(b),
        (SortKey::Text(a), SortKey::Text(b)) => a.cmp(b),
        (SortKey::Number(_), SortKey::Text(_)) => Ordering::Less,
        (SortKey::Text(_), SortKey::Number(_)) => Ordering::Greater,
    };
    if largest_first { order.reverse() } else { order }
}

impl Cells {
    fn key(&self, line: &Line) -> SortKey {
        match self {
            Self::Text(text) => match text(&line.row) {
                text if text.is_empty() => SortKey::Nothing,
                text => SortKey::Text(text),
            },
            Self::Number(number) => number(&line.row).map_or(SortKey::Nothing, SortKey::Number),
            Self::Flag(flag) => {
                flag(&line.row).map_or(SortKey::Nothing, |f| SortKey::Number(f64::from(u8::from(f))))
            }
        }
    }

    fn text(&self, line: &Line) -> String {
        match self {
            Self::Text(text) => text(&line.row),
            Self::Number(number) => number(&line.row).map_or(String::new(), |x| match x {
                // Texels: a whole number has no digits behind a point.
                x if x.fract() == 0.0 && (10.0..1e5).contains(&x) => format!("{x:.0}"),
                x => significant(x, 3),
            }),
            Self::Flag(flag) => flag(&line.row).map_or("", |yes| if yes { "yes" } else { "no" }).to_owned(),
        }
    }

    fn show(&self, ui: &mut egui::Ui, line: &Line) {
        let mut text = egui::RichText::new(self.text(line));
        if line.row.has_failed() {
            text = text.color(ui.visuals().error_fg_color);
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
