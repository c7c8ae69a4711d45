//! Comparison of an archived table of claims with a new measurement. Times, and verdicts on them, are not compared.

use super::claim::{Claim, Row, figure_text, figures_text};
use super::run::is_row_of;
use crate::report::verify::{Recorder, Verified};

/// Claims that have a row in an archived table, and something that does not depend on times.
pub fn comparable(claims: Vec<Claim>, recorded: &[Row]) -> Vec<Claim> {
    let is_recorded = |claim: &Claim| recorded.iter().any(|row| is_row_of(row, claim));
    claims.into_iter().filter(|claim| is_recorded(claim) && !claim.is_about_times()).collect()
}

/// Compares recorded rows on `claims` with measured ones: the verdict, and each figure with the three digits of the table.
pub fn compare(claims: &[Claim], recorded: &[Row], measured: &[Row], by: Recorder) -> Verified {
    let mut verified = Verified::default();
    for row in recorded {
        let Some(claim) = claims.iter().find(|claim| is_row_of(row, claim)) else { continue };
        let title = format!("{}, {}, {}: {}", row.paper, row.place, row.scene, row.claim);
        let again = measured.iter().find(|again| is_row_of(again, claim) && again.scene == row.scene);
        let Some(again) = again else {
            verified.compare(&title, "measured", [&figures_text(&row.measured), ""], by);
            continue;
        };
        if !claim.has_timed_verdict() {
            verified.compare(&title, "holds", [row.holds.word(), again.holds.word()], by);
        }
        for name in claim.untimed_figures() {
            let text = |row: &Row| {
                let figure = row.measured.iter().find(|(own, _)| own == name);
                figure.map_or_else(String::new, |(_, value)| figure_text(*value))
            };
            verified.compare(&title, name, [&text(row), &text(again)], by);
        }
    }
    verified
}

#[cfg(test)]
mod tests {
    use super::super::all;
    use super::*;
    use crate::replication::claims::rules::Holds;

    /// Row on a claim with the same value of every figure.
    fn row(claim: &Claim, value: f64) -> Row {
        let measured = claim.figures.iter().map(|(name, _)| (name.clone(), value)).collect();
        let Claim { paper, place, claim, claimed, .. } = claim;
        let [paper, place, claim, claimed] = [paper, place, claim, claimed].map(String::clone);
        Row { paper, place, claim, claimed, measured, holds: Holds::Yes, ..Row::default() }
    }

    #[test]
    fn times_and_verdicts_on_them_are_not_compared() {
        let claims = all().unwrap();
        let rows: Vec<Row> = claims.iter().map(|claim| row(claim, 0.25)).collect();
        let claims = comparable(claims, &rows);
        assert!(claims.len() > 60 && claims.len() < rows.len(), "{} of {}", claims.len(), rows.len());
        let same = compare(&claims, &rows, &rows, Recorder::Same);
        assert!(same.values > 200 && same.differences.is_empty(), "{}", same.values);
        let other: Vec<Row> = claims.iter().map(|claim| row(claim, 0.5)).collect();
        let changed = compare(&claims, &rows, &other, Recorder::OtherAdapter).differences;
        assert!(changed.iter().all(|d| !d.column.ends_with("_ms") && !d.column.contains("[ms]")));
        assert!(changed.iter().any(|d| d.column.contains("3 layers / 15")));
        // Seven rows of the 5 taps: their ratio of build times is a figure beside errors.
        let taps = claims.iter().find(|claim| claim.claim.starts_with("5 taps a texel")).unwrap();
        assert!(!taps.has_timed_verdict() && !taps.untimed_figures().any(|name| name == "build_ms"));
        assert_eq!(taps.untimed_figures().count(), 5);
    }

    #[test]
    fn a_changed_digit_and_a_missing_row_are_found() {
        let claims = all().unwrap();
        let claim = claims.iter().position(|claim| claim.claim.starts_with("Usually 3 layers")).unwrap();
        let claims = &claims[claim..=claim];
        let recorded = [row(&claims[0], 4.791)];
        assert_eq!(compare(claims, &recorded, &[row(&claims[0], 4.7899)], Recorder::Same).differences, []);
        let found = compare(claims, &recorded, &[row(&claims[0], 4.78)], Recorder::Same).differences;
        assert!(found.len() == claims[0].figures.len() && found[0].recorded == "4.79", "{found:?}");
        let mut other = row(&claims[0], 4.79);
        other.holds = Holds::No;
        assert_eq!(compare(claims, &recorded, &[other], Recorder::Same).differences[0].column, "holds");
        assert_eq!(compare(claims, &recorded, &[], Recorder::Same).differences.len(), 1);
    }
}
