//! Table of the stability suite, in which shadow methods are tested on extreme cases, and its Markdown summary.

use super::judge::Status;
use crate::error::Result;
use crate::report::markdown::{Align, aligned_table, table_line};
use crate::report::verify::{Recorder, Verified};
use crate::shadow::MethodSpec;
use itertools::Itertools as _;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Row of `stability.csv`: one shadow method in one stability case. The fields are the columns, in order. With
/// several lights, counts are sums over the lights; errors, times and memory are the largest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the stability case in which the shadow method was tested.
    pub case: String,
    /// Name of the shadow method.
    pub method: String,
    /// Settings of the shadow method as `key=value` texts separated by spaces.
    pub params: String,
    /// Worst numerical fault of the shadow method in the stability case, or `ok`.
    pub status: Status,
    /// Largest transmittance error `|T_method - T_exact|` along light rays.
    pub ray_err_max: Option<f64>,
    /// Error bound that the shadow method states along light rays: tolerance in transmittance. The bound also has a
    /// tolerance in depth, which this table does not list.
    pub bound: Option<f64>,
    /// Number of depths on light rays at which the shadow method's transmittance increases with depth.
    pub monotone_violations: Option<usize>,
    /// Number of finite transmittances, colour values and opacities outside `[0, 1]`.
    pub out_of_range: Option<usize>,
    /// Number of transmittances, colour values and opacities that are NaN or infinite.
    pub non_finite: Option<usize>,
    /// Time to build the shadow map, ms.
    pub build_ms: Option<f64>,
    /// Memory of the shadow map, bytes.
    pub bytes: Option<u64>,
    /// Descriptions of the shadow method's numerical faults, and of times or memory far above those of the ordinary
    /// case.
    pub note: String,
}

impl Row {
    /// Returns the shadow method with its settings.
    ///
    /// # Errors
    /// There is no such method or setting.
    pub fn spec(&self) -> Result<MethodSpec> {
        [&*self.method, &self.params.replace(' ', ",")].join(":").trim_end_matches(':').parse()
    }

