//! Sortable table in the comparison window, with one row of measured results per shadow method.

use crate::measure::table::{COLUMNS, Row};
use crate::measure::timing::clock_name;
use crate::report::number::significant;
use crate::shadow::MethodSpec;
use eframe::egui::{self, RichText};
use egui_extras::{Column as Width, TableBuilder};
use std::cmp::Ordering;

/// Columns of the comparison table (`compare.csv`) that the comparison window shows.
const SHOWN: [&str; 16] = [
    "method",
    "params",
    "map",
    "point_err_rms",
    "point_err_max",
    "ray_err_max",
    "bytes",
    "build_ms",
    "frame_ms",
    "fps_moving",
    "image_psnr",
    "bound",
    "bound_depth_mm",
    "bound_held",
    "point_bound_held",
    "pareto",
];
/// Height above which the comparison table in the window scrolls, screen points.
const TABLE_HEIGHT: f32 = 380.0;
/// Width of the sort arrow in a column heading of the comparison table, screen points.
const ARROW_WIDTH: f32 = 12.0;

/// Formats a cell of the comparison table (`compare.csv`) for display: numbers get three significant digits.
fn shown(cell: &str) -> String {
    match cell.parse::<f64>() {
        // Counts have no decimal places.
        Ok(x) if x.fract() == 0.0 && x >= 10.0 => format!("{x:.0}"),
        Ok(x) => significant(x, 3),
        Err(_) => cell.to_owned(),
    }
}

/// Sort order of two cells in a column of the comparison table. Empty cells are last in both directions.
fn order(a: &str, b: &str, descending: bool) -> Ordering {
    if a.is_empty() || b.is_empty() {
        return a.is_empty().cmp(&b.is_empty());
    }
    let order = match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => a.total_cmp(&b),
        _ => a.cmp(b),
    };
    if descending { order.reverse() } else { order }
}

/// Row of the table that compares shadow methods, with the texts of its cells.
struct TableRow {
    row: Row,
    /// Texts of the cells shown for this row of the comparison table, as in `compare.csv`.
    cells: Vec<String>,
}

/// Table of a finished or running comparison of shadow methods, with the sort order that the user chose.
#[derive(Default)]
pub struct Results {
    rows: Vec<TableRow>,
    /// Index of the column by which the comparison table is sorted, and whether in descending order; `None` for the
    /// order of measurement.
    sort: Option<(usize, bool)>,
}

impl Results {
    /// Replaces the row at this index of the table that compares shadow methods, or appends the row if the index is
    /// new.
    pub fn put(&mut self, place: usize, row: Row) {
        let texts = row.texts();
        let cells = SHOWN.map(|name| texts.get(name).cloned().unwrap_or_default()).to_vec();
        let made = TableRow { row, cells };
        match self.rows.get_mut(place) {
            Some(old) => *old = made,
            None => self.rows.push(made),
        }
    }

    /// Replaces all rows of the table that compares shadow methods.
    pub fn replace(&mut self, rows: Vec<Row>) {
        self.rows.clear();
        rows.into_iter().enumerate().for_each(|(place, row)| self.put(place, row));
    }

