//! The pre-compressed table, which the light march finds breakpoints through (Hadwiger et al. 2006, 3.2).
//!
//! Deviation: a node is kept as the *value* at which visibility bends, not as a depth, so that the march can place it
//! exactly between any two samples of the pair's bins; the table's resolution decides which nodes there are, never where
//! they lie.

use super::tables::{FAR, Interval, binned_range, breaks, intervals};
use super::{TexelMapping, TransferFunction};
use rayon::prelude::*;

/// Bins a side of the table, over the same range of values as the bins of the intervals.
pub const PAIR_BINS: usize = 256;
/// "No node" in an entry.
pub const NO_NODE: u16 = 0xffff;
/// "More nodes than fit" in the last place of an entry.
pub const MORE_NODES: u16 = 0xfffe;
/// A breakpoint that bends the optical depth of a whole segment by less than this is left out of the table.
const BEND_TOLERANCE: f64 = 1e-5;

/// Where visibility bends between any two values.
#[derive(Debug, Clone)]
pub struct PairTable {
    /// `PAIR_BINS^2` entries of four interval indices (u16, first in the low half of the first word).
    pub nodes: Vec<[u32; 2]>,
    /// Some pair has more breakpoints than an entry holds: the march then searches for the next one.
    pub many_breakpoints: bool,
}

impl PairTable {
    /// The table; `segment_mm` is the longest stretch of ray inside one cell.
    pub fn build(tf: &TransferFunction, mapping: TexelMapping, segment_mm: f64) -> Self {
        let intervals = intervals(tf, mapping);
        let breaks = breaks(&intervals);
        let (first, width) = binned_range(&breaks);
        let extinction = |texel: f64| tf.extinction(mapping.value_from_texel(texel));
        let bends = bends(tf, &intervals);
        let nodes = pair_nodes(&extinction, &breaks, &bends, first, width, segment_mm);
        let many_breakpoints = nodes.par_iter().any(|n| n[1] >> 16 == u32::from(MORE_NODES));
        Self { nodes, many_breakpoints }
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.nodes[..]) as u64
    }
}

/// How much extinction bends at each breakpoint: the jump, and the change of slope, 1/mm and 1/mm per texel value.
fn bends(tf: &TransferFunction, intervals: &[Interval]) -> Vec<(f64, f64)> {
    intervals
        .windows(2)
        .map(|w| {
            let sigma = |i: &Interval, at: f64| {
                tf.extinction_of_amount((i.amount + i.slope * (at - i.start)).max(0.0))
            };
            let at = w[1].start;
            let before = if w[0].slope == 0.0 { sigma(&w[0], w[0].start) } else { sigma(&w[0], at) };
            let slope = |i: &Interval| {
                let span = i.end - i.start;
                if i.slope == 0.0 || span <= 0.0 { 0.0 } else { (sigma(i, i.end) - sigma(i, i.start)) / span }
            };
            ((sigma(&w[1], at) - before).abs(), (slope(&w[1]) - slope(&w[0])).abs())
        })
        .collect()
}

fn pair_nodes(
    extinction: &(impl Fn(f64) -> f64 + Sync),
    breaks: &[f64],
    bends: &[(f64, f64)],
    origin: f64,
    width: f64,
    segment_mm: f64,
) -> Vec<[u32; 2]> {
    let bin = width / PAIR_BINS as f64;
    let entry = |from: usize, to: usize| {
        let (low_bin, high_bin) = (from.min(to), from.max(to));
        // The widest pair of values that falls into these bins; the outermost bins reach to infinity.
        let low = if low_bin == 0 { -FAR } else { origin + (low_bin as f64 - 1e-3) * bin };
        let high =
            if high_bin + 1 == PAIR_BINS { FAR } else { origin + (high_bin as f64 + 1.0 + 1e-3) * bin };
        let inside = breaks.partition_point(|s| *s < low)..breaks.partition_point(|s| *s <= high);
        let span = (high.min(origin + width) - low.max(origin)).max(bin);
        // Optical depth by which a segment of the pair would be wrong without the node.
        let mut nodes = inside
            .map(|i| (i, (bends[i].0 + bends[i].1 * span / 8.0) * segment_mm))
            .filter(|(_, bend)| *bend > BEND_TOLERANCE)
            .collect::<Vec<_>>();
        let mut more = from == to && nodes.len() > 1;
        if more {
            // Both directions share the bin, and so no order would be right.
            nodes.clear();
        }
        if nodes.len() > 4 {
            more = true;
            // What bends most as seen from the start of the segment: the light that is left weighs it.
            let start = if from < to { low.max(origin) } else { high.min(origin + width) };
            let per_value = segment_mm / span;
            let left = |i: usize| {
                let mid = 0.5 * (start + breaks[i]);
                (-extinction(mid) * (breaks[i] - start).abs() * per_value).exp()
            };
            nodes.sort_by(|a, b| (b.1 * left(b.0)).total_cmp(&(a.1 * left(a.0))));
            nodes.truncate(3);
        }
        nodes.sort_by_key(|n| n.0);
        if from > to {
            nodes.reverse();
        }
        let mut packed = [NO_NODE; 4];
        for (slot, (i, _)) in packed.iter_mut().zip(&nodes) {
            // Breakpoint i is where interval i + 1 starts.
            *slot = (i + 1).min(usize::from(MORE_NODES) - 1) as u16;
        }
        if more {
            packed[3] = MORE_NODES;
        }
        [0, 2].map(|k| u32::from(packed[k]) | u32::from(packed[k + 1]) << 16)
    };
    (0..PAIR_BINS * PAIR_BINS)
        .into_par_iter()
        .with_min_len(PAIR_BINS)
        .map(|p| entry(p / PAIR_BINS, p % PAIR_BINS))
        .collect()
}
