// Transfer function on the device, over the values stored in the volume texture.
#define_import_path umbravox::transfer

#import umbravox::field::field
#import umbravox::labels::CUTS_BY_LABEL
#import umbravox::work::{count_work, LOADS}

const MAX_OPACITY: f32 = #{MAX_OPACITY};
const VALUE_BINS: u32 = #{VALUE_BINS};
const TABLE_BINS: u32 = #{TABLE_BINS};
const PAIR_BINS: u32 = #{PAIR_BINS};
const LN_2: f32 = 0.6931472;
const SQRT_HALF_BITS: u32 = 0x3f3504f3u;
// Optical depth of a whole ray of which a tenth may be lost each time that opacity nears 1.
const UNEVEN_DEPTH: f32 = #{UNEVEN_DEPTH};
const MORE_NODES: u32 = #{MORE_NODES};
const MAX_INTERVALS: u32 = #{MAX_INTERVALS};

struct IntervalTable {
    // Intervals of the transfer function: (start value, amount at the start, slope of the amount, 1 - amount at the
    // start). Interval 0 covers all values below the next one.
    intervals: array<vec4<f32>, #{MAX_INTERVALS}>,
    // Index of the interval at the lower end of each value bin, four bins in a vector.
    of_bin: array<vec4<u32>, #{VALUE_BIN_VECTORS}>,
}

// Small tables are uniforms and large ones textures: software adapters read storage buffers lane by lane.
@group(0) @binding(4) var<uniform> interval_table: IntervalTable;
// Pre-integrated transfer function: extinction times colour (rgb) and extinction (w), integrated over the value up to
// each bin edge. Not with ONE_COLOR.
@group(0) @binding(5) var integrals: texture_2d<f32>;
// Table of breakpoints for pairs of values: up to four intervals of the transfer function at whose starts a ray's
// visibility curve bends between the two values, four u16 in a pair.
@group(0) @binding(6) var pair_nodes: texture_2d<u32>;
// Integrals of extinction over the value, one texel for each bin: up to the bin, the float32 rounding error of that
// sum, and over the bin.
@group(0) @binding(8) var extinction_bins: texture_2d<f32>;

fn interval_start(j: u32) -> f32 {
    return interval_table.intervals[min(j, MAX_INTERVALS - 1u)].x;
}

fn interval_at(value: f32) -> u32 {
    let bin = clamp((value - field.bin_origin) * field.bins_per_value, 0.0, f32(VALUE_BINS - 1u));
    let bin_index = u32(bin);
    var j = interval_table.of_bin[bin_index >> 2u][bin_index & 3u];
    loop {
        if j + 1u >= field.intervals || value < interval_table.intervals[min(j + 1u, MAX_INTERVALS - 1u)].x { break; }
        j += 1u;
    }
    return j;
}

// Returns -log(1 - a) for opacities a and `transmitted` = 1 - a, to a few units in the last place. `log` itself has
// errors of 2^-21 near 1, which is large compared with small opacities.
fn absorbance(a: vec4<f32>, transmitted: vec4<f32>) -> vec4<f32> {
    // transmitted = m 2^k with m from sqrt(1/2) to sqrt(2), whose logarithm is 2 atanh((m - 1) / (m + 1)).
    let bits = bitcast<vec4<u32>>(transmitted);
    let biased = (bits + (0x3f800000u - SQRT_HALF_BITS)) >> vec4<u32>(23u);
    let m = bitcast<vec4<f32>>(bits + ((127u - biased) << vec4<u32>(23u)));
    let short = select(1.0 - m, a, biased == vec4<u32>(127u));
    let t = short / (2.0 - short);
    let s = t * t;
    let series = 2.0 * t * (1.0 + s * (1.0 / 3.0 + s * (0.2 + s * (1.0 / 7.0 + s * (1.0 / 9.0)))));
    // The difference is one of integers: NVIDIA's compiler turns (127 - x) LN_2 into 127 LN_2 - x LN_2, which gives
    // opacity 0 an extinction of 1.4e-6.
    return series + vec4<f32>(vec4<i32>(127) - vec4<i32>(biased)) * LN_2;
}

// Amounts of the transfer function at four values: extinction (1/mm) or opacity, as its file gives it. For opacity,
// `transmitted` is the fraction of light that passes a reference length, else 1.
struct Ordinates {
    ordinate: vec4<f32>,
    transmitted: vec4<f32>,
}

// Returns the transfer function's amounts at values inside the interval j.
fn ordinates_in(j: u32, values: vec4<f32>) -> Ordinates {
    let piece = interval_table.intervals[j];
    let rise = piece.z * (values - piece.x);
    let ordinate = max(piece.y + rise, vec4<f32>(0.0));
    let opacity = field.inv_reference_length > 0.0;
    return Ordinates(
        select(ordinate, min(ordinate, vec4<f32>(MAX_OPACITY)), opacity),
        select(vec4<f32>(1.0), clamp(piece.w - rise, vec4<f32>(1.0 - MAX_OPACITY), vec4<f32>(1.0)), opacity),
    );
}

// Returns the extinction (1/mm) for amounts of the transfer function.
fn extinction_of(at: Ordinates) -> vec4<f32> {
    let per_mm = field.inv_reference_length;
    return select(at.ordinate, absorbance(at.ordinate, at.transmitted) * per_mm, per_mm > 0.0);
}

// Returns the extinction (1/mm) at values inside the interval j.
fn extinction_in(j: u32, values: vec4<f32>) -> vec4<f32> {
    return extinction_of(ordinates_in(j, values));
}

