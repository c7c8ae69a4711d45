//! The table for reading: Markdown and LaTeX, units in the headings, three significant digits.

mod columns;

use super::budgets::lines;
use super::number::significant;
use super::writers::{columns_markdown, json, table_csv};
use crate::error::Result;
use crate::files::output::write_whole;
use crate::measure::table::Row;
use columns::{SHOWN, Shown};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The main columns of the rows as an aligned Markdown table with a caption, and which method is closest within each
/// budget that rows were tuned for.
pub fn summary(rows: &[Row]) -> String {
    markdown_table(rows, |s| s.on_paper) + &remarks(rows) + &answers(rows)
}

/// The notes of single rows.
fn remarks(rows: &[Row]) -> String {
    let mut out = String::new();
    for row in rows.iter().filter(|r| !r.note.is_empty()) {
        let start = if out.is_empty() { "\n" } else { "" };
        let failed = if row.has_failed() { " failed" } else { "" };
        out += &format!(
            "{start}- {}{failed}: {}\n",
            escape_markdown(&full_name(row, rows)),
            escape_markdown(&row.note)
        );
    }
    out
}

/// Which method is closest within each budget that rows were tuned for, as Markdown; nothing where there is none.
fn answers(rows: &[Row]) -> String {
    let lines = budget_lines(rows);
    if lines.is_empty() {
        return String::new();
    }
    let lines: String = lines.iter().map(|line| format!("- {}\n", escape_markdown(line))).collect();
    format!("\nClosest within each budget, settings tuned for it:\n\n{lines}")
}

/// A line for each budget and error: the closest method and the next one.
pub fn budget_lines(rows: &[Row]) -> Vec<String> {
    lines(rows, &|row| full_name(row, rows))
}

/// The rows as an aligned Markdown table with a caption, with what there is to say about single rows and what was left
/// out below it.
pub fn markdown(rows: &[Row]) -> String {
    let mut out = markdown_table(rows, |_| true);
    out += "\nErrors are of transmittance (0 to 1): `ray err` along light rays, `point err` at the points the \
        camera sees; the picture's are against the exact picture, RMSE and PSNR in linear RGBA, SSIM in sRGB. Times \
        are medians. Every column is in the CSV file beside this one.\n";
    if let Some(error) = rows.iter().filter_map(|r| r.image_exact_err).reduce(f64::max) {
        out += &format!(
            "The exact picture itself changes by at most {} in a channel when its integration is made finer.\n",
            significant(error, 2)
        );
    }
    out += &remarks(rows);
    out += &answers(rows);
    let mut left_out = rows.iter().filter(|r| !r.left_out.is_empty()).peekable();
    if left_out.peek().is_some() {
        out += "\nLeft out, because the scene does not need it:\n\n";
        for row in left_out {
            let name = escape_markdown(&full_name(row, rows));
            out += &format!("- {name}: {}\n", escape_markdown(&row.left_out));
        }
    }
    out
}

fn markdown_table(rows: &[Row], wanted: impl Fn(&Shown) -> bool) -> String {
    let (caption, shown) = layout(rows, wanted);
    let mut out = format!("{}\n\n", escape_markdown(&caption));
    let mut lines = vec![shown.iter().map(|s| escape_markdown(&heading(s))).collect::<Vec<_>>()];
    lines.extend(rows.iter().map(|r| shown.iter().map(|s| escape_markdown(&(s.value)(r))).collect()));
    let width = |column: usize| lines.iter().map(|l| l[column].chars().count()).max().unwrap_or(0).max(3);
    let widths: Vec<usize> = (0..shown.len()).map(width).collect();
    for (i, line) in lines.iter().enumerate() {
        out.push('|');
        for ((cell, s), &width) in line.iter().zip(&shown).zip(&widths) {
            // Writing to a String cannot fail.
            let _ =
                if s.number { write!(out, " {cell:>width$} |") } else { write!(out, " {cell:<width$} |") };
        }
        out.push('\n');
        if i == 0 {
            out.push('|');
            for (s, width) in shown.iter().zip(&widths) {
                let dashes = "-".repeat(*width);
                out += &if s.number { format!(" {}: |", &dashes[1..]) } else { format!(" {dashes} |") };
            }
            out.push('\n');
        }
    }
    out
}

