//! Device tables of a transfer function over texel values, the numbers stored in the volume texture.
//!
//! * `intervals`: the linear intervals of the transfer function, for exact evaluation.
//! * `integrals`: extinction, and extinction times colour, integrated over the texel value (pre-integration, Engel et
//!   al. 2001 as cited by Hadwiger et al. 2006, 3.2). Differences of these integrals never miss a peak between two
//!   samples.

use super::{Quantity, TransferFunction};
use rayon::prelude::*;

/// Number of bins of the texel values in the device table with which the transfer-function interval of a texel value
/// is found.
pub const VALUE_BINS: usize = 1024;
/// Number of bins of the device table of extinction and colour that are integrated over the texel value.
pub const TABLE_BINS: usize = 4096;
/// Largest number of linear intervals of a transfer function on the device. A function of `n` control points has at
/// most `n + 1` intervals.
pub const MAX_INTERVALS: usize = 1024;
/// Large finite number that replaces infinity in the device tables of a transfer function.
pub(super) const FAR: f64 = 1e30;

/// Linear mapping from texel values to the volume's scaled values: `value = texel * scale + offset`, `scale > 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelMapping {
    /// Change of the volume's scaled value when the texel value increases by 1.
    pub scale: f64,
    /// Scaled value of the volume at texel value 0.
    pub offset: f64,
}

impl TexelMapping {
    /// Converts a texel value to the volume's scaled value.
    pub fn value_from_texel(&self, texel: f64) -> f64 {
        texel * self.scale + self.offset
    }

    /// Converts a scaled value of the volume to its texel value.
    pub fn texel_from_value(&self, value: f64) -> f64 {
        (value - self.offset) / self.scale
    }
}

/// Device tables of a transfer function, laid out for the shader `shaders/field/transfer.wgsl`.
#[derive(Debug, Clone)]
pub struct TransferTables {
    /// Linear intervals of the transfer function by ascending texel value:
    /// `[start, amount at start, slope, 1 - amount]`, where the amount is opacity or extinction. The first interval
    /// covers all values below the second. The logarithm of a transmittance needs all digits of `1 - amount`.
    pub intervals: Vec<[f32; 4]>,
    /// Index of the transfer-function interval at the lower end of each of the [`VALUE_BINS`] bins of the texel
    /// value.
    pub interval_of_bin: Vec<u32>,
    /// Integrals of the transfer function: `[extinction * rgb, extinction]` integrated from the lowest texel value to
    /// each of `TABLE_BINS + 1` bin edges.
    pub integrals: Vec<[f32; 4]>,
    /// Integrals of the extinction for each bin of the texel value: the integral up to the bin, its float32 rounding
    /// error, the integral over the bin, and zero. A small integral over a bin thus stays exact behind a high peak.
    pub extinction_bins: Vec<[f32; 4]>,
    /// Texel value at and below which the transfer function has no extinction.
    pub first_value: f32,
    /// Texel value at and above which the transfer function has no extinction.
    pub last_value: f32,
    /// Texel value at which the first of the [`VALUE_BINS`] bins of the texel value begins.
    pub bin_origin: f32,
    /// Number of [`VALUE_BINS`] bins for each unit of the texel value, the reciprocal of a bin's width.
    pub bins_per_value: f32,
    /// Texel value at which the first of the [`TABLE_BINS`] bins of the integrated transfer function begins.
    pub table_origin: f32,
    /// Number of [`TABLE_BINS`] bins of the integrated transfer function for each unit of the texel value.
    pub table_per_value: f32,
    /// Reciprocal of the transfer function's reference length, 1/mm, if it stores opacity; 0 if it stores extinction.
    pub inv_reference_length: f32,
}

#[derive(Clone, Copy)]
pub(super) struct Interval {
    pub start: f64,
    pub end: f64,
    pub amount: f64,
    pub slope: f64,
}

/// Start and total width of the bins of texel values, which reach from the transfer function's first breakpoint to
/// the last.
pub(super) fn binned_range(breaks: &[f64]) -> (f64, f64) {
    let (first, last) = (breaks.first().copied().unwrap_or(0.0), breaks.last().copied().unwrap_or(0.0));
    (first, if last > first { (last - first) * (1.0 + 1e-6) } else { 1.0 })
}

/// Texel values of the transfer function's breakpoints, where one of its linear intervals ends and the next begins.
pub(super) fn breaks(intervals: &[Interval]) -> Vec<f64> {
    intervals.iter().skip(1).map(|i| i.start).collect()
}

impl TransferTables {
    /// Builds the device tables of a transfer function for texel values in `texel_range`.
    pub fn build(tf: &TransferFunction, mapping: TexelMapping, texel_range: [f64; 2]) -> Self {
        let intervals = intervals(tf, mapping);
        let breaks = breaks(&intervals);
        let (first, width) = binned_range(&breaks);
        let bin = width / VALUE_BINS as f64;
        let interval_of_bin = (0..VALUE_BINS)
            .map(|b| {
                // A little below the edge, so that a value that rounds into this bin from below finds its interval.
                let edge = first + (b as f64 - 1e-3) * bin;
                breaks.partition_point(|s| *s <= edge) as u32
            })
            .collect();
        let [lo, hi] = texel_range;
        let table_width = if hi > lo { hi - lo } else { 1.0 };
        let (first_value, last_value) = extinction_range(tf, mapping);
        let bins = bins(tf, mapping, &breaks, lo, table_width);
        Self {
            interval_of_bin,
            integrals: integrals(&bins),
            extinction_bins: extinction_bins(&bins),
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
                .map(|i| [i.start, i.amount, i.slope, 1.0 - i.amount].map(|v| v as f32))
                .collect(),
        }
    }