// Returns the steepest slope of extinction inside the interval j (1/mm per value). For opacity, at least the fraction
// `least` of light is transmitted there.
fn extinction_slope(j: u32, least: f32) -> f32 {
    let per_mm = field.inv_reference_length;
    return abs(interval_table.intervals[j].z) * select(1.0, per_mm / least, per_mm > 0.0);
}

// Returns whether the transmitted fraction of light changes by more than a factor of 2 between the first two amounts,
// over a stretch long enough to matter. Otherwise the error of four-point Gauss is below 1.3e-3 of the stretch
// (docs/bound.md).
fn uneven(ends: Ordinates, length_mm: f32) -> bool {
    let least = min(ends.transmitted.x, ends.transmitted.y);
    // -log(x) is at most (1 - x) / sqrt(x), and at most -k log(2) for x >= 2^k.
    let powers = f32(127 - i32(bitcast<u32>(least) >> 23u)) * LN_2;
    let max_depth = min((1.0 - least) * inverseSqrt(least), powers) * field.inv_reference_length * length_mm;
    // Opacity nears 1 at most once in each interval of each monotone stretch of each cell.
    let often = f32(CUTS_BY_LABEL) * f32(field.size.x + field.size.y + field.size.z) * f32(field.intervals);
    return (max(ends.transmitted.x, ends.transmitted.y) > 2.0 * least) & (max_depth * often > UNEVEN_DEPTH);
}

fn extinction_at(value: f32) -> f32 {
    return extinction_in(interval_at(value), vec4<f32>(value)).x;
}

// Returns the position of a value among the bins of the pre-integrated table.
fn table_place(value: f32) -> f32 {
    return clamp((value - field.table_origin) * field.table_per_value, 0.0, f32(TABLE_BINS));
}

// Integral of extinction over all values up to a given one, and the extinction there.
struct Integral {
    sum: f32,
    // Remainder of the integral, stored separately so that a large sum does not round off small bins.
    rest: f32,
    slope: f32,
}

fn integral_at(value: f32) -> Integral {
    let x = table_place(value);
    let i = min(u32(x), TABLE_BINS - 1u);
    count_work(LOADS, 1u);
    let bin = textureLoad(extinction_bins, vec2<u32>(i, 0u), 0).xyz;
    // This form is exact for equal integrals: zero extinction must stay zero.
    return Integral(bin.x, bin.y + bin.z * (x - f32(i)), bin.z * field.table_per_value);
}

// Returns the mean extinction (1/mm) of a segment on which the value changes linearly from a to b.
fn mean_between(a: f32, b: f32, at_a: Integral, at_b: Integral) -> f32 {
    // Below half a bin the difference of integrals is mostly rounding; the slopes of the bins replace it.
    let short = abs(b - a) * field.table_per_value < 0.5;
    let apart = ((at_b.sum - at_a.sum) + (at_b.rest - at_a.rest)) / select(b - a, 1.0, short);
    return max(select(apart, 0.5 * (at_a.slope + at_b.slope), short), 0.0);
}

#ifdef ONE_COLOR
alias ColorIntegral = Integral;

fn color_integral_at(value: f32) -> ColorIntegral {
    return integral_at(value);
}

// Returns mean extinction (w, 1/mm) and extinction-weighted colour (rgb) of a segment on which the value changes
// linearly from a to b.
fn mean_color(a: f32, b: f32, at_a: ColorIntegral, at_b: ColorIntegral) -> vec4<f32> {
    return vec4<f32>(field.color_r, field.color_g, field.color_b, 1.0) * mean_between(a, b, at_a, at_b);
}
#else
// Integral of extinction times colour (rgb) and of extinction (w) over all values up to a given one, and the
// integrand there.
struct ColorIntegral {
    sum: vec4<f32>,
    slope: vec4<f32>,
}

fn color_integral_at(value: f32) -> ColorIntegral {
    let x = table_place(value);
    let i = min(u32(x), TABLE_BINS - 1u);
    count_work(LOADS, 2u);
    let low = textureLoad(integrals, vec2<u32>(i, 0u), 0);
    let rise = textureLoad(integrals, vec2<u32>(i + 1u, 0u), 0) - low;
    return ColorIntegral(low + rise * (x - f32(i)), rise * field.table_per_value);
}

fn mean_color(a: f32, b: f32, at_a: ColorIntegral, at_b: ColorIntegral) -> vec4<f32> {
    let short = abs(b - a) * field.table_per_value < 0.5;
    let apart = (at_b.sum - at_a.sum) / select(b - a, 1.0, short);
    return max(select(apart, 0.5 * (at_a.slope + at_b.slope), short), vec4<f32>(0.0));
}
#endif

fn pair_bin(value: f32) -> u32 {
    return u32(clamp((value - field.bin_origin) * field.bins_per_value * (f32(PAIR_BINS) / f32(VALUE_BINS)), 0.0, f32(PAIR_BINS - 1u)));
}

// Returns the indices of four transfer-function intervals in the order in which a value that changes from a to b
// meets their starts. Unused places hold larger indices than MORE_NODES. MORE_NODES in the last place means that the
// table cannot store all of them.
fn nodes_between(a: f32, b: f32) -> vec4<u32> {
    count_work(LOADS, 1u);
    let packed = textureLoad(pair_nodes, vec2<u32>(pair_bin(b), pair_bin(a)), 0);
    return vec4<u32>(packed.x & 0xffffu, packed.x >> 16u, packed.y & 0xffffu, packed.y >> 16u);
}
