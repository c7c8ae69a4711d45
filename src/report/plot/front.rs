//! Pareto front of the points in a plot of error against cost, drawn as a staircase line.

use crate::report::canvas::{Point, Rect};

/// Point of a plot of error against cost: one row of the comparison table.
pub struct Datum {
    /// Index of the plot point's shadow method in the list of plotted methods.
    pub family: usize,
    pub label: String,
    /// Median, smallest and largest cost of a comparison-table row in the plot: time in ms or memory in MiB.
    pub cost: [f64; 3],
    pub error: f64,
    /// Ends of the interval of the error; equal to the error where it has none.
    pub ends: [f64; 2],
}

/// Indices of the plot points on the Pareto front, cheapest first. No other point is both cheaper and more accurate
/// than one of them.
pub fn front(data: &[Datum]) -> Vec<usize> {
    let beaten = |d: &Datum| data.iter().any(|o| o.cost[0] < d.cost[0] && o.error < d.error);
    let mut front: Vec<usize> = (0..data.len()).filter(|&i| !beaten(&data[i])).collect();
    let key = |&i: &usize| (data[i].cost[0], -data[i].error);
    front.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal));
    front
}

/// Staircase line along the Pareto front of a plot; every point of the plot lies on the line, above it or to its
/// right.
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
        Datum { family: 0, label: String::new(), cost: [ms; 3], error, ends: [error; 2] }
    }

    #[test]
    fn the_front_runs_from_fast_to_close() {
        let data = [(90.0, 0.1), (80.0, 0.5), (100.0, 0.2), (100.0, 0.05), (2000.0, 0.0), (90.0, 0.3)]
            .map(|(ms, error)| datum(ms, error));
        // The third is beaten by the first; the last is as fast as the first, which it does not lose to.
        assert_eq!(front(&data), [1, 5, 0, 3, 4]);
    }
}