    /// Values that do not depend on times, as texts, each with the name of its column.
    fn untimed(&self) -> [(&'static str, String); 7] {
        let real = |value: Option<f64>| value.map_or_else(String::new, |x| x.to_string());
        let whole = |value: Option<usize>| value.map_or_else(String::new, |n| n.to_string());
        [
            ("status", self.status.name().to_owned()),
            ("ray_err_max", real(self.ray_err_max)),
            ("bound", real(self.bound)),
            ("monotone_violations", whole(self.monotone_violations)),
            ("out_of_range", whole(self.out_of_range)),
            ("non_finite", whole(self.non_finite)),
            ("bytes", whole(self.bytes.map(|bytes| bytes as usize))),
        ]
    }

    /// Whether another row has the same case, shadow method and settings.
    fn is_same_test(&self, other: &Self) -> bool {
        (&self.case, &self.method, &self.params) == (&other.case, &other.method, &other.params)
    }
}

/// Returns the rows of each case that an earlier run finished, in the order of `planned`: the rows of each case without
/// results. The list of a case is empty if a row is missing or its method failed, so that the case is measured again.
///
/// # Errors
/// An earlier row is not planned; the text says which one.
pub fn finished(planned: &[Vec<Row>], earlier: &[Row]) -> std::result::Result<Vec<Vec<Row>>, String> {
    let is_planned = |row: &&Row| planned.iter().flatten().any(|wanted| wanted.is_same_test(row));
    if let Some(row) = earlier.iter().find(|row| !is_planned(row)) {
        let name = [&*row.method, &row.params].join(" ");
        return Err(format!("{} in case {} is among its rows and not requested", name.trim_end(), row.case));
    }
    let of_case = |wanted: &Vec<Row>| {
        let known = |wanted: &Row| {
            let usable = |row: &&Row| row.is_same_test(wanted) && row.status != Status::Failed;
            earlier.iter().find(usable).cloned()
        };
        wanted.iter().map(known).collect::<Option<Vec<_>>>().unwrap_or_default()
    };
    Ok(planned.iter().map(of_case).collect())
}

/// Compares recorded rows with measured ones in the same order, without times and notes. Of another adapter, outcomes and
/// bounds alone are compared.
pub fn compare(recorded: &[Row], measured: &[Row], by: Recorder) -> Verified {
    let mut verified = Verified::default();
    for (before, now) in recorded.iter().zip(measured) {
        let title = format!("{}: {} {}", before.case, before.method, before.params);
        for ((column, recorded), (_, measured)) in before.untimed().into_iter().zip(now.untimed()) {
            // At extreme values, rounding of the adapter decides the others.
            if by == Recorder::OtherAdapter && !["status", "bound"].contains(&column) {
                verified.not_compared += 1;
                continue;
            }
            verified.compare(title.trim_end(), column, [&recorded, &measured], by);
        }
    }
    verified
}

/// Symbol in the stability summary for a shadow method to which a stability case does not apply.
const ABSENT: char = '·';

/// Writes the stability summary in Markdown: a table of cases by shadow methods with one symbol per cell, and all
/// notes below. A method with several settings has a column for each, in the given order.
pub fn markdown(rows: &[Row]) -> String {
    // Settings differ between cases, so the n-th row of a method on a case goes to its n-th column.
    let mut cells: HashMap<(&str, (&str, usize)), Status> = HashMap::new();
    let mut columns: Vec<(&str, usize)> = Vec::new();
    for row in rows {
        let nth = (0..).find(|n| !cells.contains_key(&(&*row.case, (&*row.method, *n)))).unwrap_or(0);
        let column = (&*row.method, nth);
        cells.insert((&row.case, column), row.status);
        if !columns.contains(&column) {
            columns.push(column);
        }
    }
    let heading = |&(method, nth): &(&str, usize)| match nth {
        0 => (method.to_owned(), Align::Middle),
        n => (format!("{method} {}", n + 1), Align::Middle),
    };
    let headings: Vec<_> =
        [("case".to_owned(), Align::Left)].into_iter().chain(columns.iter().map(heading)).collect();
    let line = |case: &str| {
        let glyph = |column: &_| cells.get(&(case, *column)).map_or(ABSENT, |s| s.glyph()).to_string();
        [case.to_owned()].into_iter().chain(columns.iter().map(glyph)).collect()
    };
    let lines: Vec<Vec<String>> = rows.iter().map(|row| row.case.as_str()).unique().map(line).collect();
    let mut out = aligned_table(&headings, &lines);
    let key: Vec<_> = Status::ALL.iter().map(|s| format!("{} {}", s.glyph(), s.name())).collect();
    out += &format!("\n{} · {ABSENT} not concerned\n\n{}\n", key.join(" · "), counted(rows));
    let mut remarks = rows.iter().filter(|r| !r.note.is_empty()).peekable();
    if remarks.peek().is_some() {
        out += "\n| case | method | status | note |\n| --- | --- | --- | --- |\n";
    }
    for Row { case, method, params, status, note, .. } in remarks {
        let method = format!("{method} {params}").trim_end().to_owned();
        out += &table_line([case.clone(), method, status.name().to_owned(), note.clone()]);
    }
    out
}

/// Returns how many rows of the stability table have each outcome, such as `312 rows: 310 ok, 2 bound_exceeded`.
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
        let row = |case: &str, method: &str, status| Row {
            case: case.into(),
            method: method.into(),
            params: "map=64".into(),
            status,
            ..Row::default()
        };
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
    fn rows_survive_the_csv_file_and_complete_cases_are_finished() {
        let text = csv(&rows()).unwrap();
        let read: Vec<Row> = csv::Reader::from_reader(&text[..]).deserialize().map(|r| r.unwrap()).collect();
        assert_eq!((&read, csv(&read).unwrap()), (&rows(), text));
        let planned = |row: &Row| Row {
            status: Status::Ok,
            ray_err_max: None,
            bytes: None,
            note: String::new(),
            ..row.clone()
        };
        let [comb, _, _, stiff] = [0, 1, 2, 3].map(|at| planned(&read[at]));
        let more = Row { method: "osm".into(), ..stiff.clone() };
        let done =
            finished(&[vec![comb.clone()], vec![stiff.clone(), more]], &[read[3].clone(), read[0].clone()]);
        assert_eq!(done.unwrap(), [vec![read[0].clone()], vec![]], "a row of the second case is missing");
        let failed = Row { status: Status::Failed, ..comb.clone() };
        assert_eq!(finished(&[vec![comb.clone()]], &[failed]).unwrap(), [vec![]]);
        let refusal = finished(&[vec![comb]], &[stiff]).unwrap_err();
        assert_eq!(refusal, "dsm map=64 in case epsilon-0 is among its rows and not requested");
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
        assert!(text.contains("| comb | dsm map=64 | nan | lamp: 3 values"));
    }

    #[test]
    fn what_is_no_time_is_compared() {
        let change = |row: &Row| Row { build_ms: Some(1.0), note: "slow".into(), ..row.clone() };
        let again: Vec<Row> = rows().iter().map(change).collect();
        assert_eq!(compare(&rows(), &again, Recorder::Same).differences, []);
        let mut other = again;
        other[0].bytes = Some(12);
        other[3].status = Status::Ok;
        let elsewhere = compare(&rows(), &other, Recorder::OtherAdapter);
        assert_eq!(elsewhere.differences.iter().map(|d| &*d.column).collect::<Vec<_>>(), ["status"]);
        assert_eq!((elsewhere.values, elsewhere.not_compared), (2 * 4, 5 * 4));
        let found = compare(&rows(), &other, Recorder::OtherRevision).differences;
        assert_eq!(found.iter().map(|d| &*d.column).collect::<Vec<_>>(), ["bytes", "status"]);
        assert!(
            found[1].row == "epsilon-0: dsm map=64" && found[1].recorded == "bound_exceeded",
            "{found:?}"
        );
        assert_eq!(rows()[1].spec().unwrap().to_string(), "dsm:epsilon=0.02,map=64");
        assert!(Row { params: String::new(), ..rows()[0].clone() }.spec().is_ok());
        assert!(Row { params: "no=1".into(), ..rows()[0].clone() }.spec().is_err());
    }
}
