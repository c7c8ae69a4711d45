//! Division of work among several processes.

use std::ops::Range;

/// Share of the work of several processes: number `index` of `count`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkShare {
    index: u32,
    count: u32,
}

impl WorkShare {
    /// Work of a single process.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Returns share `index` of `count`, counted from 0; `None` if there is no such share.
    pub fn new(index: u32, count: u32) -> Option<Self> {
        (index < count).then_some(Self { index, count })
    }

    /// Whether this share is all of the work.
    pub fn is_whole(self) -> bool {
        self.count == 1
    }

    /// Returns the items of this share, where `weights` is the work of each item. The shares are consecutive ranges that
    /// cover all items, with nearly equal sums of weights.
    pub fn range(self, weights: &[u64]) -> Range<usize> {
        let total = weights.iter().map(|weight| u128::from(*weight)).sum::<u128>().max(1);
        let mut before = 0;
        // An item belongs to the share in which its middle lies.
        let shares: Vec<u128> = weights
            .iter()
            .map(|weight| {
                let middle = 2 * before + u128::from(*weight);
                before += u128::from(*weight);
                (middle * u128::from(self.count) / (2 * total)).min(u128::from(self.count) - 1)
            })
            .collect();
        let first = |share: u32| shares.partition_point(|own| *own < u128::from(share));
        first(self.index)..if self.index + 1 == self.count { weights.len() } else { first(self.index + 1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_all_items_with_even_weights() {
        let mut random = fastrand::Rng::with_seed(4);
        for count in [1, 2, 7, 30] {
            for items in [0, 1, 5, 1000] {
                let weights: Vec<u64> = (0..items).map(|_| random.u64(0..50)).collect();
                let ranges: Vec<_> =
                    (0..count).map(|i| WorkShare::new(i, count).unwrap().range(&weights)).collect();
                assert!(ranges[0].start == 0 && ranges.last().unwrap().end == items);
                assert!(ranges.windows(2).all(|pair| pair[0].end == pair[1].start));
                let sums: Vec<u64> = ranges.iter().map(|range| weights[range.clone()].iter().sum()).collect();
                let mean = sums.iter().sum::<u64>() / u64::from(count);
                assert!(sums.iter().all(|sum| *sum <= mean + 50), "{sums:?}");
            }
        }
        assert_eq!(WorkShare::new(2, 2), None);
        assert!(WorkShare::WHOLE.is_whole() && WorkShare::WHOLE.range(&[0, 0, 0]) == (0..3));
    }
}