    /// Size of the transfer function's tables on the device, bytes. A function with one colour (`one_color`) needs no
    /// integrals of colour.
    pub fn bytes(&self, one_color: bool) -> u64 {
        let colors = if one_color { 0 } else { size_of_val(&self.integrals[..]) };
        let intervals = size_of_val(&self.intervals[..]) + size_of_val(&self.interval_of_bin[..]);
        (intervals + size_of_val(&self.extinction_bins[..]) + colors) as u64
    }
}

pub(super) fn intervals(tf: &TransferFunction, mapping: TexelMapping) -> Vec<Interval> {
    let texel = |i: usize| mapping.texel_from_value(tf.points[i].value);
    let amount = |i: usize| tf.points[i].amount;
    let n = tf.points.len();
    let constant = |start, end, amount| Interval { start, end, amount, slope: 0.0 };
    let mut list = vec![constant(texel(0), texel(0), amount(0))];
    for i in 0..n - 1 {
        let (a, b) = (texel(i), texel(i + 1));
        // A jump has no interval; points that float32 cannot distinguish are one.
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
    let mut list = merged(list);
    // The first interval ends where the second starts.
    if let [first, second, ..] = &mut list[..] {
        first.end = second.start;
    }
    list
}

/// Largest error up to which a control point counts as lying on the line between its neighbours and is removed,
/// relative to the amount and to 1 minus it. It is far below float32 precision.
const REDUNDANT: f64 = 1e-8;

/// Merges neighbouring intervals of a transfer function that lie on one line. They occur in files that store a
/// control point for every value.
fn merged(list: Vec<Interval>) -> Vec<Interval> {
    let mut merged: Vec<Interval> = Vec::with_capacity(list.len());
    // Values and amounts of the points within the last interval.
    let mut inside: Vec<[f64; 2]> = Vec::new();
    let amount_at_end = |i: &Interval| i.amount + i.slope * (i.end - i.start);
    for next in list {
        let level = merged.len() == 1;
        let joined = merged.last().and_then(|last| {
            let jump = amount_at_end(last) - next.amount;
            let rise = amount_at_end(&next) - last.amount;
            let slope = if next.end < FAR { rise / (next.end - last.start) } else { 0.0 };
            let both = Interval { slope, end: next.end, ..*last };
            let is_small =
                |error: f64, amount: f64| error.abs() <= REDUNDANT * amount.min((1.0 - amount).abs());
            let is_on_line = |[value, amount]: &[f64; 2]| {
                is_small(both.amount + both.slope * (value - both.start) - amount, *amount)
            };
            // The function is constant below the first point.
            let can_be_line = !level || both.slope == 0.0;
            let is_line =
                can_be_line && is_on_line(&[next.start, next.amount]) && inside.iter().all(is_on_line);
            (is_small(jump, next.amount) && is_line).then_some(both)
        });
        match joined {
            Some(both) => {
                inside.push([next.start, next.amount]);
                *merged.last_mut().expect("there is one to join") = both;
            }
            None => {
                inside.clear();
                merged.push(next);
            }
        }
    }
    merged
}

/// Returns texel values `first` and `last`: the transfer function has no extinction at texel values `<= first` and at
/// those `>= last`.
pub(crate) fn extinction_range(tf: &TransferFunction, mapping: TexelMapping) -> (f32, f32) {
    let n = tf.points.len();
    let positive = |i: usize| tf.points[i].amount > 0.0;
    let texel = |i: usize| mapping.texel_from_value(tf.points[i].value) as f32;
    let first = match (0..n).find(|i| positive(*i)) {
        None => FAR as f32,
        Some(0) => -FAR as f32,
        // A jump takes effect at its value, a ramp just above its foot.
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

/// Integrates extinction times colour, and extinction, of a transfer function over each of the [`TABLE_BINS`] bins of
/// the texel value.
fn bins(
    tf: &TransferFunction,
    mapping: TexelMapping,
    breaks: &[f64],
    origin: f64,
    width: f64,
) -> Vec<[f64; 4]> {
    // Gauss-Legendre with 4 points: bins are narrow, and the function is smooth between breakpoints.
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
    (0..TABLE_BINS).into_par_iter().map(bin).collect()
}

/// Returns the integrals of a transfer function's extinction and colour from the lowest texel value to each bin edge.
fn integrals(bins: &[[f64; 4]]) -> Vec<[f32; 4]> {
    let mut total = [0.0f64; 4];
    let mut list = vec![[0.0f32; 4]];
    for b in bins {
        (0..4).for_each(|c| total[c] += b[c]);
        list.push(total.map(|t| t as f32));
    }
    list
}

fn extinction_bins(bins: &[[f64; 4]]) -> Vec<[f32; 4]> {
    let mut total = 0.0;
    let bin = |b: &[f64; 4]| {
        let sum = total as f32;
        let rest = (total - f64::from(sum)) as f32;
        total += b[3];
        [sum, rest, b[3] as f32, 0.0]
    };
    bins.iter().map(bin).collect()
}
