//! Histogram of values that are not negative, in bins of equal relative width, for percentiles of many values.

use std::collections::BTreeMap;

/// Number of low bits of a float32 that all values of a bin share with its upper end: bins are 2^-7 wide, relative to
/// their value.
const BIN_BITS: u32 = 16;

/// Counts of values that are not negative.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Histogram {
    /// Number of values in each bin, by the high bits of the values as float32.
    counts: BTreeMap<u32, u64>,
}

impl Histogram {
    /// Adds a value; NaN counts as infinite.
    pub fn add(&mut self, value: f64) {
        let value = if value.is_nan() { f32::INFINITY } else { value.max(0.0) as f32 };
        *self.counts.entry(value.to_bits() >> BIN_BITS).or_default() += 1;
    }

    /// Returns the counts of two histograms together.
    pub fn merge(mut self, other: &Self) -> Self {
        for (bin, count) in &other.counts {
            *self.counts.entry(*bin).or_default() += count;
        }
        self
    }

    /// Returns the smallest upper end of a bin up to which at least `fraction` of the values lie; `None` without values.
    pub fn percentile(&self, fraction: f64) -> Option<f64> {
        let total: u64 = self.counts.values().sum();
        let needed = (fraction * total as f64).ceil() as u64;
        let mut before = 0;
        let bin = self.counts.iter().find(|(_, count)| {
            before += **count;
            before >= needed
        });
        let upper =
            |bin: u32| if bin == f32::INFINITY.to_bits() >> BIN_BITS { f32::INFINITY } else { end_of(bin) };
        bin.map(|(bin, _)| f64::from(upper(*bin)))
    }
}

/// Returns the upper end of a bin of finite values. The bin of 0 ends at 0.
fn end_of(bin: u32) -> f32 {
    if bin == 0 { 0.0 } else { f32::from_bits((bin << BIN_BITS) | ((1 << BIN_BITS) - 1)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_rounded_up_by_one_percent_at_most() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.percentile(0.5), None);
        (1..=1000).for_each(|i| histogram.add(f64::from(i) * 1e-4));
        for fraction in [0.001, 0.5, 0.99, 0.999, 1.0] {
            let (found, exact) = (histogram.percentile(fraction).unwrap(), fraction * 0.1);
            assert!((0.999_999..=1.01).contains(&(found / exact)), "{fraction}: {found}");
        }
    }

    #[test]
    fn parts_merge_to_the_whole() {
        let of = |values: &[f64]| {
            let mut histogram = Histogram::default();
            values.iter().for_each(|value| histogram.add(*value));
            histogram
        };
        let (a, b) = ([0.0, 0.3, 0.3, 1e-9], [0.25, f64::NAN]);
        let whole = of(&[0.0, 0.3, 0.3, 1e-9, 0.25, f64::NAN]);
        assert_eq!(of(&a).merge(&of(&b)), whole);
        assert_eq!(whole.percentile(1.0), Some(f64::INFINITY));
        assert_eq!(whole.percentile(0.1), Some(0.0));
    }
}
