//! The Pareto front of what a panel shows, and its staircase.

use crate::report::canvas::{Point, Rect};

/// Point of a plot: one row in one panel.
pub struct Datum {
    /// Index of the method among those drawn.
    pub family: usize,
    pub label: String,
    /// Median, smallest and largest cost of the row.
    pub cost: [f64; 3],
    pub error: f64,
}

/// Rows that no other is at once cheaper than and closer than, by the cost and the error shown, cheapest first.
pub fn front(data: &[Datum]) -> Vec<usize> {
    let beaten = |d: &Datum| data.iter().any(|o| o.cost[0] < d.cost[0] && o.error < d.error);
    let mut front: Vec<usize> = (0..data.len()).filter(|&i| !beaten(&data[i])).collect();
    let key = |&i: &usize| (data[i].cost[0], -data[i].error);
    front.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal));
    front
}

/// The border between what some row reaches (above and right) and what none does.
pub fn staircase(frame: Rect, front: &[Point]) -> Vec<Point> {
    let (Some(first), Some(last)) = (front.first(), front.last()) else { return Vec::new() };
    let mut path = vec![Point(first.0, frame.top), *first];
    for pair in front.windows(2) {
        path.extend([Point(pair[1].0, pair[0].1), pair[1]]);
    }
    path.push(Point(frame.right, last.1));
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    fn datum(ms: f64, error: f64) -> Datum {
        Datum { family: 0, label: String::new(), cost: [ms; 3], error }
    }

    #[test]
    fn the_front_runs_from_fast_to_close() {
        let data = [(90.0, 0.1), (80.0, 0.5), (100.0, 0.2), (100.0, 0.05), (2000.0, 0.0), (90.0, 0.3)]
            .map(|(ms, error)| datum(ms, error));
        // The third is beaten by the first; the last is as fast as the first, which it does not lose to.
        assert_eq!(front(&data), [1, 5, 0, 3, 4]);
    }
}