    /// Rows of the table that compares shadow methods, unsorted.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &Row> {
        self.rows.iter().map(|line| &line.row)
    }

    /// Shows the table that compares shadow methods. Highlights the row of `current`, the method of the picture.
    /// Returns the method of a clicked row, and whether Shift was pressed.
    pub fn show(&mut self, ui: &mut egui::Ui, current: &MethodSpec) -> Option<(MethodSpec, bool)> {
        let mut picked = None;
        if let Some(TableRow { row, .. }) = self.rows.first() {
            let clock = row.clock.map_or(String::new(), |clock| format!(" · {} clock", clock_name(clock)));
            ui.weak(format!("{} · {} x {} pixels{clock}", row.scene, row.width, row.height));
        }
        let mut places: Vec<usize> = (0..self.rows.len()).collect();
        if let Some((column, descending)) = self.sort {
            let cell = |row: &usize| &self.rows[*row].cells[column];
            places.sort_by(|a, b| order(cell(a), cell(b), descending));
        }
        egui::ScrollArea::horizontal().id_salt("comparison table").show(ui, |ui| {
            let height = ui.text_style_height(&egui::TextStyle::Body) + 4.0;
            let font = egui::TextStyle::Body.resolve(ui.style());
            let layout =
                |text: &str| ui.painter().layout_no_wrap(text.to_owned(), font.clone(), egui::Color32::WHITE);
            let widths: Vec<Width> = (0..SHOWN.len())
                .map(|i| match self.is_number(i) {
                    true => {
                        let heading = layout(SHOWN[i]).size().x + ARROW_WIDTH;
                        Width::exact(heading.max(layout("00000000").size().x).ceil() + 6.0)
                    }
                    false => Width::auto().at_least(44.0),
                })
                .collect();
            let table = TableBuilder::new(ui)
                .striped(true)
                .sense(egui::Sense::click())
                .min_scrolled_height(TABLE_HEIGHT)
                .max_scroll_height(TABLE_HEIGHT)
                .cell_layout(egui::Layout::left_to_right(egui::Align::Center));
            let table = widths.into_iter().fold(table, TableBuilder::column);
            let table = table.header(height + 2.0, |mut header| {
                for i in 0..SHOWN.len() {
                    header.col(|ui| self.heading(ui, i));
                }
            });
            table.body(|body| {
                body.rows(height, places.len(), |mut table_row| {
                    let TableRow { row, cells } = &self.rows[places[table_row.index()]];
                    let method: Option<MethodSpec> = row.spec().parse().ok();
                    table_row.set_selected(method.as_ref() == Some(current));
                    for (i, cell) in cells.iter().enumerate() {
                        table_row.col(|ui| {
                            let mut text = RichText::new(shown(cell));
                            if row.has_failed() {
                                text = text.color(ui.visuals().error_fg_color);
                            }
                            let label = egui::Label::new(text).selectable(false).extend();
                            aligned(ui, self.is_number(i), |ui| _ = ui.add(label));
                        });
                    }
                    let response = table_row.response();
                    let shift = response.ctx.input(|i| i.modifiers.shift);
                    if let Some(method) = method.filter(|_| response.clicked()) {
                        picked = Some((method, shift));
                    }
                    let help = "Click: into the shadows panel; Shift-click: as the second method";
                    response.on_hover_text([help, &row.note, &row.left_out].join("\n").trim());
                });
            });
        });
        picked
    }

    /// Whether a column of the table that compares shadow methods contains numbers.
    fn is_number(&self, column: usize) -> bool {
        self.rows.iter().any(|row| row.cells[column].parse::<f64>().is_ok())
    }

    /// Shows a column heading of the table that compares shadow methods. Clicks cycle between ascending, descending
    /// and original order.
    fn heading(&mut self, ui: &mut egui::Ui, i: usize) {
        let (arrow, next) = match self.sort {
            Some((sorted, false)) if sorted == i => ("↑", Some((i, true))),
            Some((sorted, true)) if sorted == i => ("↓", None),
            _ => ("", Some((i, false))),
        };
        let about = COLUMNS.iter().find(|column| column.name == SHOWN[i]).map_or("", |c| &c.about);
        // Only the monospaced font has arrows.
        let (text, arrow) = (RichText::new(SHOWN[i]).strong(), RichText::new(arrow).monospace());
        let button = match self.is_number(i) {
            true => egui::Button::new((arrow, text)),
            false => egui::Button::new((text, arrow)),
        };
        aligned(ui, self.is_number(i), |ui| {
            let button = ui.add(button.frame(false).gap(2.0)).on_hover_text(about);
            if button.accessible_name(format!("sort by {}", SHOWN[i])).clicked() {
                self.sort = next;
            }
        });
    }
}

/// Aligns the contents of a cell of the comparison table: numbers (`right`) to the right, text to the left.
fn aligned(ui: &mut egui::Ui, right: bool, contents: impl FnOnce(&mut egui::Ui)) {
    match right {
        true => _ = ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), contents),
        false => contents(ui),
    }
}
