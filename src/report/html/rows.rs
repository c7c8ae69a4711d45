//! Sortable comparison table of the HTML report, with every column.

use crate::measure::table::{COLUMNS, Cell, Column, Row};
use crate::report::number::{near_one, significant};
use crate::report::tables::bound_coverage;
use maud::{Markup, html};

/// Length in bytes above which the text of a cell in the report's HTML table is shown in a small scrollable box.
const LONG_TEXT: usize = 40;

/// Columns of the report's HTML table that are visible at first, such as times, memory, errors and the error bound of
/// the method.
const MAIN: &[&str] = &[
    "scene",
    "adapter",
    "build_ms",
    "frame_ms",
    "fps_moving",
    "bytes",
    "ray_err_max",
    "point_err_rms",
    "point_err_max",
    "image_psnr",
    "image_ssim",
    "shadow_rmse",
    "flip",
    "bound",
    "bound_depth_mm",
    "bound_held",
    "point_bound_held",
    "pareto",
    "status",
];
/// Columns of the report's HTML table that are visible at first only if the values of the rows differ.
const WHERE_DIFFERENT: &[&str] = &["scene", "adapter", "status"];

/// Returns the name of a comparison-table row for the reader: shadow method, settings, and side length of the shadow
/// map.
pub fn name(row: &Row) -> String {
    let map = row.map.map_or(String::new(), |map| format!("map={map}"));
    let words = [row.method.as_str(), &row.params, &map];
    words.into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Returns the HTML section with the sortable comparison table. Its first column names the shadow method of each row
/// and links to the pictures.
pub fn table(rows: &[Row]) -> Markup {
    let cells: Vec<Vec<Cell>> = rows.iter().map(Row::cells).collect();
    let columns: Vec<HtmlColumn> = (0..COLUMNS.len()).map(|i| HtmlColumn::of(i, &cells)).collect();
    html! {
        section {
            h2 { "Table" }
            p class="hint screen" {
                "A heading sorts by its column, once more the other way. "
                label {
                    input type="checkbox" id="every-column" autocomplete="off";
                    " every column"
                }
                " " span id="sorted" role="status" {}
            }
            @if let Some(text) = bound_coverage(rows) {
                p class="hint" { (text.replace('`', "")) }
            }
            div class="scroll" role="region" aria-label="Table" tabindex="0" {
                table id="rows" {
                    thead {
                        tr {
                            th scope="col" title="method and setting" data-kind="text" { button type="button" { "row" } }
                            @for column in &columns { (column.header()) }
                        }
                    }
                    tbody {
                        @for (i, (row, cells)) in rows.iter().zip(&cells).enumerate() {
                            @let name = name(row);
                            tr {
                                th scope="row" data-value=(name) { a href={ "#row-" (i + 1) } { (name) } }
                                @for (column, cell) in columns.iter().zip(cells) { (column.cell(cell)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Column of the report's HTML table: kind of its values, and whether it is visible at first.
struct HtmlColumn {
    column: &'static Column,
    /// Kind of the values in one column of the report's HTML table: `number` or `text`.
    kind: &'static str,
    /// Whether the column of the report's HTML table is hidden at first.
    minor: bool,
}

impl HtmlColumn {
    fn of(index: usize, cells: &[Vec<Cell>]) -> Self {
        let column = &COLUMNS[index];
        let values = || cells.iter().map(|row| &row[index]);
        let number = values().any(|c| matches!(c, Cell::Integer(_) | Cell::Real(_)))
            && values().all(|c| matches!(c, Cell::Integer(_) | Cell::Real(_) | Cell::Empty));
        let same = values().all(|c| *c == cells[0][index]);
        let empty = values().all(|c| matches!(c, Cell::Empty));
        let minor = !MAIN.contains(&column.name) || empty || same && WHERE_DIFFERENT.contains(&column.name);
        Self { column, kind: if number { "number" } else { "text" }, minor }
    }

    /// CSS classes for the cells of one column in the report's HTML table.
    fn classes(&self, more: &str) -> String {
        let minor = if self.minor { " minor" } else { "" };
        format!("{}{minor}{more}", self.kind)
    }

    fn header(&self) -> Markup {
        let unit = self.column.unit;
        html! {
            th scope="col" class=(self.classes("")) title=(self.column.name) data-kind=(self.kind) {
                button type="button" title=(self.column.about) {
                    (words(self.column)) @if !unit.is_empty() { " " span class="unit" { "[" (unit) "]" } }
                }
            }
        }
    }

    fn cell(&self, cell: &Cell) -> Markup {
        let more = match (self.column.name, cell) {
            (name, Cell::Flag(false)) if name.ends_with("held") => " bad",
            ("pareto", Cell::Flag(true)) => " good",
            (_, Cell::Text(text)) if text.len() > LONG_TEXT => " long",
            _ => "",
        };
        // Value that JavaScript's `Number` can parse; text columns sort as text.
        let value = match cell {
            Cell::Real(x) if x.is_infinite() => if *x > 0.0 { "Infinity" } else { "-Infinity" }.to_string(),
            other => other.to_string(),
        };
        let shown = match cell {
            Cell::Real(x) if self.column.name.ends_with("_ssim") => near_one(*x),
            Cell::Real(x) => significant(*x, 3).replace('-', "−"),
            Cell::Integer(n) => grouped(*n),
            other => other.to_string(),
        };
        let shown = if more == " long" {
            html! { div { (shown) } }
        } else {
            html! { (shown) }
        };
        let full = matches!(cell, Cell::Real(_)).then_some(&value);
        html! { td class=(self.classes(more)) data-value=(value) title=[full] { (shown) } }
    }
}

/// Name of a comparison-table column in words, without its unit: `frame_ms_min` becomes `frame min`.
fn words(column: &Column) -> String {
    column.name.split('_').filter(|word| *word != column.unit).collect::<Vec<_>>().join(" ")
}

/// Formats an integer with narrow no-break spaces between thousands.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;

    #[test]
    fn every_column_and_cell_is_there_with_its_full_value() {
        let mut rows = sample_rows();
        rows[0].point_err_max = Some(0.1 + 0.2);
        rows[0].bound_held = Some(false);
        rows[0].left_out = "a <b> & \"c\"".into();
        let text = table(&rows).into_string();
        for column in COLUMNS.iter() {
            assert_eq!(text.matches(&format!(" title=\"{}\" ", column.name)).count(), 1, "{}", column.name);
        }
        assert_eq!(text.matches("<td ").count(), COLUMNS.len() * rows.len());
        assert!(text.contains("data-value=\"0.30000000000000004\" title=\"0.30000000000000004\">0.300</td>"));
        assert!(text.contains("data-value=\"Infinity\"") && text.contains(">inf</td>"));
        assert!(text.contains("class=\"text bad\" data-value=\"false\">false</td>"));
        assert!(text.contains("class=\"text good\" data-value=\"true\">true</td>"));
        assert!(text.contains(">a &lt;b&gt; &amp; &quot;c&quot;</td>"));
        assert!(text.contains(">3\u{202f}355\u{202f}443</td>"));
    }

    #[test]
    fn what_matters_is_in_sight_and_the_rest_is_not() {
        let mut rows = sample_rows();
        let minor = |rows: &[Row], name: &str| {
            let cells: Vec<_> = rows.iter().map(Row::cells).collect();
            HtmlColumn::of(COLUMNS.iter().position(|c| c.name == name).unwrap(), &cells).minor
        };
        // What all rows share, what nobody measured, details, and what the row's name says.
        for name in
            ["scene", "adapter", "image_ssim", "build_ms_min", "width", "left_out", "method", "epsilon"]
        {
            assert!(minor(&rows, name), "{name}");
        }
        for name in ["build_ms", "frame_ms", "bytes", "ray_err_max", "point_err_rms", "bound_held"] {
            assert!(!minor(&rows, name), "{name}");
        }
        rows[1].scene = "another".into();
        assert!(!minor(&rows, "scene"), "scenes are told apart");
        assert!(MAIN.iter().all(|name| COLUMNS.iter().any(|c| c.name == *name)));
        let text = table(&rows).into_string();
        assert!(text.contains("id=\"every-column\"") && !text.contains("checked"));
    }

    #[test]
    fn long_texts_do_not_make_tall_rows() {
        let mut rows = sample_rows();
        rows[0].note = "many words ".repeat(50);
        let text = table(&rows).into_string();
        assert!(text.contains("class=\"text minor long\"") && text.contains("\"><div>many words"));
    }

    #[test]
    fn headings_are_words_and_thousands_are_separated() {
        let heading = |name: &str| words(COLUMNS.iter().find(|c| c.name == name).unwrap());
        let words = ["frame_ms_min", "bound_depth_mm", "image_psnr", "point_err_rms"].map(heading);
        assert_eq!(words, ["frame min", "bound depth", "image psnr", "point err rms"]);
        assert_eq!([0, 999, 1000].map(grouped), ["0", "999", "1\u{202f}000"]);
    }
}
