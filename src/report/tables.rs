//! Readable comparison tables as Markdown and LaTeX, with units in the headings and three significant digits.

mod columns;
mod latex;

use super::budgets::lines;
use super::markdown::{Align, aligned_table};
use super::number::significant;
use super::run::Run;
use super::writers::{columns_markdown, table_csv, table_json, write_files};
use crate::error::Result;
use crate::measure::budget::Budget;
use crate::measure::table::Row;
use columns::{SHOWN, TableColumn, chosen, one_line};
use std::path::{Path, PathBuf};

/// Layout of the readable comparison tables: chosen columns, and width of the LaTeX table and of figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Columns that the user chose, by their names in `compare.csv`. With `None`, LaTeX and the terminal show a few
    /// columns, and Markdown shows most.
    pub columns: Option<Vec<String>>,
    /// Largest width of the LaTeX table, and width of the figure of all methods' pictures, points.
    pub tex_width_pt: f64,
    /// Upper end of the colour bar of all difference images; with `None` it follows from the differences.
    pub difference_max: Option<f32>,
}

impl Layout {
    /// Default width of the LaTeX table, points: the text width of an A4 page with margins of 2.5 cm.
    pub const TEX_WIDTH_PT: f64 = 455.0;

    /// Returns an error if a chosen column does not exist in `compare.csv` or is chosen twice.
    ///
    /// # Errors
    /// A chosen column does not exist, or is listed twice.
    pub fn check(&self) -> Result<()> {
        self.columns.as_deref().map_or(Ok(()), |names| chosen(names).map(|_| ()))
    }
}

impl Default for Layout {
    fn default() -> Self {
        Self { columns: None, tex_width_pt: Self::TEX_WIDTH_PT, difference_max: None }
    }
}

/// Columns of the summary that the default LaTeX table has no room for.
const BESIDE_PAPER: [&str; 2] = ["point_err_max", "bound_depth_mm"];

/// Returns the main columns of the comparison table as Markdown with a caption. The coverage of error bounds, notes on
/// single rows and the most accurate shadow method within each budget follow below the table.
pub fn summary(rows: &[Row], layout: &Layout) -> String {
    let is_shown = |s: &&TableColumn| s.on_paper || BESIDE_PAPER.contains(&s.name);
    let few: Vec<TableColumn> = SHOWN.iter().filter(is_shown).copied().collect();
    let table = markdown_table(rows, &picked(layout, few));
    let coverage = bound_coverage(rows).map_or(String::new(), |text| format!("\n{text}\n"));
    table + &coverage + &remarks(rows) + &answers(rows)
}

/// Returns what the error bounds of a table cover; `None` if no row has one.
pub fn bound_coverage(rows: &[Row]) -> Option<&'static str> {
    let text = "`bound` covers light rays through texel centres, up to `bound depth` along them. `point bound held` \
        covers points between them, up to `point bound lateral` aside. Neither covers pixels: `point err max` is the \
        largest error found at the points that the camera sees.";
    rows.iter().any(|row| row.bound.is_some()).then_some(text)
}

/// Markdown list of the notes on single rows of the comparison table.
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

/// Markdown list of the most accurate shadow method within each memory or time budget; empty without budgets.
fn answers(rows: &[Row]) -> String {
    let lines = budget_lines(rows);
    if lines.is_empty() {
        return String::new();
    }
    let lines: String = lines.iter().map(|line| format!("- {}\n", escape_markdown(line))).collect();
    format!("\nClosest within each budget, settings tuned for it:\n\n{lines}")
}

/// Returns one text line for each budget and error measure: the most accurate shadow method and the second best.
pub fn budget_lines(rows: &[Row]) -> Vec<String> {
    lines(rows, &|row| full_name(row, rows))
}

