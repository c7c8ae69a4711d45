//! Comparison table as LaTeX that is no wider than the page. It reduces the font size first, then breaks the settings
//! into lines, and last omits columns from the end.

use super::columns::{TableColumn, heading_unit, one_line};
use crate::measure::table::Row;

/// LaTeX `tabular` of the comparison table, and the columns omitted from it.
pub struct Latex {
    pub text: String,
    /// Headings of the columns that do not fit into the LaTeX table.
    pub left_out: Vec<&'static str>,
}

/// Font size of the LaTeX table, and gap on each side of its columns.
struct Size {
    command: &'static str,
    /// Nominal font size of the LaTeX table in a 10-point document class, points.
    points: f64,
    /// Largest ratio of a letter's width in a smaller LaTeX font to its width in the 10-point font scaled to that
    /// size.
    cut: f64,
    gap: f64,
}

/// Font sizes of the LaTeX table, largest first. The ratios are from the metrics of Computer Modern Roman (`cmr9`,
/// `cmr8`, `cmr7` against `cmr10`).
const SIZES: [Size; 4] = [
    Size { command: "", points: 10.0, cut: 1.0, gap: 6.0 },
    Size { command: "\\small", points: 9.0, cut: 1.029, gap: 5.0 },
    Size { command: "\\footnotesize", points: 8.0, cut: 1.063, gap: 4.0 },
    Size { command: "\\scriptsize", points: 7.0, cut: 1.165, gap: 3.0 },
];
/// Smallest width of the settings column in the LaTeX table, points, if settings are broken into lines.
const NARROWEST_PT: f64 = 70.0;

/// Returns the comparison table as a LaTeX `tabular` (package `booktabs`) of at most `width_pt`, for `\input` in a
/// `table` of a 10-point class. A rule separates shadow methods. The caption is a comment above the `tabular`.
pub fn latex(rows: &[Row], caption: &str, shown: &[TableColumn], width_pt: f64) -> Latex {
    let mut shown = shown.to_vec();
    let mut left_out = Vec::new();
    let (size, broken) = loop {
        match fitted(rows, &shown, width_pt) {
            Some(found) => break found,
            // The first column names the row; a table with only this column cannot be narrower.
            None if shown.len() < 2 => break (&SIZES[SIZES.len() - 1], None),
            None => left_out.extend(shown.pop().map(|s| s.heading)),
        }
    };
    left_out.reverse();
    let mut text = format!("% Needs \\usepackage{{booktabs}}; at most {width_pt} pt wide.\n");
    text += &format!("% {}\n", one_line(caption));
    if !left_out.is_empty() {
        text += &format!("% Left out, because they do not fit: {}\n", left_out.join(", "));
    }
    text += &format!("\\begingroup{}\\setlength{{\\tabcolsep}}{{{}pt}}%\n", size.command, size.gap);
    let column = |(i, s): (usize, &TableColumn)| match broken {
        Some((place, width)) if place == i => format!("p{{{width:.1}pt}}"),
        _ if s.number => "r".into(),
        _ => "l".into(),
    };
    let alignment: String = shown.iter().enumerate().map(column).collect();
    text += &format!("\\begin{{tabular}}{{@{{}}{alignment}@{{}}}}\n\\toprule\n");
    let line = |cells: Vec<String>| cells.join(" & ") + " \\\\\n";
    text += &line(shown.iter().map(|s| escape(s.heading)).collect());
    // The first column has no unit, so no `[` follows `\\` to be read as its argument; `[` in texts is escaped.
    text += &line(shown.iter().map(heading_unit).collect());
    let mut method = None;
    for row in rows {
        if method != Some(&row.method) {
            text += "\\midrule\n";
            method = Some(&row.method);
        }
        let cell = |(i, s): (usize, &TableColumn)| {
            let value = s.value(row);
            let is_broken = broken.is_some_and(|(place, _)| place == i);
            let cell = if is_number(s, &value) { number(&value) } else { escape(&value) };
            // Narrow lines are neither stretched nor hyphenated.
            if is_broken { format!("\\raggedright\\arraybackslash {cell}") } else { cell }
        };
        text += &line(shown.iter().enumerate().map(cell).collect());
    }
    if broken.is_some() {
        text = text.replace("\\usepackage{booktabs}", "\\usepackage{array,booktabs}");
    }
    Latex { text: text + "\\bottomrule\n\\end{tabular}%\n\\endgroup\n", left_out }
}

