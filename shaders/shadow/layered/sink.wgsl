// Sink that stores the optical depth at the planes of one texel as the march passes them.
//
// Depths are exact: pieces start and end where extinction does. So the first piece of a march from the light gives
// the start of the layers, and the first piece of a march towards the light their end.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::layers::{params, block_texel, plane_at, split_row_bit}
#ifdef RAY_STATES
#import umbravox::ray_state::{put_word, put_words, put_float, take_word, take_words, take_float}
#endif

// Texels of the record texture hold 1, 2 or 4 words.
#ifdef WORDS_1
@group(2) @binding(1) var store: texture_storage_2d<r32uint, write>;
#else
#ifdef WORDS_2
@group(2) @binding(1) var store: texture_storage_2d<rg32uint, write>;
#else
@group(2) @binding(1) var store: texture_storage_2d<rgba32uint, write>;
#endif
#endif

// Limit of loops over layers: llvmpipe of Mesa 22.3 crashes on some limits that are uniforms.
const MAX_LAYERS: u32 = #{MOST_LAYERS};

struct Sink {
    // Optical depth of the ray so far, at most `params.max_depth`.
    optical_depth: f32,
    // Largest optical depth of a piece at the present transmittance whose chord stays within the error tolerance.
    longest_depth: f32,
}

struct Writer {
    // Whether the march goes towards the light and finds the end depth of the layers.
    finding_end: bool,
    record: u32,
    row: u32,
    // Whether the ray has met extinction, whether its layers have begun, and the depth extent of the layers.
    met: bool,
    begun: bool,
    start: f32,
    extent_mm: f32,
    end: f32,
    // Next plane that the march passes, and its depth.
    plane: u32,
    plane_z: f32,
    // Next slot of the record, and the block that contains it.
    slot: u32,
    block: vec4<u32>,
}

// The writer of this thread: naga passes no pointers to parts of variables.
var<private> writer: Writer;

// Only the optical depth at planes is stored: a stretch without planes may be one piece of any length.
fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    var passes = writer.plane <= params.planes_passed && writer.plane_z <= z_to;
#ifdef STARTS
    // Before the layers begin, the first plane may lie just behind their start.
    passes = passes || !writer.begun;
#endif
    return select(1e30, (*sink).longest_depth, passes && !writer.finding_end);
}

fn start_writer(record: u32, row: u32) {
    writer = Writer(false, record, row, false, false, light.depth_start_mm, params.reach_mm, 0.0, 1u, 0.0,
        params.first_slot, vec4<u32>(0u));
    writer.plane_z = writer.start + writer.extent_mm * plane_at(row, 1u);
}

// Sets whether the next march finds the end or fills the layers.
fn find_end(finding_end: bool) {
    writer.finding_end = finding_end;
}

fn met_extinction() -> bool {
    return writer.met;
}

