//! The columns of the readable tables.

use crate::error::{Error, Result};
use crate::measure::table::{COLUMNS, Cell, Row};
use crate::measure::timing::clock_name;
use crate::report::number::{near_one, significant};

/// Where a column's text comes from.
#[derive(Clone, Copy)]
pub enum Source {
    Of(fn(&Row) -> String),
    /// The column of the CSV file of that name.
    Named(&'static str),
}

/// A column of the readable tables.
#[derive(Clone, Copy)]
pub struct Shown {
    /// The column of the CSV file that it is of.
    pub name: &'static str,
    pub heading: &'static str,
    pub unit: &'static str,
    /// Numbers are aligned to the right.
    pub number: bool,
    /// It is among the few where nobody says which.
    pub on_paper: bool,
    /// It goes into the caption where every row has the same in it.
    pub caption: bool,
    pub source: Source,
}

impl Shown {
    pub fn value(&self, row: &Row) -> String {
        match self.source {
            Source::Of(text) => text(row),
            Source::Named(name) => {
                let place = COLUMNS.iter().position(|c| c.name == name);
                match place.map(|i| row.cells().swap_remove(i)) {
                    Some(Cell::Real(x)) => significant(x, 3),
                    other => other.map_or(String::new(), |cell| cell.to_string()),
                }
            }
        }
    }
}

type Text = fn(&Row) -> String;

const fn text(name: &'static str, heading: &'static str, on_paper: bool, text: Text) -> Shown {
    Shown { name, heading, unit: "", number: false, on_paper, caption: false, source: Source::Of(text) }
}

const fn number(name: &'static str, heading: &'static str, unit: &'static str, text: Text) -> Shown {
    Shown { name, heading, unit, number: true, on_paper: true, caption: false, source: Source::Of(text) }
}

const fn wide(name: &'static str, heading: &'static str, unit: &'static str, text: Text) -> Shown {
    Shown { name, heading, unit, number: true, on_paper: false, caption: false, source: Source::Of(text) }
}

/// On what and by what rows are measured.
const fn conditions(name: &'static str, heading: &'static str, on_paper: bool, text: Text) -> Shown {
    Shown { name, heading, unit: "", number: false, on_paper, caption: true, source: Source::Of(text) }
}

/// Every column of the readable tables, in order.
pub const SHOWN: &[Shown] = &[
    conditions("scene", "scene", true, |r| r.scene.clone()),
    conditions("adapter", "adapter", true, |r| r.adapter.clone()),
    conditions("width", "picture", true, |r| format!("{} x {}", r.width, r.height)),
    conditions("clock", "clock", true, |r| r.clock.map_or(String::new(), |c| clock_name(c).into())),
    conditions("driver", "driver", false, |r| r.driver.clone()),
    conditions("threads", "threads", false, |r| r.threads.map_or(String::new(), |n| n.to_string())),
    conditions("revision", "program", false, |r| {
        [&*r.version, &*r.revision, &*r.profile].join(" ").trim().to_string()
    }),
    text("method", "method", true, |r| r.method.clone()),
    text("params", "params", true, |r| r.params.clone()),
    number("map", "map", "texels", |r| r.map.map_or(String::new(), |n| n.to_string())),
    number("build_ms", "build", "ms", |r| real(r.build_ms)),
    number("frame_ms", "frame", "ms", |r| real(r.frame_ms)),
    wide("fps_static", "fps static", "1/s", |r| real(r.fps_static)),
    wide("fps_moving", "fps moving", "1/s", |r| real(r.fps_moving)),
    number("bytes", "memory", "MiB", |r| real(r.bytes.map(|b| b as f64 / f64::from(1 << 20)))),
    wide("nodes_total", "nodes", "", |r| r.nodes_total.map_or(String::new(), |n| n.to_string())),
    wide("nodes_max", "nodes max", "", |r| r.nodes_max.map_or(String::new(), |n| n.to_string())),
    number("ray_err_max", "ray err max", "", |r| real(r.ray_err_max)),
    wide("point_err_max", "point err max", "", |r| real(r.point_err_max)),
    number("point_err_rms", "point err rms", "", |r| real(r.point_err_rms)),
    wide("point_err_p99", "point err p99", "", |r| real(r.point_err_p99)),
    wide("point_err_mean_signed", "point err mean", "", |r| real(r.point_err_mean_signed)),
    number("strand_err_rms", "strand err rms", "", |r| real(r.strand_err_rms)),
    wide("image_rmse", "image rmse", "", |r| real(r.image_rmse)),
    number("image_psnr", "PSNR", "dB", |r| real(r.image_psnr)),
    wide("image_ssim", "SSIM", "", |r| r.image_ssim.map_or(String::new(), near_one)),
    number("bound", "bound", "", |r| real(r.bound)),
    wide("bound_depth_mm", "bound depth", "mm", |r| real(r.bound_depth_mm)),
    text("bound_held", "bound held", true, |r| flag(r.bound_held)),
    text("pareto", "Pareto", false, |r| flag(r.pareto)),
    text("tuned", "tuned", true, |r| flag(r.tuned)),
    text("status", "status", true, |r| if r.has_failed() { r.status.clone() } else { String::new() }),
];

/// The columns of these names, in their order: as they are shown otherwise, or just as the CSV file has them.
///
/// # Errors
/// A name that is no column's.
pub fn chosen(names: &[String]) -> Result<Vec<Shown>> {
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
        let (name, source) = (column.name, Source::Named(column.name));
        let number = !WORDS.contains(&name);
        Ok(Shown { name, heading: name, unit: column.unit, number, on_paper: true, caption: false, source })
    };
    let shown: Vec<Shown> = names.iter().map(of).collect::<Result<_>>()?;
    match shown.iter().enumerate().find(|(i, s)| shown[..*i].iter().any(|other| other.name == s.name)) {
        Some((_, twice)) => Err(Error::input(
            "bad list of columns",
            format!("--columns: `{}`", twice.name),
            "it stands there twice",
        )),
        None => Ok(shown),
    }
}

/// Columns of words among those that are shown only where they are asked for.
const WORDS: &[&str] = &["left_out", "tuned_for", "profile", "version", "note"];

/// The unit as headings have it, or nothing.
pub fn heading_unit(s: &Shown) -> String {
    if s.unit.is_empty() { String::new() } else { format!("[{}]", s.unit) }
}

/// A text without breaks.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn flag(value: Option<bool>) -> String {
    value.map_or(String::new(), |yes| yes.to_string())
}

fn real(value: Option<f64>) -> String {
    value.map_or(String::new(), |x| significant(x, 3))
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