/// Returns the comparison table as Markdown with a caption. Below it are notes on single rows, the best shadow method
/// within each budget, and the rendering steps skipped as unnecessary.
pub fn markdown(rows: &[Row], layout: &Layout) -> String {
    let mut out = markdown_table(rows, &picked(layout, SHOWN.to_vec()));
    out += "\nErrors are of transmittance (0 to 1): `ray err` along light rays, `point err` at the points the \
        camera sees; the picture's are against the exact picture, RMSE and PSNR in linear RGBA, SSIM in sRGB. Times \
        are medians. Every column is in the CSV file beside this one.\n";
    if let Some(text) = bound_coverage(rows) {
        out += &format!("{text}\n");
    }
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

fn markdown_table(rows: &[Row], wanted: &[TableColumn]) -> String {
    let (caption, shown) = filled(rows, wanted);
    let align = |s: &TableColumn| if s.number { Align::Right } else { Align::Left };
    let headings: Vec<_> = shown.iter().map(|s| (escape_markdown(&heading(s)), align(s))).collect();
    let cells = |row| shown.iter().map(|s| escape_markdown(&s.value(row))).collect();
    let cells: Vec<Vec<String>> = rows.iter().map(cells).collect();
    format!("{}\n\n{}", escape_markdown(&caption), aligned_table(&headings, &cells))
}

/// Writes the comparison table as `compare.csv`, `compare.json`, `compare.md` and `compare.tex`, and its column
/// descriptions as `columns.md`, into an existing folder. Each file appears only when it is complete. Returns the
/// paths, and remarks on columns that do not fit.
///
/// # Errors
/// A chosen column does not exist, or a file cannot be written.
pub fn write_tables(
    rows: &[Row],
    folder: &Path,
    run: &Run,
    layout: &Layout,
) -> Result<(Vec<PathBuf>, Vec<String>)> {
    layout.check()?;
    let (caption, shown) = self::layout(rows, layout);
    let latex = latex::latex(rows, &caption, &shown, layout.tex_width_pt);
    let remarks = match latex.left_out.is_empty() {
        true => Vec::new(),
        false => vec![format!(
            "compare.tex is {} pt wide and has no room for: {}",
            layout.tex_width_pt,
            latex.left_out.join(", ")
        )],
    };
    let files = [
        ("compare.csv", table_csv(rows)?),
        ("compare.json", table_json(rows, run)?.into_bytes()),
        ("compare.md", (markdown(rows, layout) + &provenance(run)).into_bytes()),
        ("compare.tex", latex.text.into_bytes()),
        ("columns.md", columns_markdown().into_bytes()),
    ];
    Ok((write_files(folder, files)?, remarks))
}

/// Markdown text on how the comparison table was measured, with the command line that measures it again.
fn provenance(run: &Run) -> String {
    let mut out = format!(
        "\nMade by umbravox {}, revision {} ({}), on {} ({}).",
        run.version,
        run.revision,
        run.profile,
        escape_markdown(&run.adapter),
        escape_markdown(&run.driver)
    );
    for scene in run.scenes.iter().filter(|s| !s.settings.is_empty()) {
        let sum =
            scene.volume_sha256.as_ref().map_or(String::new(), |sum| format!("; volume's SHA-256 {sum}"));
        out += &format!(" Scene {}: `{}`{sum}.", escape_markdown(&scene.name), scene.file);
    }
    if !run.command.is_empty() {
        out += &format!(" Command line:\n\n```\n{}\n```\n", run.command_line());
    }
    if !run.again.is_empty() {
        // Time budgets depend on measured times, which differ between runs.
        let is_of_time = |budget: &String| budget.parse().is_ok_and(|budget: Budget| budget.is_of_time());
        let timed = run.budgets.iter().any(is_of_time);
        let but = if timed { " (but for what a search within a time chooses)" } else { "" };
        out += &format!(
            "\nThe whole table is made again, with the same errors{but}, by\n\n```\n{}\n```\n",
            run.again
        );
    }
    out
}

/// Returns the table columns that the user chose, or `otherwise` if there are none. Conditions such as scene and
/// adapter are added to the chosen columns.
fn picked(layout: &Layout, otherwise: Vec<TableColumn>) -> Vec<TableColumn> {
    // `check` has validated the names; an unknown name selects the default columns.
    let own = layout.columns.as_deref().and_then(|names| chosen(names).ok());
    let Some(own) = own else { return otherwise };
    // Conditions that differ between rows are added, since rows could not be identified without them.
    let chosen = |s: &TableColumn| own.iter().any(|o| o.name == s.name);
    let conditions = SHOWN.iter().filter(|s| s.caption && s.on_paper && !chosen(s));
    conditions.chain(&own).copied().collect()
}

/// Returns the caption and the columns of the LaTeX table: the columns that the user chose, or a few default columns.
fn layout(rows: &[Row], layout: &Layout) -> (String, Vec<TableColumn>) {
    let few = SHOWN.iter().filter(|s| s.on_paper).copied().collect();
    filled(rows, &picked(layout, few))
}

/// Returns the caption and the visible columns of a comparison table. A measurement condition that is equal in all
/// rows moves to the caption, and columns without any value are dropped.
fn filled(rows: &[Row], wanted: &[TableColumn]) -> (String, Vec<TableColumn>) {
    let (mut caption, mut shown) = (Vec::new(), Vec::new());
    for s in wanted {
        let mut values = rows.iter().map(|r| s.value(r)).filter(|v| !v.is_empty());
        let Some(first) = values.next() else { continue };
        let whole = rows.iter().all(|r| r.has_failed() || !s.value(r).is_empty());
        if s.caption && whole && values.all(|v| v == first) {
            caption.push(format!("{}: {first}", s.heading));
        } else {
            shown.push(*s);
        }
    }
    (caption.join(" · "), shown)
}

fn heading(s: &TableColumn) -> String {
    if s.unit.is_empty() { s.heading.to_string() } else { format!("{} [{}]", s.heading, s.unit) }
}

/// Shadow method and settings of a comparison-table row, as text.
fn name(row: &Row) -> String {
    if row.params.is_empty() { row.method.clone() } else { format!("{} {}", row.method, row.params) }
}

/// Shadow method and settings of a comparison-table row, with scene and shadow-map size if these differ between rows.
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

pub(super) fn escape_markdown(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        if matches!(c, '\\' | '|' | '<' | '*' | '`') {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;

    #[test]
    fn markdown_is_an_aligned_table() {
        let text = markdown(&sample_rows(), &Layout::default());
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
        assert!(!summary(&rows, &Layout::default()).contains("Closest"));
        rows[4].tuned_for = "bytes=4MiB point_err_rms; ms=150 point_err_rms".into();
        for text in [summary(&rows, &Layout::default()), markdown(&rows, &Layout::default())] {
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
        let text = markdown(&rows, &Layout::default());
        assert!(!text.lines().next().unwrap().contains("scene"));
        assert!(text.contains("| scene ") && text.contains("| engine step "));
    }

    #[test]
    fn tables_without_rows_are_written() {
        assert!(markdown(&[], &Layout::default()).contains('|'));
    }

    #[test]
    fn files_appear_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let run = Run { version: "1.2.3".into(), again: "umbravox compare ...".into(), ..Run::default() };
        let write = |folder: &Path| write_tables(&sample_rows(), folder, &run, &Layout::default());
        let (paths, remarks) = write(folder.path()).unwrap();
        let mut names: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["columns.md", "compare.csv", "compare.json", "compare.md", "compare.tex"]);
        assert!(paths.iter().all(|p| std::fs::metadata(p).unwrap().len() > 100) && remarks.is_empty());
        let text = std::fs::read_to_string(folder.path().join("compare.md")).unwrap();
        assert!(text.contains("1.2.3") && text.ends_with("umbravox compare ...\n```\n"));
        // A folder in the way: an error, and nothing left behind.
        let other = tempfile::tempdir().unwrap();
        std::fs::create_dir(other.path().join("compare.csv")).unwrap();
        assert_eq!(write(other.path()).unwrap_err().exit_status(), 1);
        assert_eq!(std::fs::read_dir(other.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_columns_that_are_asked_for_are_shown_in_their_order() {
        let names = ["method", "epsilon", "point_err_rms", "build_wall_ms"].map(String::from);
        let layout = Layout { columns: Some(names.into()), ..Layout::default() };
        let text = summary(&sample_rows(), &layout);
        let heading = text.lines().find(|l| l.starts_with('|')).unwrap();
        let words: Vec<_> = heading.split('|').map(str::trim).filter(|w| !w.is_empty()).collect();
        assert_eq!(words, ["method", "epsilon", "point err rms", "build_wall_ms [ms]"]);
        for (names, named) in [(vec!["colour"], "`colour`"), (vec![""], "``"), (vec!["map", "map"], "`map`")]
        {
            let names = names.into_iter().map(String::from).collect();
            let error = Layout { columns: Some(names), ..Layout::default() }.check().unwrap_err();
            assert!(error.exit_status() == 2 && error.to_string().contains(named), "{error}");
        }
    }
}
