//! Tables made from a transfer function for the device, over texel values (what the volume texture holds).
//!
//! * `intervals`: the function itself, piecewise linear, for exact evaluation.
//! * `integrals`: extinction, and extinction times colour, integrated over the value (pre-integration, Engel et al. 2001
//!   as cited by Hadwiger et al. 2006, 3.2): differences of these never miss a peak between two samples.
//! * `pair_nodes`: the pre-compressed visibility table (Hadwiger et al. 2006, 3.2). Deviation: a node is kept as the
//!   *value* at which visibility bends, not as a depth, so that the march can place it exactly between any two samples of
//!   the pair's bins; the table's resolution decides which nodes there are, never where they lie.

use super::{Quantity, TransferFunction};
use rayon::prelude::*;

/// Bins of the value axis for finding an interval.
pub const VALUE_BINS: usize = 1024;
/// Bins of the integrals.
pub const TABLE_BINS: usize = 4096;
/// Intervals that the device holds; a transfer function may have two points fewer.
pub const MAX_INTERVALS: usize = 1024;
/// Bins a side of the pre-compressed table.
pub const PAIR_BINS: usize = 256;
/// "No node" in `pair_nodes`.
pub const NO_NODE: u16 = 0xffff;
/// "More nodes than fit" in the last place of an entry.
pub const MORE_NODES: u16 = 0xfffe;
/// Stands for infinity on the device, which has none.
const FAR: f64 = 1e30;
/// A breakpoint that bends the optical depth of a whole segment by less than this is left out of the table.
const BEND_TOLERANCE: f64 = 1e-5;

/// How texel values relate to the volume's scaled values: `value = texel * scale + offset`, `scale > 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelMapping {
    pub scale: f64,
    pub offset: f64,
}

impl TexelMapping {
    pub fn value_from_texel(&self, texel: f64) -> f64 {
        texel * self.scale + self.offset
    }

    pub fn texel_from_value(&self, value: f64) -> f64 {
        (value - self.offset) / self.scale
    }
}

/// The tables; layouts are those of `shaders/common/transfer.wgsl`.
#[derive(Debug, Clone)]
pub struct TransferTables {
    /// `[start, amount, slope, end]` by ascending value; the first is everything below the first point.
    pub intervals: Vec<[f32; 4]>,
    /// Interval at the lower end of each of [`VALUE_BINS`] bins.
    pub interval_of_bin: Vec<u32>,
    /// `[extinction * rgb, extinction]` integrated from the lowest texel value to each of `TABLE_BINS + 1` bin edges.
    pub integrals: Vec<[f32; 4]>,
    /// `PAIR_BINS^2` entries of four interval indices (u16, first in the low half of the first word).
    pub pair_nodes: Vec<[u32; 2]>,
    /// Some pair has more breakpoints than an entry holds: the march then integrates over the value there.
    pub many_breakpoints: bool,
    /// Texel values `<= first_value` and `>= last_value` have no extinction.
    pub first_value: f32,
    pub last_value: f32,
    pub bin_origin: f32,
    pub bins_per_value: f32,
    pub table_origin: f32,
    pub table_per_value: f32,
    /// 1/mm where opacity is given, 0 where extinction is.
    pub inv_reference_length: f32,
}

struct Interval {
    start: f64,
    end: f64,
    amount: f64,
    slope: f64,
}

impl TransferTables {
    /// Tables for texel values in `texel_range`; `segment_mm` is the longest stretch of ray inside one cell.
    pub fn build(
        tf: &TransferFunction,
        mapping: TexelMapping,
        texel_range: [f64; 2],
        segment_mm: f64,
    ) -> Self {
        let intervals = intervals(tf, mapping);
        let breaks = intervals.iter().skip(1).map(|i| i.start).collect::<Vec<_>>();
        let (first, last) = (breaks.first().copied().unwrap_or(0.0), breaks.last().copied().unwrap_or(0.0));
        let width = if last > first { (last - first) * (1.0 + 1e-6) } else { 1.0 };
        let bin = width / VALUE_BINS as f64;
        let interval_of_bin = (0..VALUE_BINS)
            .map(|b| {
                // A little below the edge: a value that rounds into this bin from below must not skip its interval.
                let edge = first + (b as f64 - 1e-3) * bin;
                breaks.partition_point(|s| *s <= edge) as u32
            })
            .collect();
        let [lo, hi] = texel_range;
        let table_width = if hi > lo { hi - lo } else { 1.0 };
        let extinction = |texel: f64| tf.extinction(mapping.value_from_texel(texel));
        let (first_value, last_value) = extinct_range(tf, mapping);
        let bends = bends(tf, &intervals);
        let pair_nodes = pair_nodes(&extinction, &breaks, &bends, first, width, segment_mm);
        Self {
            interval_of_bin,
            integrals: integrals(tf, mapping, &breaks, lo, table_width),
            many_breakpoints: pair_nodes.par_iter().any(|n| n[1] >> 16 == u32::from(MORE_NODES)),
            pair_nodes,
            first_value,
            last_value,
            bin_origin: first as f32,
            bins_per_value: (1.0 / bin) as f32,
            table_origin: lo as f32,
            table_per_value: (TABLE_BINS as f64 / table_width) as f32,
            inv_reference_length: match tf.quantity {
                Quantity::Opacity => (1.0 / tf.reference_length_mm) as f32,
                Quantity::Extinction => 0.0,
            },
            intervals: intervals
                .iter()
                .map(|i| [i.start as f32, i.amount as f32, i.slope as f32, i.end as f32])
                .collect(),
        }
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.intervals[..])
            + size_of_val(&self.interval_of_bin[..])
            + size_of_val(&self.integrals[..])
            + size_of_val(&self.pair_nodes[..])) as u64
    }
}

