//! Precomputed table of the transfer function's breakpoints between two scalar values, for the ray march from the
//! light that builds deep shadow maps (Hadwiger et al. 2006, 3.2).
//!
//! Deviation from the paper: an entry stores the *values* at which visibility bends, not depths. The march can
//! therefore place a node of the transmittance curve exactly between any two samples. The table's resolution decides
//! which nodes exist, but not where they lie. An entry that cannot hold all breakpoints is marked, and the march
//! searches for them.

use super::tables::{FAR, binned_range, breaks, intervals};
use super::{TexelMapping, TransferFunction};
use rayon::prelude::*;

/// Number of value bins along each side of the table of transfer-function breakpoints. The bins span the range
/// between the first and the last breakpoint.
pub const PAIR_BINS: usize = 256;
/// Marks an unused slot in an entry of the table of transfer-function breakpoints.
const NO_NODE: u16 = 0xffff;
/// Marks, in its last slot, an entry of the table of transfer-function breakpoints that cannot store all breakpoints.
pub const MORE_NODES: u16 = 0xfffe;
/// Share of a value bin by which float32 rounding may move a scalar value into the next bin of the table of
/// transfer-function breakpoints.
const BIN_ROUNDING: f64 = 1e-3;

/// Table of the transfer function's breakpoints between any two scalar values. At a breakpoint the transmittance
/// curve of a light ray bends.
#[derive(Debug, Clone)]
pub struct PairTable {
    /// Table of `PAIR_BINS^2` entries, one for each pair of value bins. An entry lists up to four breakpoints between
    /// both values, as indices (u16) of the transfer-function intervals that begin there. The first index is in the
    /// low half of the first word.
    pub nodes: Vec<[u32; 2]>,
    /// Whether some entry of the table of transfer-function breakpoints cannot store all of them, so that the ray
    /// march must search for them.
    pub many_breakpoints: bool,
}

impl PairTable {
    /// Builds the table of breakpoints of a transfer function over the values stored in the volume texture.
    pub fn build(tf: &TransferFunction, mapping: TexelMapping) -> Self {
        let breaks = breaks(&intervals(tf, mapping));
        let nodes = pair_nodes(&breaks);
        let many_breakpoints = nodes.par_iter().any(|n| n[1] >> 16 == u32::from(MORE_NODES));
        Self { nodes, many_breakpoints }
    }

    /// Size of the table of transfer-function breakpoints on the device, bytes.
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
