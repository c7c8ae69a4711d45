//! The sortable table: every column of the rows.

use super::escape;
use crate::measure::table::{COLUMNS, Cell, Row};
use crate::report::tables::significant;

/// Texts longer than this get a wide column instead of a tall row.
const LONG_TEXT: usize = 80;

/// Method and setting as a reader names it, with the map's size.
pub fn name(row: &Row) -> String {
    let map = row.map.map_or(String::new(), |map| format!("map={map}"));
    [row.method.as_str(), &row.params, &map]
        .into_iter()
        .filter(|s| !s.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// The section with the table; its first column names the row and leads to its pictures.
pub fn table(rows: &[Row]) -> String {
    let cells: Vec<Vec<Cell>> = rows.iter().map(Row::cells).collect();
    let columns: Vec<Column> = (0..COLUMNS.len()).map(|i| Column::of(i, &cells)).collect();
    let mut out = String::from(
        "<section>\n<h2>Table</h2>\n<p class=\"hint screen\">A heading sorts by its column, once more the other way. \
        <label><input type=\"checkbox\" id=\"every-column\" checked> every column (also those that are the same in all \
        rows, and smallest and largest times)</label> <span id=\"sorted\" role=\"status\"></span></p>\n\
        <div class=\"scroll\" role=\"region\" aria-label=\"Table\" tabindex=\"0\">\n<table id=\"rows\">\n<thead>\n<tr>\
        <th scope=\"col\" title=\"method and setting\" data-kind=\"text\"><button type=\"button\">row</button></th>",
    );
    for column in &columns {
        out += &column.header();
    }
    out += "</tr>\n</thead>\n<tbody>\n";
    for (i, (row, cells)) in rows.iter().zip(&cells).enumerate() {
        let name = escape(&name(row));
        out += &format!(
            "<tr><th scope=\"row\" data-value=\"{name}\"><a href=\"#row-{}\">{name}</a></th>",
            i + 1
        );
        for (column, cell) in columns.iter().zip(cells) {
            out += &column.cell(cell);
        }
        out += "</tr>\n";
    }
    out + "</tbody>\n</table>\n</div>\n</section>\n"
}

/// How a column is shown.
struct Column {
    name: &'static str,
    number: bool,
    /// The same in all rows, or an extreme of the column before it.
    minor: bool,
}

impl Column {
    fn of(index: usize, cells: &[Vec<Cell>]) -> Self {
        let name = COLUMNS[index];
        let values = || cells.iter().map(|row| &row[index]);
        let number = values().any(|c| matches!(c, Cell::Integer(_) | Cell::Real(_)))
            && values().all(|c| matches!(c, Cell::Integer(_) | Cell::Real(_) | Cell::Empty));
        let extreme = ["_min", "_max"].iter().filter_map(|e| name.strip_suffix(e));
        let minor = extreme.into_iter().any(|base| COLUMNS.contains(&base))
            || cells.len() > 1 && values().all(|c| *c == cells[0][index]);
        Self { name, number, minor }
    }

    /// Classes of its cells.
    fn classes(&self, more: &str) -> String {
        let kind = if self.number { "number" } else { "text" };
        let minor = if self.minor { " minor" } else { "" };
        // What the row's heading says too; paper is narrow.
        let named = if matches!(self.name, "method" | "params" | "map") { " named" } else { "" };
        format!("{kind}{minor}{named}{more}")
    }

    fn header(&self) -> String {
        let (words, unit) = heading(self.name);
        let unit = unit.map_or(String::new(), |u| format!(" <span class=\"unit\">[{u}]</span>"));
        let kind = if self.number { "number" } else { "text" };
        format!(
            "<th scope=\"col\" class=\"{}\" title=\"{}\" data-kind=\"{kind}\"><button type=\"button\">{}{unit}</button></th>",
            self.classes(""),
            escape(self.name),
            escape(&words)
        )
    }

    fn cell(&self, cell: &Cell) -> String {
        let more = match (self.name, cell) {
            (name, Cell::Flag(false)) if name.ends_with("held") => " bad",
            ("pareto", Cell::Flag(true)) => " good",
            (_, Cell::Text(text)) if text.len() > LONG_TEXT => " long",
            _ => "",
        };
        // What the script's `Number` reads; a column of text sorts as text.
        let value = match cell {
            Cell::Real(x) if x.is_infinite() => if *x > 0.0 { "Infinity" } else { "-Infinity" }.to_string(),
            other => other.to_string(),
        };
        let shown = match cell {
            Cell::Real(x) => significant(*x, 3).replace('-', "−"),
            Cell::Integer(n) => grouped(*n),
            other => other.to_string(),
        };
        let value = escape(&value);
        let full = if matches!(cell, Cell::Real(_)) { format!(" title=\"{value}\"") } else { String::new() };
        format!("<td class=\"{}\" data-value=\"{value}\"{full}>{}</td>", self.classes(more), escape(&shown))
    }
}

/// A column's name in words, and its unit: `frame_ms_min` is `frame min` in ms.
fn heading(name: &str) -> (String, Option<&'static str>) {
    let mut unit = None;
    let words: Vec<&str> = name
        .split('_')
        .filter(|word| {
            let found = ["ms", "mm"].into_iter().find(|u| u == word);
            unit = unit.or(found);
            found.is_none()
        })
        .collect();
    let unit = match words[..] {
        [.., "psnr"] => Some("dB"),
        ["fps", ..] => Some("1/s"),
        ["map" | "width" | "height"] => Some(if name == "map" { "texels" } else { "pixels" }),
        _ => unit,
    };
    (words.join(" "), unit)
}

/// Thousands apart by narrow spaces that do not break.
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
        let text = table(&rows);
        for column in COLUMNS {
            assert_eq!(text.matches(&format!(" title=\"{column}\" ")).count(), 1, "{column}");
        }
        assert_eq!(text.matches("<td ").count(), COLUMNS.len() * rows.len());
        assert!(text.contains("data-value=\"0.30000000000000004\" title=\"0.30000000000000004\">0.300</td>"));
        assert!(text.contains("data-value=\"Infinity\"") && text.contains(">inf</td>"));
        assert!(text.contains("class=\"text bad\" data-value=\"no\">no</td>"));
        assert!(text.contains("class=\"text good\" data-value=\"yes\">yes</td>"));
        assert!(text.contains(">a &lt;b&gt; &amp; &quot;c&quot;</td>"));
        assert!(text.contains(">3\u{202f}355\u{202f}443</td>"));
    }

    #[test]
    fn columns_that_say_little_are_marked() {
        let rows = sample_rows();
        let cells: Vec<_> = rows.iter().map(Row::cells).collect();
        let minor = |name: &str| Column::of(COLUMNS.iter().position(|c| *c == name).unwrap(), &cells).minor;
        for name in ["scene", "adapter", "build_ms_min", "frame_ms_max", "width", "image_rmse"] {
            assert!(minor(name), "{name}");
        }
        for name in ["method", "params", "frame_ms", "ray_err_max", "point_err_rms", "pareto"] {
            assert!(!minor(name), "{name}");
        }
    }

    #[test]
    fn headings_have_words_and_units() {
        assert_eq!(heading("frame_ms_min"), ("frame min".into(), Some("ms")));
        assert_eq!(heading("bound_depth_mm"), ("bound depth".into(), Some("mm")));
        assert_eq!(heading("image_psnr"), ("image psnr".into(), Some("dB")));
        assert_eq!(heading("fps_moving"), ("fps moving".into(), Some("1/s")));
        assert_eq!(heading("point_err_rms"), ("point err rms".into(), None));
        assert_eq!(
            (grouped(0), grouped(999), grouped(1000)),
            ("0".into(), "999".into(), "1\u{202f}000".into())
        );
    }
}
