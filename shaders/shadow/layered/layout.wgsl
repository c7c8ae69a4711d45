// Where a layered map keeps what: its records, and the planes between its layers.
//
// A texel's record is a run of bits: start and end depth (as far as the method has them) and the row of its own
// split, then one slot a layer with the optical depth down to the layer's far plane. A layered map's planes lie at
// shares of its texel's extent: 0 at the start, 1 at the end.
#define_import_path umbravox::layers

#import umbravox::work::{count_work, LOADS}

// Texels across the texture of records.
const RECORD_TEXTURE_WIDTH: u32 = #{RECORD_TEXTURE_WIDTH};
// Stretches of a tabulated split.
const SPLIT_BINS: u32 = #{SPLIT_BINS};

struct Own {
    // Layers a texel; the first slot of a record that holds one.
    layers: u32,
    first_slot: u32,
    // Blocks a record, words a block less one, and the bits of a slot index that lie inside a block.
    record_blocks: u32,
    block_mask: u32,
    block_slot_shift: u32,
    // Bits of a stored depth; 32 is a float.
    header_bits: u32,
    // Planes that get the optical depth where they lie; those behind get all of it.
    planes_passed: u32,
    // Exponent of a split that is not tabulated.
    split_exponent: f32,
    // Depth that the layers span where a texel has no end of its own, mm.
    reach_mm: f32,
    depth_steps_per_mm: f32,
    // Optical depth of the greatest 8-bit value.
    kappa: f32,
    // Optical depth whose chord stays within the tolerance at transmittance 1: pieces that hold a plane are no deeper.
    longest_depth: f32,
    // Neighbouring texels whose first depths differ by less see the same surface, mm.
    same_surface_mm: f32,
    // Texels a side that are averaged, and that a lookup reads.
    kernel: u32,
    filter_side: u32,
    // Optical depth that stands for more, too: means of neighbouring texels stay in order.
    most_depth: f32,
}

@group(1) @binding(1) var<uniform> own: Own;
#ifdef SPLIT_TABLE
// Two rows a split: the layer coordinate at the edges of SPLIT_BINS bins, and the place of every plane.
@group(1) @binding(4) var splits: texture_2d<f32>;
#endif

// Where a block (one texel of the texture: 1, 2 or 4 words) of a record lies.
fn block_place(record: u32, block: u32) -> vec2<u32> {
    let index = record * own.record_blocks + block;
    return vec2<u32>(index % RECORD_TEXTURE_WIDTH, index / RECORD_TEXTURE_WIDTH);
}

// The bit of a record at which the row of its own split stands: behind its depths.
fn split_row_bit() -> u32 {
#ifdef ENDS
    return 2u * own.header_bits;
#else
    return own.header_bits;
#endif
}

// The layer coordinate of a share of the extent: 0 at the start, k at plane k. `row` picks one of several splits.
fn layer_at(row: u32, share: f32) -> f32 {
    let layers = f32(own.layers);
#ifdef SPLIT_TABLE
    let bin = share * f32(SPLIT_BINS);
    let i = min(u32(bin), SPLIT_BINS - 1u);
    count_work(LOADS, 2u);
    let low = textureLoad(splits, vec2<u32>(i, 2u * row), 0).x;
    return mix(low, textureLoad(splits, vec2<u32>(i + 1u, 2u * row), 0).x, bin - f32(i));
#else
#ifdef SPLIT_GROWING
    // The inverse of plane_at: k (k + 1) = share layers (layers + 1).
    return 0.5 * (sqrt(1.0 + 4.0 * share * layers * (layers + 1.0)) - 1.0);
#else
    return layers * pow(max(share, 1e-30), 1.0 / own.split_exponent);
#endif
#endif
}

// The share of the extent at which plane k lies.
fn plane_at(row: u32, k: u32) -> f32 {
#ifdef SPLIT_TABLE
    count_work(LOADS, 1u);
    return textureLoad(splits, vec2<u32>(k, 2u * row + 1u), 0).x;
#else
    let layers = f32(own.layers);
#ifdef SPLIT_GROWING
    return f32(k) * f32(k + 1u) / (layers * (layers + 1.0));
#else
    return pow(f32(k) / layers, own.split_exponent);
#endif
#endif
}
