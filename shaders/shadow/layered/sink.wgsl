// Sink that stores the optical depth at the planes of one texel, as the march passes them.
//
// Depths are exact: a piece starts and ends where extinction does, so the first one starts where the ray first meets
// something, and the first one of a march from behind ends it.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::layers::{own, block_place, plane_at, split_row_bit}

// The store's texels hold 1, 2 or 4 words.
#ifdef WORDS_1
@group(2) @binding(1) var store: texture_storage_2d<r32uint, write>;
#else
#ifdef WORDS_2
@group(2) @binding(1) var store: texture_storage_2d<rg32uint, write>;
#else
@group(2) @binding(1) var store: texture_storage_2d<rgba32uint, write>;
#endif
#endif

// A bound of loops over layers that is no uniform: llvmpipe of Mesa 22.3 crashes on some that are.
const MOST_LAYERS: u32 = #{MOST_LAYERS};

struct Sink {
    // Not above `own.most_depth`.
    optical_depth: f32,
    // Optical depth whose chord stays within the tolerance at the present transmittance.
    longest_depth: f32,
}

struct Writer {
    // Looking for the end of what the ray meets, from behind.
    seeking: bool,
    record: u32,
    row: u32,
    // Whether the ray has met anything, from either side, and whether its layers have begun; their extent.
    met: bool,
    begun: bool,
    start: f32,
    extent_mm: f32,
    end: f32,
    // The plane ahead and its depth.
    plane: u32,
    plane_z: f32,
    // The slot to be filled next, and the block that it is part of.
    slot: u32,
    block: vec4<u32>,
}

// This thread's writer: naga passes no pointers to parts of variables, so it has a place of its own.
var<private> writer: Writer;

// Only the optical depth at planes is stored: a stretch that holds none is one piece, whatever bends in it.
fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    var passes = writer.plane <= own.planes_passed && writer.plane_z <= z_to;
#ifdef STARTS
    // Where layers have not begun, the first plane may lie just behind their start.
    passes = passes || !writer.begun;
#endif
    return select(1e30, (*sink).longest_depth, passes && !writer.seeking);
}

fn start_writer(record: u32, row: u32) {
    writer = Writer(false, record, row, false, false, light.depth_start_mm, own.reach_mm, 0.0, 1u, 0.0,
        own.first_slot, vec4<u32>(0u));
    writer.plane_z = writer.start + writer.extent_mm * plane_at(row, 1u);
}

// The march to come looks for the end (or for the layers).
fn seek_end(seeking: bool) {
    writer.seeking = seeking;
}

fn met_something() -> bool {
    return writer.met;
}

// Packs an optical depth into the bits of a slot.
fn slot_bits(depth: f32) -> u32 {
#ifdef BITS_8
    return u32(round(clamp(depth / own.kappa, 0.0, 1.0) * 255.0));
#else
#ifdef BITS_16
    return pack2x16float(vec2<f32>(depth, 0.0)) & 0xffffu;
#else
    return bitcast<u32>(depth);
#endif
#endif
}

fn or_word(index: u32, bits: u32) {
    writer.block |= select(vec4<u32>(0u), vec4<u32>(bits), vec4<u32>(index) == vec4<u32>(0u, 1u, 2u, 3u));
}

// Stores the block that ends in front of the slot ahead, where one does, or the record's last.
fn store_block(last: bool) {
    if last || (writer.slot & ((1u << own.block_slot_shift) - 1u)) == 0u {
        let block = (writer.slot - 1u) >> own.block_slot_shift;
        textureStore(store, block_place(writer.record, block), writer.block);
        writer.block = vec4<u32>(0u);
    }
}

#ifdef STARTS
// Steps of a stored depth, rounded away from the light: in front of what starts there all light arrives, and
// nothing lies behind what ends there.
fn depth_steps(z: f32) -> f32 {
    let last = exp2(f32(own.header_bits)) - 2.0;
    return clamp(ceil((z - light.depth_start_mm) * own.depth_steps_per_mm), 0.0, last);
}

fn put_header_depth(bit: u32, z: f32, steps: f32) {
    let stepped = (u32(steps) + 1u) << (bit & 31u);
    // 0.0 has the bits that stand for none.
    let plain = bitcast<u32>(select(z, 1e-20, z == 0.0));
    or_word(bit >> 5u, select(stepped, plain, own.header_bits == 32u));
}

// The first thing that the ray meets: from here on the texel has layers.
fn begin_layers(z: f32) {
    writer.begun = true;
    let steps = depth_steps(z);
    let exact = own.header_bits == 32u;
    writer.start = select(light.depth_start_mm + steps / own.depth_steps_per_mm, z, exact);
    put_header_depth(0u, z, steps);
#ifdef ENDS
    // One step at least, and none past what the field holds.
    let end_steps = min(max(depth_steps(writer.end), steps + 1.0), exp2(f32(own.header_bits)) - 2.0);
    let end = select(light.depth_start_mm + end_steps / own.depth_steps_per_mm, writer.end, exact);
    writer.extent_mm = max(end - writer.start, 1e-9);
    put_header_depth(own.header_bits, writer.end, end_steps);
#endif
#ifdef SPLIT_ROWS
    let bit = split_row_bit();
    or_word(bit >> 5u, writer.row << (bit & 31u));
#endif
    // Depths may fill a block of their own.
    store_block(false);
    writer.plane_z = writer.start + writer.extent_mm * plane_at(writer.row, 1u);
}
#endif

fn put(depth: f32) {
    let slot = writer.slot;
    let bits = slot_bits(depth);
#ifdef BITS_8
    or_word((slot >> 2u) & own.block_mask, bits << ((slot & 3u) * 8u));
#else
#ifdef BITS_16
    or_word((slot >> 1u) & own.block_mask, bits << ((slot & 1u) * 16u));
#else
    or_word(slot & own.block_mask, bits);
#endif
#endif
    writer.slot += 1u;
    store_block(writer.plane == own.layers);
    writer.plane += 1u;
}

// Stores the planes up to `last` that lie no deeper than z_to, by a straight line from `depth` at z_from on.
fn pass_planes(last: u32, z_from: f32, z_to: f32, depth: f32, rise: f32) {
    for (var turn = 0u; turn < MOST_LAYERS; turn++) {
        if writer.plane > last || writer.plane_z > z_to { break; }
        let share = clamp((writer.plane_z - z_from) / max(z_to - z_from, 1e-12), 0.0, 1.0);
        put(min(depth + rise * share, own.most_depth));
        writer.plane_z = writer.start
            + writer.extent_mm * plane_at(writer.row, min(writer.plane, own.layers));
    }
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
#ifdef ENDS
    if writer.seeking {
        // This march looks from behind: its depths are negative, and its first piece starts at the end.
        writer.end = -z_from;
        writer.met = true;
        return true;
    }
#endif
#ifdef STARTS
    if !writer.begun { begin_layers(z_from); }
#endif
    writer.met = true;
    // Finite, so that a share of it is.
    let rise = min(depth, 1e30);
    pass_planes(own.planes_passed, z_from, z_to, (*sink).optical_depth, rise);
    (*sink).optical_depth = min((*sink).optical_depth + rise, own.most_depth);
    (*sink).longest_depth = own.longest_depth * exp(0.5 * (*sink).optical_depth);
    return (*sink).optical_depth >= own.most_depth;
}

// Planes that the ray did not reach, or that hold what lies behind them, get all that it met.
fn finish(depth: f32) {
    if !writer.met { return; }
    for (var turn = 0u; turn < MOST_LAYERS; turn++) {
        if writer.plane > own.layers { break; }
        put(depth);
    }
}
