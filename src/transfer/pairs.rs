//! Precomputed table of the transfer function's breakpoints between two values, for the light march that builds deep
//! shadow maps (Hadwiger et al. 2006, 3.2).
//!
//! Deviation: an entry stores the *value* at which visibility bends, not a depth, so that the march can place the
//! node exactly between any two samples of the pair's bins. The table's resolution decides which nodes exist, never
//! where they lie. No breakpoint is lost: an entry that cannot hold all of them is marked, and the march searches.

use super::tables::{FAR, binned_range, breaks, intervals};
use super::{TexelMapping, TransferFunction};
use rayon::prelude::*;

/// Number of bins along each side of the breakpoint table. They span the range between the first and the last
/// breakpoint.
pub const PAIR_BINS: usize = 256;
/// Marks an unused slot in an entry of the breakpoint table.
const NO_NODE: u16 = 0xffff;
/// Marks, in its last slot, an entry of the breakpoint table that cannot store all breakpoints.
pub const MORE_NODES: u16 = 0xfffe;
/// Fraction of a bin by which float32 rounding may move a value into the next bin.
const BIN_ROUNDING: f64 = 1e-3;

/// Table of the transfer function's breakpoints between each two values, where a ray's visibility curve bends.
#[derive(Debug, Clone)]
pub struct PairTable {
    /// Table of `PAIR_BINS^2` entries, each with up to four indices of transfer-function intervals (u16, the first in
    /// the low half of the first word). Each index is a breakpoint between the two values.
    pub nodes: Vec<[u32; 2]>,
    /// Whether some entry of the breakpoint table cannot store all breakpoints, so that the light march must search
    /// for them.
    pub many_breakpoints: bool,
}

impl PairTable {
    /// Builds the breakpoint table of a transfer function over texel values.
    pub fn build(tf: &TransferFunction, mapping: TexelMapping) -> Self {
        let breaks = breaks(&intervals(tf, mapping));
        let nodes = pair_nodes(&breaks);
        let many_breakpoints = nodes.par_iter().any(|n| n[1] >> 16 == u32::from(MORE_NODES));
        Self { nodes, many_breakpoints }
    }

    /// Size of the breakpoint table on the device, bytes.
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.nodes[..]) as u64
    }
}

fn pair_nodes(breaks: &[f64]) -> Vec<[u32; 2]> {
    let (origin, width) = binned_range(breaks);
    let bin = width / PAIR_BINS as f64;
    // Breakpoints between the lower edge of one bin and the upper edge of another; the outermost bins are unbounded.
    let below = |b: usize| {
        let low = if b == 0 { -FAR } else { origin + (b as f64 - BIN_ROUNDING) * bin };
        breaks.partition_point(|s| *s < low)
    };
    let up_to = |b: usize| {
        let high = if b + 1 == PAIR_BINS { FAR } else { origin + (b as f64 + 1.0 + BIN_ROUNDING) * bin };
        breaks.partition_point(|s| *s <= high)
    };
    let edges: Vec<_> = (0..PAIR_BINS).map(|b| (below(b), up_to(b))).collect();
    let entry = |from: usize, to: usize| {
        let inside = edges[from.min(to)].0..edges[from.max(to)].1;
        let mut packed = [NO_NODE; 4];
        // Within one bin the ray may run in either direction, so that several breakpoints have no order.
        if inside.len() > 4 || from == to && inside.len() > 1 {
            packed[3] = MORE_NODES;
        } else {
            // Breakpoint i is where interval i + 1 starts.
            let node = |i: usize| (i + 1).min(usize::from(MORE_NODES) - 1) as u16;
            packed.iter_mut().zip(inside).for_each(|(slot, i)| *slot = node(i));
            if from > to {
                let count = packed.iter().filter(|n| **n != NO_NODE).count();
                packed[..count].reverse();
            }
        }
        [0, 2].map(|k| u32::from(packed[k]) | u32::from(packed[k + 1]) << 16)
    };
    (0..PAIR_BINS * PAIR_BINS)
        .into_par_iter()
        .with_min_len(PAIR_BINS)
        .map(|p| entry(p / PAIR_BINS, p % PAIR_BINS))
        .collect()
}