/// Returns the largest font size at which the LaTeX table fits its width. If settings must be broken into lines, also
/// returns the index and width of their column.
fn fitted(
    rows: &[Row],
    shown: &[TableColumn],
    width_pt: f64,
) -> Option<(&'static Size, Option<(usize, f64)>)> {
    let ems: Vec<f64> = shown.iter().map(|s| column_em(rows, s)).collect();
    let gaps = |size: &Size| 2.0 * size.gap * (shown.len().saturating_sub(1)) as f64;
    let points = |size: &Size, em: f64| em * size.points * size.cut;
    let total = |size: &Size| points(size, ems.iter().sum()) + gaps(size);
    if let Some(size) = SIZES.iter().find(|size| total(size) <= width_pt) {
        return Some((size, None));
    }
    let place = shown.iter().position(|s| s.name == "params")?;
    SIZES.iter().skip(2).find_map(|size| {
        let room = width_pt - (total(size) - points(size, ems[place]));
        (room >= NARROWEST_PT).then_some((size, Some((place, room))))
    })
}

/// Width of a table column in ems of 10-point Computer Modern Roman.
fn column_em(rows: &[Row], shown: &TableColumn) -> f64 {
    let cell = |row: &Row| {
        let value = shown.value(row);
        if is_number(shown, &value) { number_em(&value) } else { text_em(&value) }
    };
    let widest = rows.iter().map(cell).fold(0.0, f64::max);
    widest.max(text_em(shown.heading)).max(text_em(&heading_unit(shown)))
}

fn is_number(shown: &TableColumn, value: &str) -> bool {
    shown.number && value.parse::<f64>().is_ok()
}

/// Widths of the printable ASCII characters in the font `cmr10`, from the space on, in thousandths of an em (Knuth
/// 1986).
#[rustfmt::skip]
const LETTERS: [u16; 95] = [
    334, 278, 500, 833, 500, 833, 778, 278, 389, 389, 500, 778, 278, 333, 278, 500,
    500, 500, 500, 500, 500, 500, 500, 500, 500, 500, 278, 278, 778, 778, 778, 472,
    778, 750, 708, 722, 764, 681, 653, 785, 750, 361, 514, 778, 625, 917, 750, 778,
    681, 778, 736, 556, 722, 750, 750, 1028, 750, 750, 611, 278, 514, 278, 514, 400,
    278, 500, 556, 444, 556, 444, 306, 500, 556, 278, 306, 528, 278, 833, 556, 500,
    556, 528, 392, 394, 389, 556, 528, 722, 528, 528, 444, 500, 278, 500, 500,
];

fn text_em(text: &str) -> f64 {
    let width = |c: char| {
        let place = (c as usize).checked_sub(' ' as usize);
        // Letters outside ASCII count as wide.
        f64::from(place.and_then(|i| LETTERS.get(i)).copied().unwrap_or(1000))
    };
    one_line(text).chars().map(width).sum::<f64>() / 1000.0
}

/// Width of a number in the LaTeX table, in em, as [`number`] typesets it.
fn number_em(text: &str) -> f64 {
    let minus = |digits: &str| if digits.starts_with('-') { 0.778 - 0.333 } else { 0.0 };
    match text.split_once('e') {
        // A times sign with its spaces, and an exponent of 7 points, whose digits are cut wide.
        Some((mantissa, exponent)) => {
            let power = 0.8 * (text_em(exponent) + minus(exponent));
            text_em(mantissa) + minus(mantissa) + 0.778 + 2.0 * 0.223 + 1.0 + power + 0.05
        }
        None => text_em(&text.replace("inf", "ww").replace("NaN", "NNN")) + minus(text),
    }
}

fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        match c {
            '\\' => out += "\\textbackslash{}",
            '~' => out += "\\textasciitilde{}",
            '^' => out += "\\textasciicircum{}",
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '|' => out += "\\textbar{}",
            // After `\\` LaTeX would read these as its arguments.
            '[' | '*' => out.extend(['{', c, '}']),
            '{' | '}' | '$' | '&' | '#' | '_' | '%' => out.extend(['\\', c]),
            _ => out.push(c),
        }
    }
    out
}

/// Formats a number as LaTeX mathematics.
fn number(text: &str) -> String {
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
    use super::super::columns::{SHOWN, chosen};
    use super::*;
    use crate::measure::table::tests::sample_rows;

    fn made(rows: &[Row], width_pt: f64) -> Latex {
        let is_shown =
            |s: &&TableColumn| s.on_paper && !s.caption && rows.iter().any(|r| !s.value(r).is_empty());
        let shown: Vec<TableColumn> = SHOWN.iter().filter(is_shown).copied().collect();
        let caption = rows.first().map_or(String::new(), |r| format!("scene: {}", r.scene));
        latex(rows, &caption, &shown, width_pt)
    }

    #[test]
    fn it_is_escaped_and_every_line_has_all_columns() {
        let mut rows = sample_rows();
        rows[2].params = "a_b=50% {x} & ~#$^\\ [1] *".into();
        rows[2].ray_err_max = Some(1.234e-5);
        let text = made(&rows, 1000.0).text;
        assert!(text.contains(
            "a\\_b=50\\% \\{x\\} \\& \\textasciitilde{}\\#\\$\\textasciicircum{}\\textbackslash{} {[}1] {*}"
        ));
        assert!(text.contains("$1.23\\times10^{-5}$") && text.contains("$\\infty$"));
        assert_eq!(text.matches("\\midrule").count(), 4, "one before each method");
        let begin = text.lines().find(|l| l.starts_with("\\begin{tabular}")).unwrap();
        let columns = begin.split("@{}").nth(1).unwrap().len();
        let lines: Vec<&str> = text.lines().filter(|l| l.ends_with("\\\\")).collect();
        assert_eq!(lines.len(), 2 + 5);
        for line in lines {
            assert_eq!(line.replace("\\&", "").matches('&').count(), columns - 1, "{line}");
        }
        // A comment that broke over a line would be typeset.
        rows.iter_mut().for_each(|r| r.scene = "two\nlines".into());
        assert!(made(&rows, 455.0).text.contains("% scene: two lines"));
        assert!(made(&[], 455.0).text.contains("\\bottomrule"));
    }

    #[test]
    fn a_narrow_page_has_small_letters_then_broken_settings_then_fewer_columns() {
        let mut rows = sample_rows();
        let wide = made(&rows, 2000.0);
        assert!(wide.text.contains("\\begingroup\\setlength") && wide.left_out.is_empty());
        let page = made(&rows, 455.0);
        assert!(page.left_out.is_empty(), "what is shown where nobody says which fits A4: {}", page.text);
        rows[2].params = "epsilon=0.06 prefilter=5 march=samples step=0.5 filter=bilinear fit=view".into();
        let broken = made(&rows, 455.0);
        assert!(broken.text.contains("p{") && broken.text.contains("\\raggedright"), "{}", broken.text);
        assert!(broken.text.contains("array,booktabs") && broken.left_out.is_empty());
        let narrow = made(&rows, 200.0);
        assert!(!narrow.left_out.is_empty() && narrow.text.contains("Left out, because they do not fit"));
        assert!(narrow.text.contains("method"));
    }

    #[test]
    fn numeric_columns_can_hold_words() {
        let shown = chosen(&["method".into(), "slicing".into(), "layers".into()]).unwrap();
        let text = latex(&sample_rows(), "", &shown, 400.0).text;
        assert!(text.contains("osm & uniform & $8$"), "{text}");
    }
}
