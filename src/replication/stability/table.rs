//! The summary of the stability table.

use super::{Row, Status};
use std::collections::HashMap;

/// Glyph of a cell whose method the case does not concern.
const ABSENT: char = '·';

/// Cases by methods, one glyph a cell, and every remark below. A method that stands in several settings has a column for
/// each, in the order given.
pub fn markdown(rows: &[Row]) -> String {
    let mut names: Vec<&str> = Vec::new();
    // Settings differ from case to case; a method's n-th row of a case is its n-th column.
    let mut cells: HashMap<(&str, (&str, usize)), Status> = HashMap::new();
    let mut columns: Vec<(&str, usize)> = Vec::new();
    for row in rows {
        if !names.contains(&&*row.case) {
            names.push(&row.case);
        }
        let nth = (0..).find(|n| !cells.contains_key(&(&*row.case, (&*row.method, *n)))).unwrap_or(0);
        let column = (&*row.method, nth);
        cells.insert((&row.case, column), row.status);
        if !columns.contains(&column) {
            columns.push(column);
        }
    }
    let widest = names.iter().map(|n| n.len()).max().unwrap_or(0).max(4);
    let heading = |&(method, nth): &(&str, usize)| match nth {
        0 => method.to_owned(),
        n => format!("{method} {}", n + 1),
    };
    let headings: Vec<_> = columns.iter().map(heading).collect();
    let line = |first: &str, rest: &mut dyn Iterator<Item = String>| {
        format!("| {first:widest$} | {} |\n", rest.collect::<Vec<_>>().join(" | "))
    };
    let mut out = line("case", &mut headings.iter().map(|h| format!("{h:>3}")));
    out += &format!("| {:-<widest$} | ", "");
    out += &headings
        .iter()
        .map(|h| format!(":{}:", "-".repeat(h.len().max(3) - 2)))
        .collect::<Vec<_>>()
        .join(" | ");
    out += " |\n";
    for case in &names {
        out += &line(
            case,
            &mut columns.iter().zip(&headings).map(|(&column, h)| {
                let glyph = cells.get(&(*case, column)).map_or(ABSENT, |s| s.glyph());
                format!("{glyph:>0$}", h.len().max(3))
            }),
        );
    }
    let key: Vec<_> = Status::ALL.iter().map(|s| format!("{} {}", s.glyph(), s.name())).collect();
    out += &format!("\n{} · {ABSENT} not concerned\n\n{}\n", key.join(" · "), counted(rows));
    let mut remarks = rows.iter().filter(|r| !r.note.is_empty()).peekable();
    if remarks.peek().is_some() {
        out.push('\n');
    }
    for row in remarks {
        let name = [&row.method, &*row.params].join(" ");
        out += &format!("- {}, {}: {}: {}\n", row.case, name.trim_end(), row.status.name(), row.note);
    }
    out
}

/// `312 rows: 310 ok, 2 bound_exceeded`.
pub fn counted(rows: &[Row]) -> String {
    let count = |status: Status| rows.iter().filter(|r| r.status == status).count();
    let counts: Vec<_> = Status::ALL
        .iter()
        .filter(|s| count(**s) > 0)
        .map(|s| format!("{} {}", count(*s), s.name()))
        .collect();
    format!("{} rows: {}", rows.len(), counts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::writers::{csv, json};

    fn rows() -> Vec<Row> {
        let row = |case: &str, method: &str, status| Row::new(case, method, "map=64".into(), status);
        vec![
            Row { ray_err_max: Some(0.5), bytes: Some(0), ..row("comb", "none", Status::Ok) },
            Row { note: "lamp: 3 values; \"x\"".into(), ..row("comb", "dsm", Status::Nan) },
            row("comb", "dsm", Status::Ok),
            Row { ray_err_max: Some(f64::INFINITY), ..row("epsilon-0", "dsm", Status::BoundExceeded) },
        ]
    }

    #[test]
    fn csv_has_the_columns_of_the_contract() {
        let text = String::from_utf8(csv(&rows()).unwrap()).unwrap();
        let mut lines = text.lines();
        assert_eq!(
            lines.next().unwrap(),
            "case,method,params,status,ray_err_max,bound,monotone_violations,out_of_range,non_finite,build_ms,bytes,note"
        );
        assert_eq!(lines.next().unwrap(), "comb,none,map=64,ok,0.5,,,,,,0,");
        assert!(lines.next().unwrap().starts_with("comb,dsm,map=64,nan,,"));
        assert!(text.contains("epsilon-0,dsm,map=64,bound_exceeded,inf,"));
        let parsed: serde_json::Value = serde_json::from_str(&json(&rows()).unwrap()).unwrap();
        assert_eq!(parsed[1]["status"], "nan");
    }

    #[test]
    fn the_summary_is_a_glyph_a_cell() {
        let text = markdown(&rows());
        let table: Vec<Vec<&str>> = text
            .lines()
            .filter(|l| l.starts_with('|'))
            .map(|l| l.split('|').map(str::trim).filter(|c| !c.is_empty()).collect())
            .collect();
        assert_eq!(table[0], ["case", "none", "dsm", "dsm 2"]);
        assert_eq!(table[2], ["comb", "✓", "N", "✓"]);
        assert_eq!(table[3], ["epsilon-0", "·", "B", "·"]);
        assert!(text.contains("4 rows: 2 ok, 1 bound_exceeded, 1 nan"), "{text}");
        assert!(text.contains("- comb, dsm map=64: nan: lamp: 3 values"));
    }
}
