// Reading the records of a layered map.
#define_import_path umbravox::layers_read

#import umbravox::light::light
#import umbravox::tile_table::NO_TILE
#import umbravox::work::{count_work, LOADS}
#import umbravox::layers::{own, block_place, layer_at, plane_at, split_row_bit}

@group(1) @binding(3) var records: texture_2d<u32>;

// What a record says of where its layers lie.
struct Extent {
    // False where the texel's ray meets nothing.
    meets: bool,
    start: f32,
    end: f32,
    // Row of the split.
    row: u32,
}

// A place among the layers: plane `k` and the weight of the plane after it.
struct Place {
    k: u32,
    weight: f32,
}

fn header_depth(block: vec4<u32>, bit: u32) -> f32 {
    let word = block[bit >> 5u];
    let step = extractBits(word, bit & 31u, own.header_bits & 31u);
    // Step 0 says that there is none.
    return select(light.depth_start_mm + (f32(step) - 1.0) / own.depth_steps_per_mm, bitcast<f32>(word),
        own.header_bits == 32u);
}

// The extent that a record's first block states.
fn extent_of(record: u32) -> Extent {
    if record == NO_TILE { return Extent(false, 0.0, 1.0, 0u); }
    count_work(LOADS, 1u);
    let block = textureLoad(records, block_place(record, 0u), 0);
    let first = select(extractBits(block.x, 0u, own.header_bits & 31u), block.x, own.header_bits == 32u);
    var extent = Extent(first != 0u, header_depth(block, 0u), 0.0, 0u);
    extent.end = extent.start + own.reach_mm;
#ifdef ENDS
    extent.end = header_depth(block, own.header_bits);
#endif
#ifdef SPLIT_ROWS
    let bit = split_row_bit();
    extent.row = extractBits(block[bit >> 5u], bit & 31u, 8u);
#endif
    return extent;
}

// Where a depth falls among the layers of an extent; before and behind it the nearest of its planes.
fn place_of(row: u32, start: f32, end: f32, z: f32) -> Place {
    let share = clamp((z - start) / max(end - start, 1e-9), 0.0, 1.0);
    let k = min(u32(layer_at(row, share)), own.layers - 1u);
    let a = plane_at(row, k);
    let b = plane_at(row, k + 1u);
    return Place(k, clamp((share - a) / max(b - a, 1e-12), 0.0, 1.0));
}

fn slot_value(words: vec4<u32>, slot: u32) -> f32 {
#ifdef BITS_8
    let word = words[(slot >> 2u) & own.block_mask];
    return f32(extractBits(word, (slot & 3u) * 8u, 8u)) * (own.kappa / 255.0);
#else
#ifdef BITS_16
    let pair = unpack2x16float(words[(slot >> 1u) & own.block_mask]);
    return select(pair.x, pair.y, (slot & 1u) == 1u);
#else
    return bitcast<f32>(words[slot & own.block_mask]);
#endif
#endif
}

// Optical depth of a texel at a place, linear between the planes.
fn optical_depth_at(record: u32, place: Place) -> f32 {
    if record == NO_TILE { return 0.0; }
    // Plane 0 is the start, where nothing has been met; plane k is in the k-th slot.
    let high = own.first_slot + place.k;
    let low = max(high, 1u) - 1u;
    count_work(LOADS, 2u);
    let low_words = textureLoad(records, block_place(record, low >> own.block_slot_shift), 0);
    let high_words = textureLoad(records, block_place(record, high >> own.block_slot_shift), 0);
    let before = select(slot_value(low_words, low), 0.0, place.k == 0u);
    return mix(before, slot_value(high_words, high), place.weight);
}
