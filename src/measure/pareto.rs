//! Pareto front of the comparison table: shadow methods that no other method beats in both speed and error.

use super::table::Row;

/// Fills the column `pareto` of the comparison table. A row is on the Pareto front unless another row is both faster
/// (greater `fps_moving`) and more accurate (smaller `point_err_rms`). Only rows of the same scene, adapter and
/// picture size compete.
///
/// Both comparisons are strict: a tie in speed or in error removes no row from the front. Rows that lack one of the
/// two values, or hold NaN, get an empty cell and remove no other row.
pub fn mark_pareto<'a>(rows: impl IntoIterator<Item = &'a mut Row>) {
    let mut rows: Vec<&mut Row> = rows.into_iter().collect();
    let point = |row: &Row| {
        let (fps, error) = (row.fps_moving?, row.point_err_rms?);
        (!fps.is_nan() && !error.is_nan()).then_some((fps, error))
    };
    let beaten = |row: &Row, (fps, error): (f64, f64)| {
        let others = rows.iter().filter(|other| other.place() == row.place());
        others.filter_map(|other| point(other)).any(|other| other.0 > fps && other.1 < error)
    };
    let fronts: Vec<_> = rows.iter().map(|row| point(row).map(|p| !beaten(row, p))).collect();
    rows.iter_mut().zip(fronts).for_each(|(row, front)| row.pareto = front);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;

    #[test]
    fn pareto_front_by_hand() {
        // Faster and closer rows: none (80 ms) is fastest, rays closest, dsm 145 and 160 ms between them;
        // osm is as fast as the second dsm and worse than the first.
        let marks: Vec<_> = sample_rows().iter().map(|r| r.pareto).collect();
        assert_eq!(marks, [true, true, true, true, false].map(Some));
    }

    #[test]
    fn pareto_ties_gaps_and_other_scenes() {
        let row = |scene: &str, fps, error| Row {
            scene: scene.into(),
            fps_moving: fps,
            point_err_rms: error,
            ..Row::default()
        };
        let mut rows = [
            row("a", Some(10.0), Some(0.1)),
            row("a", Some(10.0), Some(0.2)), // as fast, worse: not beaten
            row("a", Some(5.0), Some(0.1)),  // as close, slower: not beaten
            row("a", Some(5.0), Some(0.2)),  // beaten by the first
            row("a", Some(10.0), Some(0.1)), // the same as the first
            row("a", None, Some(0.0)),
            row("a", Some(99.0), None),
            row("a", Some(99.0), Some(f64::NAN)),
            row("b", Some(1.0), Some(0.9)), // another scene
        ];
        mark_pareto(&mut rows);
        let marks: Vec<_> = rows.iter().map(|r| r.pareto).collect();
        let (yes, no) = (Some(true), Some(false));
        assert_eq!(marks, [yes, yes, yes, no, yes, None, None, None, yes]);
    }
}
