// Layout of a layered map: its records, and the planes between its layers.
//
// The record of a texel is a sequence of bits: start and end depth (if the method has them), the row of its split (if
// texels have one), then one slot for each layer with the optical depth at its far plane. Planes lie at shares of the
// extent of the texel: 0 at the start, 1 at the end.
#define_import_path umbravox::layers

#import umbravox::work::{count_work, LOADS}

// Width, in texels, of the texture that stores the records.
const RECORD_TEXTURE_WIDTH: u32 = #{RECORD_TEXTURE_WIDTH};
// Number of bins of a tabulated layer split.
const SPLIT_BINS: u32 = #{SPLIT_BINS};

struct Params {
    // Number of layers of a texel, and index of the first slot of a record that holds a layer.
    layers: u32,
    first_slot: u32,
    // Number of blocks of a record, number of words of a block - 1, and number of bits of a slot index inside a
    // block.
    record_blocks: u32,
    block_mask: u32,
    block_slot_shift: u32,
    // Number of bits of a stored depth; 32 for a float.
    header_bits: u32,
    // Number of planes that store the optical depth at their position; planes behind them store that of the whole
    // ray.
    planes_passed: u32,
    // Exponent of a layer split that is not tabulated.
    split_exponent: f32,
    // Length of all layers together if texels store no end depth, mm.
    reach_mm: f32,
    depth_steps_per_mm: f32,
    // Optical depth that the largest 8-bit value represents.
    kappa: f32,
    // Largest optical depth of a piece at transmittance 1 whose chord stays within the tolerance; it limits pieces
    // that contain a plane.
    longest_depth: f32,
    // Largest stored optical depth. It also represents larger ones, so that means of neighbouring texels stay in
    // order.
    max_depth: f32,
}

@group(1) @binding(1) var<uniform> params: Params;
#ifdef SPLIT_TABLE
// Two rows for each layer split: the layer coordinate at the edges of SPLIT_BINS bins, and the position of every
// plane.
@group(1) @binding(4) var splits: texture_2d<f32>;
#endif

// Returns the texel of a block (1, 2 or 4 words) of a record.
fn block_texel(record: u32, block: u32) -> vec2<u32> {
    let index = record * params.record_blocks + block;
    return vec2<u32>(index % RECORD_TEXTURE_WIDTH, index / RECORD_TEXTURE_WIDTH);
}

// Returns the bit of a record at which the row of its layer split begins, behind its depths.
fn split_row_bit() -> u32 {
#ifdef ENDS
    return 2u * params.header_bits;
#else
    return params.header_bits;
#endif
}

// Returns the layer coordinate at a fraction of the texel's depth extent: 0 at the start, k at plane k. `row` selects
// one of several layer splits.
fn layer_at(row: u32, share: f32) -> f32 {
    let layers = f32(params.layers);
#ifdef SPLIT_TABLE
    let bin = share * f32(SPLIT_BINS);
    let i = min(u32(bin), SPLIT_BINS - 1u);
    count_work(LOADS, 2u);
    let low = textureLoad(splits, vec2<u32>(i, 2u * row), 0).x;
    return mix(low, textureLoad(splits, vec2<u32>(i + 1u, 2u * row), 0).x, bin - f32(i));
#else
#ifdef SPLIT_GROWING
    // Inverse of plane_at: k (k + 1) = share layers (layers + 1).
    return 0.5 * (sqrt(1.0 + 4.0 * share * layers * (layers + 1.0)) - 1.0);
#else
    return layers * pow(max(share, 1e-30), 1.0 / params.split_exponent);
#endif
#endif
}

// Returns the fraction of the texel's depth extent at which plane k lies.
fn plane_at(row: u32, k: u32) -> f32 {
#ifdef SPLIT_TABLE
    count_work(LOADS, 1u);
    return textureLoad(splits, vec2<u32>(k, 2u * row + 1u), 0).x;
#else
    let layers = f32(params.layers);
#ifdef SPLIT_GROWING
    return f32(k) * f32(k + 1u) / (layers * (layers + 1.0));
#else
    return pow(f32(k) / layers, params.split_exponent);
#endif
#endif
}
