//! Writes Markdown tables with aligned columns in the source text.

/// Alignment of a column in a Markdown table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Left alignment of a Markdown table column, for text.
    Left,
    /// Right alignment of a Markdown table column, for numbers.
    Right,
    /// Centre alignment of a Markdown column; its source text is aligned to the right.
    Middle,
}

/// Returns one line of a Markdown table whose columns are not aligned in the source text.
pub fn table_line(cells: impl IntoIterator<Item = String>) -> String {
    let cells = cells.into_iter().map(|cell| cell.replace('|', "\\|").replace('\n', " "));
    format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
}

/// Returns a Markdown table with a heading and an alignment for each column; columns are aligned in the source text.
pub fn aligned_table(headings: &[(String, Align)], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| &row[column]).chain([&headings[column].0]);
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0).max(3)
    };
    let columns: Vec<(Align, usize)> = headings.iter().enumerate().map(|(i, h)| (h.1, width(i))).collect();
    let line = |cells: &mut dyn Iterator<Item = &String>| {
        let padded = cells.zip(&columns).map(|(cell, (align, width))| match align {
            Align::Left => format!(" {cell:<width$} |"),
            Align::Right | Align::Middle => format!(" {cell:>width$} |"),
        });
        format!("|{}\n", padded.collect::<String>())
    };
    let rule = columns.iter().map(|(align, width)| match align {
        Align::Left => format!(" {} |", "-".repeat(*width)),
        Align::Right => format!(" {}: |", "-".repeat(width - 1)),
        Align::Middle => format!(" :{}: |", "-".repeat(width - 2)),
    });
    let mut out = line(&mut headings.iter().map(|(heading, _)| heading));
    out += &format!("|{}\n", rule.collect::<String>());
    out.extend(rows.iter().map(|row| line(&mut row.iter())));
    out
}
