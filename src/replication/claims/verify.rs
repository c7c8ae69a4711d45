//! Comparison of an archived table of claims with a new measurement. Times, and verdicts on them, are not compared.

use super::claim::{Claim, Figure, Row, figure_text, figures_text};
use super::run::is_row_of;
use crate::report::verify::{Recorder, Verified};

/// Selects the claims that have a row in an archived table, and a value that does not depend on times.
pub fn comparable(claims: Vec<Claim>, recorded: &[Row]) -> Vec<Claim> {
    let is_recorded = |claim: &Claim| recorded.iter().any(|row| is_row_of(row, claim));
    claims.into_iter().filter(|claim| is_recorded(claim) && !claim.depends_on_times_only()).collect()
}

/// Compares recorded rows on `claims` with measured ones: the verdict, and each figure with the three digits of the table.
/// Rows of other claims, and of claims that were not tested, are not compared.
pub fn compare(claims: &[Claim], recorded: &[Row], measured: &[Row], by: Recorder) -> Verified {
    let mut verified = Verified::default();
    for row in recorded.iter().filter(|row| !row.scene.is_empty()) {
        let Some(claim) = claims.iter().find(|claim| is_row_of(row, claim)) else {
            verified.not_compared += 1 + row.measured.len();
            continue;
        };
        let title = format!("{}, {}, {}: {}", row.paper, row.place, row.scene, row.claim);
        let again = measured.iter().find(|again| is_row_of(again, claim) && again.scene == row.scene);
        let names = |row: &Row| row.measured.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        let Some(again) = again.filter(|again| names(again) == names(row)) else {
            let now = again.map_or_else(String::new, |again| figures_text(&again.measured));
            verified.compare(&title, "measured", [&figures_text(&row.measured), &now], by);
            continue;
        };
        if claim.has_timed_verdict() {
            verified.not_compared += 1;
        } else {
            verified.compare(&title, "holds", [row.holds.word(), again.holds.word()], by);
        }
        for ((before, now), timed) in row.measured.iter().zip(&again.measured).zip(claim.timed_figures()) {
            if timed {
                verified.not_compared += 1;
            } else {
                compare_figure(&mut verified, &title, [before, now], by);
            }
        }
    }
    verified
}

/// Compares two figures as texts of three digits. If the table was not measured by this program on this adapter, one unit
/// of the last digit is allowed: a small difference can change the rounding.
fn compare_figure(verified: &mut Verified, title: &str, [before, now]: [&Figure; 2], by: Recorder) {
    let unit = 10_f64.powf(before.1.abs().log10().floor() - 2.0);
    let is_rounding = by != Recorder::Same && unit.is_finite() && (before.1 - now.1).abs() <= 1.01 * unit;
    let [recorded, measured] = [before, now].map(|(_, value)| figure_text(*value));
    let measured = if is_rounding { recorded.clone() } else { measured };
    verified.compare(title, &before.0, [&recorded, &measured], by);
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
        Row {
            paper,
            place,
            claim,
            claimed,
            measured,
            scene: "fur".into(),
            holds: Holds::Yes,
            ..Row::default()
        }
    }

    #[test]
    fn times_and_verdicts_on_them_are_not_compared() {
        let claims = all().unwrap();
        let rows: Vec<Row> = claims.iter().map(|claim| row(claim, 0.25)).collect();
        let claims = comparable(claims, &rows);
        assert!(claims.len() > 60 && claims.len() < rows.len(), "{} of {}", claims.len(), rows.len());
        let same = compare(&claims, &rows, &rows, Recorder::Same);
        assert!(same.values > 200 && same.differences.is_empty(), "{}", same.values);
        assert!(same.not_compared > 50, "{}", same.not_compared);
        let other: Vec<Row> = claims.iter().map(|claim| row(claim, 0.5)).collect();
        let changed = compare(&claims, &rows, &other, Recorder::OtherAdapter).differences;
        assert!(changed.iter().all(|d| !d.column.ends_with("_ms") && !d.column.contains("[ms]")));
        assert!(changed.iter().any(|d| d.column.contains("3 layers / 15")));
        // Of the 5 taps, a ratio of build times is a figure beside errors.
        let taps = claims.iter().find(|claim| claim.claim.starts_with("5 taps a texel")).unwrap();
        assert!(!taps.has_timed_verdict());
        assert_eq!(taps.timed_figures().collect::<Vec<_>>(), [false, false, true, false, false, false]);
    }

    #[test]
    fn a_changed_digit_and_a_missing_row_are_found() {
        let claims = all().unwrap();
        let claim = claims.iter().position(|claim| claim.claim.starts_with("Usually 3 layers")).unwrap();
        let claims = &claims[claim..=claim];
        let recorded = [row(&claims[0], 4.791)];
        assert_eq!(compare(claims, &recorded, &[row(&claims[0], 4.7899)], Recorder::Same).differences, []);
        let nearly = [row(&claims[0], 4.801)];
        assert_eq!(compare(claims, &recorded, &nearly, Recorder::OtherRevision).differences, []);
        assert_eq!(compare(claims, &recorded, &nearly, Recorder::Same).differences.len(), 3);
        let found = compare(claims, &recorded, &[row(&claims[0], 4.78)], Recorder::Same).differences;
        assert!(found.len() == claims[0].figures.len() && found[0].recorded == "4.79", "{found:?}");
        let mut other = row(&claims[0], 4.79);
        other.holds = Holds::No;
        assert_eq!(compare(claims, &recorded, &[other], Recorder::Same).differences[0].column, "holds");
        assert_eq!(compare(claims, &recorded, &[], Recorder::Same).differences.len(), 1);
    }
}