/// The rows as a LaTeX `tabular` (package `booktabs`) to be put into a `table` with `\input`; a rule between
/// methods. What all rows share is a comment above it.
pub fn latex(rows: &[Row]) -> String {
    let (caption, shown) = layout(rows, |s| s.on_paper);
    let mut out = format!("% Needs \\usepackage{{booktabs}}.\n% {}\n", one_line(&caption));
    let alignment: String = shown.iter().map(|s| if s.number { 'r' } else { 'l' }).collect();
    out += &format!("\\begin{{tabular}}{{@{{}}{alignment}@{{}}}}\n\\toprule\n");
    let line = |cells: Vec<String>| cells.join(" & ") + " \\\\\n";
    out += &line(shown.iter().map(|s| escape_latex(s.heading)).collect());
    let unit = |s: &&Shown| if s.unit.is_empty() { String::new() } else { format!("[{}]", s.unit) };
    // The first column never has a unit, so no `[` follows `\\` to be read as its argument; texts have theirs escaped.
    out += &line(shown.iter().map(unit).collect());
    let mut method = None;
    for row in rows {
        if method != Some(&row.method) {
            out += "\\midrule\n";
            method = Some(&row.method);
        }
        let cell = |s: &&Shown| {
            let value = (s.value)(row);
            if s.number { latex_number(&value) } else { escape_latex(&value) }
        };
        out += &line(shown.iter().map(cell).collect());
    }
    out + "\\bottomrule\n\\end{tabular}\n"
}

/// Writes `compare.csv`, `compare.json`, `compare.md` and `compare.tex` (for `stem` `compare`) and `columns.md`, which says
/// what the columns are, into a folder that exists, each whole or not at all, and returns their paths.
///
/// # Errors
/// A file that cannot be written.
pub fn write_tables(rows: &[Row], folder: &Path, stem: &str) -> Result<Vec<PathBuf>> {
    let files = [
        (format!("{stem}.csv"), table_csv(rows)?),
        (format!("{stem}.json"), json(rows)?.into_bytes()),
        (format!("{stem}.md"), markdown(rows).into_bytes()),
        (format!("{stem}.tex"), latex(rows).into_bytes()),
        ("columns.md".into(), columns_markdown().into_bytes()),
    ];
    files
        .into_iter()
        .map(|(name, bytes)| {
            let path = folder.join(name);
            write_whole(&path, |file| file.write_all(&bytes))?;
            Ok(path)
        })
        .collect()
}

/// The caption of what all rows share, a failed one with nothing there aside, and the other columns that any row has a
/// value in.
fn layout(rows: &[Row], wanted: impl Fn(&Shown) -> bool) -> (String, Vec<&'static Shown>) {
    let (mut caption, mut shown) = (Vec::new(), Vec::new());
    for s in SHOWN.iter().filter(|s| wanted(s)) {
        let mut values = rows.iter().map(s.value).filter(|v| !v.is_empty());
        let Some(first) = values.next() else { continue };
        let whole = rows.iter().all(|r| r.has_failed() || !(s.value)(r).is_empty());
        if s.caption && whole && values.all(|v| v == first) {
            caption.push(format!("{}: {first}", s.heading));
        } else {
            shown.push(s);
        }
    }
    (caption.join(" · "), shown)
}

fn heading(s: &Shown) -> String {
    if s.unit.is_empty() { s.heading.to_string() } else { format!("{} [{}]", s.heading, s.unit) }
}

/// Method and parameters, as one would ask for them.
fn name(row: &Row) -> String {
    if row.params.is_empty() { row.method.clone() } else { format!("{} {}", row.method, row.params) }
}

/// The same with the scene and the map's size, where these differ between rows.
fn full_name(row: &Row, rows: &[Row]) -> String {
    let scene =
        if rows.iter().any(|r| r.scene != row.scene) { format!("{}: ", row.scene) } else { String::new() };
    let mut sizes = rows.iter().filter_map(|r| r.map);
    let first = sizes.next();
    match row.map {
        Some(map) if sizes.any(|m| Some(m) != first) => format!("{scene}{} map={map}", name(row)),
        _ => scene + &name(row),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

pub(super) fn escape_markdown(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        if matches!(c, '\\' | '|' | '<' | '*' | '`' | '[') {
            out.push('\\');
        }
        out.push(c);
    }
    // Brackets are units here; without a following parenthesis or colon they are plain text.
    out.replace("\\[", "[")
}

fn escape_latex(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        match c {
            '\\' => out += "\\textbackslash{}",
            '~' => out += "\\textasciitilde{}",
            '^' => out += "\\textasciicircum{}",
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '|' => out += "\\textbar{}",
            // After the end of a line these would be taken for its arguments.
            '[' | '*' => out.extend(['{', c, '}']),
            '{' | '}' | '$' | '&' | '#' | '_' | '%' => out.extend(['\\', c]),
            _ => out.push(c),
        }
    }
    out
}