// Packs an optical depth into the bits of a slot.
fn slot_bits(depth: f32) -> u32 {
#ifdef BITS_8
    return u32(round(clamp(depth / params.kappa, 0.0, 1.0) * 255.0));
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

// Stores the block that ends before the next slot, if one does, or the last block of the record.
fn store_block(last: bool) {
    if last || (writer.slot & ((1u << params.block_slot_shift) - 1u)) == 0u {
        let block = (writer.slot - 1u) >> params.block_slot_shift;
        textureStore(store, block_texel(writer.record, block), writer.block);
        writer.block = vec4<u32>(0u);
    }
}

#ifdef STARTS
// Returns a depth in stored steps, rounded away from the light: before a start depth the transmittance is 1, and
// nothing lies behind an end depth.
fn depth_steps(z: f32) -> f32 {
    let last = exp2(f32(params.header_bits)) - 2.0;
    return clamp(ceil((z - light.depth_start_mm) * params.depth_steps_per_mm), 0.0, last);
}

fn put_header_depth(bit: u32, z: f32, steps: f32) {
    let stepped = (u32(steps) + 1u) << (bit & 31u);
    // The bits of 0.0 mean that no depth is stored.
    let plain = bitcast<u32>(select(z, 1e-20, z == 0.0));
    or_word(bit >> 5u, select(stepped, plain, params.header_bits == 32u));
}

// Begins the layers at the first extinction of the ray.
fn begin_layers(z: f32) {
    writer.begun = true;
    let steps = depth_steps(z);
    let exact = params.header_bits == 32u;
    writer.start = select(light.depth_start_mm + steps / params.depth_steps_per_mm, z, exact);
    put_header_depth(0u, z, steps);
#ifdef ENDS
    // The end lies at least one step behind the start, and at most at the largest value of its bit field.
    let end_steps = min(max(depth_steps(writer.end), steps + 1.0), exp2(f32(params.header_bits)) - 2.0);
    let end = select(light.depth_start_mm + end_steps / params.depth_steps_per_mm, writer.end, exact);
    writer.extent_mm = max(end - writer.start, 1e-9);
    put_header_depth(params.header_bits, writer.end, end_steps);
#endif
#ifdef SPLIT_ROWS
    let bit = split_row_bit();
    or_word(bit >> 5u, writer.row << (bit & 31u));
#endif
    // The two depths may fill a block.
    store_block(false);
    writer.plane_z = writer.start + writer.extent_mm * plane_at(writer.row, 1u);
}
#endif

fn put(depth: f32) {
    let slot = writer.slot;
    let bits = slot_bits(depth);
#ifdef BITS_8
    or_word((slot >> 2u) & params.block_mask, bits << ((slot & 3u) * 8u));
#else
#ifdef BITS_16
    or_word((slot >> 1u) & params.block_mask, bits << ((slot & 1u) * 16u));
#else
    or_word(slot & params.block_mask, bits);
#endif
#endif
    writer.slot += 1u;
    store_block(writer.plane == params.layers);
    writer.plane += 1u;
}

// Stores the optical depth at the planes up to `last` in front of z_to, on a straight line from `depth` at z_from.
fn pass_planes(last: u32, z_from: f32, z_to: f32, depth: f32, rise: f32) {
    for (var i = 0u; i < MAX_LAYERS; i++) {
        if writer.plane > last || writer.plane_z > z_to { break; }
        let share = clamp((writer.plane_z - z_from) / max(z_to - z_from, 1e-12), 0.0, 1.0);
        put(min(depth + rise * share, params.max_depth));
        writer.plane_z = writer.start
            + writer.extent_mm * plane_at(writer.row, min(writer.plane, params.layers));
    }
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
#ifdef ENDS
    if writer.finding_end {
        // This march goes towards the light: depths are negative, and the first piece starts at the end.
        writer.end = -z_from;
        writer.met = true;
        return true;
    }
#endif
#ifdef STARTS
    if !writer.begun { begin_layers(z_from); }
#endif
    writer.met = true;
    // Limited to a finite number, so that its fractions are finite.
    let rise = min(depth, 1e30);
    pass_planes(params.planes_passed, z_from, z_to, (*sink).optical_depth, rise);
    (*sink).optical_depth = min((*sink).optical_depth + rise, params.max_depth);
    (*sink).longest_depth = params.longest_depth * exp(0.5 * (*sink).optical_depth);
    return (*sink).optical_depth >= params.max_depth;
}

// Stores the optical depth of the whole ray at the planes that the march did not pass.
fn finish(depth: f32) {
    if !writer.met { return; }
    for (var i = 0u; i < MAX_LAYERS; i++) {
        if writer.plane > params.layers { break; }
        put(depth);
    }
}

#ifdef RAY_STATES
// Stores the state of a ray that waits.
fn save_sink(sink: ptr<function, Sink>) {
    put_float((*sink).optical_depth);
    put_float((*sink).longest_depth);
    put_word(select(0u, 1u, writer.met) | select(0u, 2u, writer.begun));
    put_float(writer.start);
    put_float(writer.extent_mm);
    put_float(writer.end);
    put_word(writer.plane);
    put_float(writer.plane_z);
    put_word(writer.slot);
    put_words(writer.block);
}

// Restores the state of a ray that has waited.
fn load_sink(sink: ptr<function, Sink>) {
    (*sink).optical_depth = take_float();
    (*sink).longest_depth = take_float();
    let flags = take_word();
    writer.met = (flags & 1u) != 0u;
    writer.begun = (flags & 2u) != 0u;
    writer.start = take_float();
    writer.extent_mm = take_float();
    writer.end = take_float();
    writer.plane = take_word();
    writer.plane_z = take_float();
    writer.slot = take_word();
    writer.block = take_words();
}
#endif
