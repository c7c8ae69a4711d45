// Reads the records of a layered shadow map.
#define_import_path umbravox::layers_read

#import umbravox::light::light
#import umbravox::tile_table::NO_TILE
#import umbravox::work::{count_work, LOADS}
#import umbravox::layers::{params, block_texel, layer_at, plane_at, split_row_bit}

@group(1) @binding(3) var records: texture_2d<u32>;

// Depth extent of the layers of a texel's record.
struct Extent {
    // Whether the ray of the texel meets extinction.
    filled: bool,
    start: f32,
    end: f32,
    // Row of the layer split in its table.
    row: u32,
}

// Position of a depth among the layers: plane `k`, and the weight of the next plane.
struct LayerPoint {
    k: u32,
    weight: f32,
}

fn header_depth(block: vec4<u32>, bit: u32) -> f32 {
    let word = block[bit >> 5u];
    let step = extractBits(word, bit & 31u, params.header_bits & 31u);
    // Step 0 means that no depth is stored.
    return select(light.depth_start_mm + (f32(step) - 1.0) / params.depth_steps_per_mm, bitcast<f32>(word),
        params.header_bits == 32u);
}

// Returns the depth extent of a record, read from its first block.
fn extent_of(record: u32) -> Extent {
    if record == NO_TILE { return Extent(false, 0.0, 1.0, 0u); }
    count_work(LOADS, 1u);
    let block = textureLoad(records, block_texel(record, 0u), 0);
    let first = select(extractBits(block.x, 0u, params.header_bits & 31u), block.x, params.header_bits == 32u);
    var extent = Extent(first != 0u, header_depth(block, 0u), 0.0, 0u);
    extent.end = extent.start + params.reach_mm;
#ifdef ENDS
    extent.end = header_depth(block, params.header_bits);
#endif
#ifdef SPLIT_ROWS
    let bit = split_row_bit();
    extent.row = extractBits(block[bit >> 5u], bit & 31u, 8u);
#endif
    return extent;
}

// Returns the position of a depth among the layers, clamped to the first and the last plane.
fn layer_point(row: u32, start: f32, end: f32, z: f32) -> LayerPoint {
    let share = clamp((z - start) / max(end - start, 1e-9), 0.0, 1.0);
    let k = min(u32(layer_at(row, share)), params.layers - 1u);
    let a = plane_at(row, k);
    let b = plane_at(row, k + 1u);
    return LayerPoint(k, clamp((share - a) / max(b - a, 1e-12), 0.0, 1.0));
}

fn slot_value(words: vec4<u32>, slot: u32) -> f32 {
#ifdef BITS_8
    let word = words[(slot >> 2u) & params.block_mask];
    return f32(extractBits(word, (slot & 3u) * 8u, 8u)) * (params.kappa / 255.0);
#else
#ifdef BITS_16
    let pair = unpack2x16float(words[(slot >> 1u) & params.block_mask]);
    return select(pair.x, pair.y, (slot & 1u) == 1u);
#else
    return bitcast<f32>(words[slot & params.block_mask]);
#endif
#endif
}

// Returns the optical depth of a texel's record at plane k.
fn plane_depth(record: u32, k: u32) -> f32 {
    // Plane 0 has optical depth 0 and no slot; plane k is in the k-th slot.
    let slot = params.first_slot + max(k, 1u) - 1u;
    count_work(LOADS, 1u);
    let words = textureLoad(records, block_texel(record, slot >> params.block_slot_shift), 0);
    return select(slot_value(words, slot), 0.0, k == 0u);
}

// Returns the optical depth of a texel's record, linear between the planes.
fn optical_depth_at(record: u32, point: LayerPoint) -> f32 {
    if record == NO_TILE { return 0.0; }
    return mix(plane_depth(record, point.k), plane_depth(record, point.k + 1u), point.weight);
}
