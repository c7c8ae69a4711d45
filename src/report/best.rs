//! Two questions to a table: which method is best at equal bytes, and which at equal time?
//!
//! The budgets are those of the rows that follow an error bound ([`sets_budgets`]). Within a budget the
//! row with the smallest `point_err_rms` is best, whatever its method; of equally close ones the one that needs
//! less.

use crate::measure::defaults::sets_budgets;
use crate::measure::table::Row;

/// What is held equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// `bytes`, among rows that store anything.
    Bytes,
    /// `build_ms + frame_ms`, among all rows.
    Time,
}

impl Held {
    /// What a row needs of it; nothing where that is not known or the row does not take part.
    pub fn need(self, row: &Row) -> Option<f64> {
        match self {
            // Rows without a structure would win at any size.
            Self::Bytes => row.bytes.filter(|b| *b > 0).map(|b| b as f64),
            Self::Time => row.moving_ms().filter(|ms| ms.is_finite()),
        }
    }
}

/// The best row within the budget of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best<'a> {
    /// Whose need is the budget.
    pub budget_of: &'a Row,
    /// Bytes or milliseconds.
    pub budget: f64,
    /// The closest row within it.
    pub best: &'a Row,
    /// Its `point_err_rms`.
    pub error: f64,
}

/// For each row that sets a budget and has an error, the best row of the same scene, adapter and picture size with no greater
/// need.
pub fn best_within(rows: &[Row], held: Held) -> Vec<Best<'_>> {
    let place = |row: &Row| (row.scene.clone(), row.adapter.clone(), row.width, row.height);
    let entry = |row: &Row| Some((held.need(row)?, row.point_err_rms.filter(|e| !e.is_nan())?));
    let answer = |budget_of: &'_ Row| {
        let (budget, _) = entry(budget_of)?;
        let within = rows.iter().filter(|row| place(row) == place(budget_of)).filter_map(|row| {
            let (need, error) = entry(row)?;
            (need <= budget).then_some((error, need, row))
        });
        within.min_by(|a, b| (a.0, a.1).partial_cmp(&(b.0, b.1)).unwrap_or(std::cmp::Ordering::Equal))
    };
    let budgets = rows.iter().filter(|row| sets_budgets(&row.method));
    budgets
        .filter_map(|budget_of| {
            let (error, _, best) = answer(budget_of)?;
            Some(Best { budget_of, budget: held.need(budget_of)?, best, error })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, params: &str, bytes: u64, ms: f64, error: Option<f64>) -> Row {
        Row {
            scene: "planted".into(),
            method: method.into(),
            params: params.into(),
            bytes: Some(bytes),
            build_ms: Some(0.25 * ms),
            frame_ms: Some(0.75 * ms),
            point_err_rms: error,
            ..Row::default()
        }
    }

    fn planted() -> Vec<Row> {
        vec![
            row("none", "", 0, 10.0, Some(0.5)),
            row("rays", "", 0, 1000.0, Some(0.0)),
            row("dsm", "epsilon=0.06", 100, 40.0, Some(0.03)),
            row("dsm", "epsilon=0.005", 400, 60.0, Some(0.01)),
            row("osm", "layers=8", 100, 30.0, Some(0.02)),
            row("osm", "layers=64", 800, 35.0, Some(0.015)),
            row("dom", "layers=3", 99, 70.0, Some(0.02)),
            row("bom", "layers=3", 50, 61.0, Some(f64::NAN)),
            row("bom", "layers=7", 60, 20.0, None),
        ]
    }

    fn named<'a>(answers: &[Best<'a>]) -> Vec<(&'a str, f64, &'a str, &'a str, f64)> {
        let name = |b: &Best<'a>| (&*b.budget_of.params, b.budget, &*b.best.method, &*b.best.params, b.error);
        answers.iter().map(name).collect()
    }

    #[test]
    fn planted_rows_come_out() {
        let rows = planted();
        // At 100 bytes osm and dom are equally close and dom is smaller; `rays` stores nothing and does not take
        // part.
        assert_eq!(
            named(&best_within(&rows, Held::Bytes)),
            [
                ("epsilon=0.06", 100.0, "dom", "layers=3", 0.02),
                ("epsilon=0.005", 400.0, "dsm", "epsilon=0.005", 0.01)
            ]
        );
        assert_eq!(
            named(&best_within(&rows, Held::Time)),
            [
                ("epsilon=0.06", 40.0, "osm", "layers=64", 0.015),
                ("epsilon=0.005", 60.0, "dsm", "epsilon=0.005", 0.01)
            ]
        );
    }

    #[test]
    fn other_scenes_and_tables_without_budgets() {
        let mut rows = planted();
        rows[6].scene = "another".into();
        assert_eq!(best_within(&rows, Held::Bytes)[0].best.method, "osm");
        rows.retain(|r| r.method != "dsm");
        assert_eq!(best_within(&rows, Held::Time), []);
        assert_eq!(best_within(&[row("dsm", "", 1, 1.0, None)], Held::Bytes), []);
    }
}
