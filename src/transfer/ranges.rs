//! Table of the least and the largest extinction over ranges of a transfer function's intervals.

use super::tables::{Interval, intervals};
use super::{TexelMapping, TransferFunction};

/// Relative margin by which stored extremes exceed those of the transfer function: they stay bounds in float32.
const ROUNDING: f64 = 1e-6;

/// Sparse table of a transfer function's extremes: row `k` has the range of extinction over each `2^k` consecutive
/// intervals between control points. Any range of intervals is the union of two entries of one row.
#[derive(Debug, Clone)]
pub struct ExtinctionRanges {
    /// Number of intervals of the transfer function: columns of the table.
    pub columns: usize,
    /// Least and largest extinction (1/mm), row by row. An entry whose range exceeds the last interval ends there.
    pub ranges: Vec<[f32; 2]>,
}

impl ExtinctionRanges {
    /// Computes the table of a transfer function, with the intervals of the device tables for the same mapping.
    pub fn build(tf: &TransferFunction, mapping: TexelMapping) -> Self {
        let range = |interval: &Interval| {
            let rise = interval.slope * (interval.end - interval.start);
            let ends = [interval.amount, interval.amount + rise].map(|a| tf.extinction_of_amount(a.max(0.0)));
            [ends[0].min(ends[1]) * (1.0 - ROUNDING), ends[0].max(ends[1]) * (1.0 + ROUNDING)]
        };
        let mut row: Vec<[f64; 2]> = intervals(tf, mapping).iter().map(range).collect();
        let columns = row.len();
        let mut rows = row.clone();
        for level in 0..columns.ilog2() {
            let next = |i: usize| row[(i + (1 << level)).min(columns - 1)];
            row = (0..columns).map(|i| [row[i][0].min(next(i)[0]), row[i][1].max(next(i)[1])]).collect();
            rows.extend_from_slice(&row);
        }
        Self { columns, ranges: rows.into_iter().map(|range| range.map(|sigma| sigma as f32)).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::presets::PRESETS;
    use crate::transfer::{ControlPoint, Quantity};

    #[test]
    fn two_entries_cover_any_range_of_intervals() {
        let amounts = [0.3, 0.0, 0.7, 0.2, 0.9, 0.1, 0.4, 0.4, 0.05, 0.6, 0.0];
        let points = amounts.iter().enumerate().map(|(i, amount)| ControlPoint {
            value: i as f64,
            amount: *amount,
            color: [1.0; 3],
        });
        let mut tf = PRESETS[0].transfer_function();
        (tf.quantity, tf.points) = (Quantity::Extinction, points.collect());
        let table = ExtinctionRanges::build(&tf, TexelMapping { scale: 1.0, offset: 0.0 });
        // Ten intervals between eleven points, and the constant ones at both ends.
        assert_eq!((table.columns, table.ranges.len()), (12, 4 * 12));
        for first in 1..11 {
            for last in first..11 {
                let level = (last - first + 1usize).ilog2() as usize;
                let [a, b] =
                    [first, last + 1 - (1 << level)].map(|i| table.ranges[level * table.columns + i]);
                let within = &amounts[first - 1..=last];
                let least = within.iter().copied().fold(f64::INFINITY, f64::min);
                let most = within.iter().copied().fold(0.0, f64::max);
                let found = [a[0].min(b[0]), a[1].max(b[1])].map(f64::from);
                assert!(found[0] <= least && found[0] >= least * (1.0 - 2.0 * ROUNDING), "{first}..={last}");
                assert!(found[1] >= most && found[1] <= most * (1.0 + 2.0 * ROUNDING), "{first}..={last}");
            }
        }
    }
}