/// A number made by [`significant`], in mathematics.
fn latex_number(text: &str) -> String {
    if text.is_empty() {
        return String::new();
    }
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("${mantissa}\\times10^{{{exponent}}}$"),
        None => format!("${}$", text.replace("inf", "\\infty").replace("NaN", "\\mathrm{NaN}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;

    #[test]
    fn markdown_is_an_aligned_table() {
        let text = markdown(&sample_rows());
        assert!(text.starts_with(
            "scene: CT_AVM vessels · adapter: llvmpipe (LLVM 19.1, 256 bits) · picture: 512 x 512 · clock: wall\n"
        ));
        let table: Vec<&str> = text.lines().filter(|l| l.starts_with('|')).collect();
        assert_eq!(table.len(), 2 + 5);
        let length = table[0].chars().count();
        let bars = |line: &str| line.matches('|').count();
        assert!(table.iter().all(|l| l.chars().count() == length && bars(l) == bars(table[0])), "{text}");
        assert!(table[0].contains("build [ms]") && !table[0].contains("scene"), "{text}");
        assert!(!table[0].contains("image rmse"), "no row has it");
        assert!(table[1].contains("-: |"));
        assert!(table[4].contains("| epsilon=0.06 prefilter=1 ") && table[4].contains(" 3.20 |"), "{text}");
        assert!(text.contains("12 bricks \\| 3 MiB"), "a bar must not make a column");
    }

    #[test]
    fn the_summary_says_what_is_closest_within_a_budget() {
        let mut rows = sample_rows();
        rows[3].bytes = Some(4 << 20);
        rows[4].bytes = Some(3 << 20);
        rows[4].map = Some(256);
        rows[4].point_err_rms = Some(0.004);
        assert!(!summary(&rows).contains("Closest"));
        rows[4].tuned_for = "bytes=4MiB point_err_rms; ms=150 point_err_rms".into();
        for text in [summary(&rows), markdown(&rows)] {
            // 145 and 160 ms.
            for line in [
                "- bytes=4MiB, point err rms: dsm epsilon=0.005 prefilter=1 (0.00100, 4.00 MiB); then \
                    osm layers=8 slicing=uniform map=256 (0.00400, 3.00 MiB), 4.00 times the error",
                "- ms=150, point err rms: dsm epsilon=0.06 prefilter=1 map=512 (0.0100, 145 ms); then \
                    none (0.500, 80.0 ms), 50.0 times the error",
            ] {
                assert!(text.lines().any(|l| l == line), "{line}\n{text}");
            }
        }
    }

    #[test]
    fn what_differs_between_rows_is_a_column() {
        let mut rows = sample_rows();
        rows[1].scene = "engine step".into();
        let text = markdown(&rows);
        assert!(!text.lines().next().unwrap().contains("scene"));
        assert!(text.contains("| scene ") && text.contains("| engine step "));
    }

    #[test]
    fn latex_is_escaped_and_every_line_has_all_columns() {
        let mut rows = sample_rows();
        rows[2].params = "a_b=50% {x} & ~#$^\\ [1] *".into();
        rows[2].point_err_p99 = Some(1.234e-5);
        let text = latex(&rows);
        assert!(text.contains(
            "a\\_b=50\\% \\{x\\} \\& \\textasciitilde{}\\#\\$\\textasciicircum{}\\textbackslash{} {[}1] {*}"
        ));
        assert!(text.contains("$1.23\\times10^{-5}$") && text.contains("$\\infty$"));
        assert_eq!(text.matches("\\midrule").count(), 4, "one before each method");
        let begin = text.lines().find(|l| l.starts_with("\\begin")).unwrap();
        let columns = begin.split("@{}").nth(1).unwrap().len();
        let lines: Vec<&str> = text.lines().filter(|l| l.ends_with("\\\\")).collect();
        assert_eq!(lines.len(), 2 + 5);
        for line in lines {
            assert_eq!(line.replace("\\&", "").matches('&').count(), columns - 1, "{line}");
        }
        // A comment that broke over a line would be typeset.
        rows.iter_mut().for_each(|r| r.scene = "two\nlines".into());
        assert!(latex(&rows).contains("% scene: two lines"));
    }

    #[test]
    fn no_rows_still_make_tables() {
        assert!(markdown(&[]).contains('|'));
        assert!(latex(&[]).contains("\\bottomrule"));
    }

    #[test]
    fn files_appear_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let paths = write_tables(&sample_rows(), folder.path(), "compare").unwrap();
        let names = || {
            let mut names: Vec<_> =
                std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().file_name()).collect();
            names.sort();
            names
        };
        assert_eq!(names(), ["columns.md", "compare.csv", "compare.json", "compare.md", "compare.tex"]);
        assert!(paths.iter().all(|p| std::fs::metadata(p).unwrap().len() > 100));
        // A folder in the way: an error, and nothing left behind.
        std::fs::create_dir(folder.path().join("other.csv")).unwrap();
        let error = write_tables(&sample_rows(), folder.path(), "other").unwrap_err();
        assert_eq!(error.exit_status(), 1);
        assert_eq!(names().len(), 6);
    }
}
