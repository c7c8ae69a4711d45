//! Columns of the readable comparison tables (Markdown and LaTeX): headings, units and formatting.

use crate::error::{Error, Result};
use crate::measure::table::{COLUMNS, Cell, Row};
use crate::report::number::{near_one, significant};

/// Column of the readable comparison tables: heading, unit and formatting.
#[derive(Clone, Copy)]
pub struct TableColumn {
    /// Name in `compare.csv` of a column of the readable tables.
    pub name: &'static str,
    pub heading: &'static str,
    pub unit: &'static str,
    /// Whether the table column contains numbers, which are aligned to the right.
    pub number: bool,
    /// Whether the column belongs to the few columns of the default LaTeX table.
    pub on_paper: bool,
    /// Whether the table's caption shows this column's value instead, if all rows have the same value.
    pub caption: bool,
    /// Whether the column shows one value of `compare.csv`, with rounded reals, instead of a combination of several
    /// values.
    plain: bool,
}

impl TableColumn {
    /// Returns the text of a comparison-table row in this column of the readable tables.
    pub fn value(&self, row: &Row) -> String {
        match (self.name, row.cell(self.name)) {
            ("width", _) if !self.plain => format!("{} x {}", row.width, row.height),
            ("revision", _) if !self.plain => {
                [&*row.version, &*row.revision, &*row.profile].join(" ").trim().to_string()
            }
            ("bytes", Cell::Integer(bytes)) => significant(bytes as f64 / f64::from(1 << 20), 3),
            ("status", _) if !row.has_failed() => String::new(),
            ("image_ssim" | "shadow_ssim", Cell::Real(x)) => near_one(x),
            (_, Cell::Real(x)) => significant(x, 3),
            (_, cell) => cell.to_string(),
        }
    }
}

const fn text(name: &'static str, heading: &'static str, on_paper: bool) -> TableColumn {
    TableColumn { name, heading, unit: "", number: false, on_paper, caption: false, plain: false }
}

const fn number(name: &'static str, heading: &'static str, unit: &'static str) -> TableColumn {
    TableColumn { unit, number: true, ..text(name, heading, true) }
}

/// Creates a column of numbers that the default LaTeX table omits.
const fn wide(name: &'static str, heading: &'static str, unit: &'static str) -> TableColumn {
    TableColumn { on_paper: false, ..number(name, heading, unit) }
}

/// Creates a column with a measurement condition; the table's caption shows it if all rows have the same value.
const fn condition(name: &'static str, heading: &'static str, on_paper: bool) -> TableColumn {
    TableColumn { caption: true, ..text(name, heading, on_paper) }
}

/// All default columns of the readable comparison tables, in order.
pub const SHOWN: &[TableColumn] = &[
    condition("scene", "scene", true),
    condition("adapter", "adapter", true),
    condition("width", "picture", true),
    condition("clock", "clock", true),
    condition("driver", "driver", false),
    condition("threads", "threads", false),
    condition("revision", "program", false),
    text("method", "method", true),
    text("params", "params", true),
    text("published", "as published", false),
    number("map", "map", "texels"),
    number("build_ms", "build", "ms"),
    number("frame_ms", "frame", "ms"),
    wide("fps_static", "fps static", "1/s"),
    wide("fps_moving", "fps moving", "1/s"),
    number("bytes", "memory", "MiB"),
    wide("nodes_total", "nodes", ""),
    wide("nodes_max", "nodes max", ""),
    number("ray_err_max", "ray err max", ""),
    wide("point_err_max", "point err max", ""),
    number("point_err_rms", "point err rms", ""),
    wide("point_err_p99", "point err p99", ""),
    wide("point_err_mean_signed", "point err mean", ""),
    number("strand_err_rms", "strand err rms", ""),
    wide("image_rmse", "image rmse", ""),
    number("image_psnr", "PSNR", "dB"),
    wide("image_ssim", "SSIM", ""),
    number("shadow_rmse", "shadow rmse", ""),
    wide("shadow_psnr", "shadow PSNR", "dB"),
    wide("shadow_ssim", "shadow SSIM", ""),
    number("flip", "FLIP", ""),
    number("bound", "bound", ""),
    wide("bound_depth_mm", "bound depth", "mm"),
    text("bound_held", "bound held", true),
    wide("point_bound_lateral_mm", "point bound lateral", "mm"),
    text("point_bound_held", "point bound held", true),
    wide("enclosure_width", "enclosure width", ""),
    text("enclosure_held", "enclosure held", true),
    wide("certified_err", "certified err", ""),
    text("certified_held", "certified held", true),
    wide("certified_rays", "certified rays", ""),
    text("pareto", "Pareto", false),
    text("tuned", "tuned", true),
    text("status", "status", true),
];

/// Returns the table columns with the given names, in the given order. A column that has no readable form shows its
/// plain value from `compare.csv`.
///
/// # Errors
/// A column of `compare.csv` with this name does not exist, or a name is listed twice.
pub fn chosen(names: &[String]) -> Result<Vec<TableColumn>> {
    let of = |name: &String| {
        if let Some(shown) = SHOWN.iter().find(|s| s.name == name) {
            return Ok(*shown);
        }
        let unknown = || {
            let known = COLUMNS.iter().map(|c| c.name).collect::<Vec<_>>().join(", ");
            Error::input("unknown column", format!("--columns: `{name}`"), "the table has none of that name")
                .hint(format!("columns: {known}"))
        };
        let column = COLUMNS.iter().find(|c| c.name == name).ok_or_else(unknown)?;
        let number = !WORDS.contains(&column.name);
        Ok(TableColumn { unit: column.unit, number, plain: true, ..text(column.name, column.name, true) })
    };
    let shown: Vec<TableColumn> = names.iter().map(of).collect::<Result<_>>()?;
    match shown.iter().enumerate().find(|(i, s)| shown[..*i].iter().any(|other| other.name == s.name)) {
        Some((_, twice)) => Err(Error::input(
            "bad list of columns",
            format!("--columns: `{}`", twice.name),
            "it stands there twice",
        )),
        None => Ok(shown),
    }
}

/// Columns of `compare.csv` that contain text and appear in the readable tables only on request.
const WORDS: &[&str] = &["left_out", "tuned_for", "profile", "version", "note"];

/// Unit of a table column in brackets, for its heading; empty without a unit.
pub fn heading_unit(s: &TableColumn) -> String {
    if s.unit.is_empty() { String::new() } else { format!("[{}]", s.unit) }
}

/// Replaces line breaks and repeated spaces of a text by single spaces.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;

    #[test]
    fn every_column_can_be_chosen_and_no_other() {
        let all: Vec<String> = COLUMNS.iter().map(|c| c.name.to_owned()).collect();
        let chosen_all = chosen(&all).unwrap();
        let row = &sample_rows()[2];
        for (shown, cell) in chosen_all.iter().zip(row.cells()) {
            let empty = matches!(cell, Cell::Empty) || cell == Cell::Text(String::new());
            assert!(!empty || shown.value(row).is_empty() || shown.name == "width", "{}", shown.name);
        }
        let e = chosen(&["epsilonn".into()]).err().unwrap();
        assert!(e.exit_status() == 2 && e.hint.unwrap().contains("epsilon"));
        assert!(SHOWN.iter().all(|s| COLUMNS.iter().any(|c| c.name == s.name)));
    }
}