fn intervals(tf: &TransferFunction, mapping: TexelMapping) -> Vec<Interval> {
    let texel = |i: usize| mapping.texel_from_value(tf.points[i].value);
    let amount = |i: usize| tf.points[i].amount;
    let n = tf.points.len();
    let constant = |start, end, amount| Interval { start, end, amount, slope: 0.0 };
    let mut list = vec![constant(texel(0), texel(0), amount(0))];
    for i in 0..n - 1 {
        let (a, b) = (texel(i), texel(i + 1));
        // A jump has no interval of its own; points closer than float32 can tell are one.
        if (b as f32) > (a as f32) {
            list.push(Interval {
                start: a,
                end: b,
                amount: amount(i),
                slope: (amount(i + 1) - amount(i)) / (b - a),
            });
        }
    }
    list.push(constant(texel(n - 1), FAR, amount(n - 1)));
    // The first interval ends where the second starts.
    list[0].end = list[1].start;
    list
}

/// Texel values outside of which there is no extinction: `<= first` and `>= last`.
fn extinct_range(tf: &TransferFunction, mapping: TexelMapping) -> (f32, f32) {
    let n = tf.points.len();
    let positive = |i: usize| tf.points[i].amount > 0.0;
    let texel = |i: usize| mapping.texel_from_value(tf.points[i].value) as f32;
    let first = match (0..n).find(|i| positive(*i)) {
        None => FAR as f32,
        Some(0) => -FAR as f32,
        // A jump holds from its value on, a ramp starts just above its foot.
        Some(i) if texel(i - 1) < texel(i) => texel(i - 1),
        Some(i) => texel(i).next_down(),
    };
    let last = match (0..n).rev().find(|i| positive(*i)) {
        None => -FAR as f32,
        Some(i) if i == n - 1 => FAR as f32,
        Some(i) => texel(i + 1),
    };
    (first, last)
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

fn integrals(
    tf: &TransferFunction,
    mapping: TexelMapping,
    breaks: &[f64],
    origin: f64,
    width: f64,
) -> Vec<[f32; 4]> {
    // Gauss-Legendre, 4 points: bins are narrow and pieces between breakpoints smooth.
    const NODES: [(f64, f64); 4] = [
        (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
        (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
        (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
        (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    ];
    let edge = |i: usize| origin + width * i as f64 / TABLE_BINS as f64;
    let bin = |i: usize| {
        let (a, b) = (edge(i), edge(i + 1));
        let inside = breaks.iter().copied().filter(|s| *s > a && *s < b);
        let mut sum = [0.0; 4];
        let mut from = a;
        for to in inside.chain([b]) {
            let (mid, half) = (0.5 * (from + to), 0.5 * (to - from));
            for (x, w) in NODES {
                let value = mapping.value_from_texel(mid + half * x);
                let sigma = tf.extinction(value) * w * half;
                let color = tf.color(value);
                (0..3).for_each(|c| sum[c] += sigma * color[c]);
                sum[3] += sigma;
            }
            from = to;
        }
        sum
    };
    let bins = (0..TABLE_BINS).into_par_iter().map(bin).collect::<Vec<_>>();
    let mut total = [0.0f64; 4];
    let mut list = vec![[0.0f32; 4]];
    for b in bins {
        (0..4).for_each(|c| total[c] += b[c]);
        list.push(total.map(|t| t as f32));
    }
    list
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
