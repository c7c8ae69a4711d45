// Writing one texel's visibility function: greedy compression (Lokovic & Veach 2000, 3.2; Hadwiger et al. 2006, 3.3)
// into rows of seven nodes and a link to the next row.
//
// A node is one word: depth within the map's range in the upper 16 bits, transmittance in the lower 16. The slope
// taken is never positive, so the stored function never rises.
#define_import_path umbravox::dsm_nodes

#import umbravox::light::light
#import umbravox::watch::ran_out
#import umbravox::dsm_layout::{own, row_texel, NO_ROW, ROW_NODES, DEPTH_STEPS, FILLER}

const STEEPEST: f32 = 1e30;
// Turns of a push: the first node, then for the gap and for the piece the end of a line and what follows it.
const MOST_TURNS: i32 = 8;

struct Counters {
    // Rows asked for beyond those of the tiles, whether or not the pool had them.
    overflow_rows: atomic<u32>,
    nodes_total: atomic<u32>,
    nodes_max: atomic<u32>,
    // Texels whose ray meets extinction.
    texels_hit: atomic<u32>,
    // Texels whose ray was given up before its end: the adapter ends long loops.
    texels_cut: atomic<u32>,
}

@group(2) @binding(1) var node_texture: texture_storage_2d<rgba32uint, write>;
@group(2) @binding(2) var<storage, read_write> counters: Counters;
// For each tile, by its place among those with records: rows beyond its own that it has asked for, and its texels that did
// not get all of theirs.
@group(2) @binding(3) var<storage, read_write> asked: array<atomic<u32>>;

const TILE_TEXELS: u32 = #{TILE_TEXELS};

struct Writer {
    // The texel's record, which is its first row.
    record: u32,
    // Row being filled, nodes in it, nodes in all.
    row: u32,
    used: u32,
    count: u32,
    // The half row that is being filled.
    half_row: vec4<u32>,
    // Start of the current line (the last node) and the slopes that keep it within epsilon.
    origin_z: f32,
    origin_t: f32,
    slope_lo: f32,
    slope_hi: f32,
    // The last point of the curve.
    last_z: f32,
    last_t: f32,
}

// This thread's writer: naga passes no pointers to parts of variables, so it has a place of its own.
var<private> writer: Writer;

fn start_writer(row: u32) {
    writer = Writer(row, row, 0u, 0u, vec4<u32>(0u), 0.0, 1.0, -STEEPEST, STEEPEST, 0.0, 1.0);
}

// Puts a word (node or link) into the row and stores the half row that it completes.
fn put(word: u32) {
    let place = writer.used & 3u;
    writer.half_row = select(writer.half_row, vec4<u32>(word), vec4<u32>(place) <= vec4<u32>(0u, 1u, 2u, 3u));
    if place == 3u && writer.row != NO_ROW {
        textureStore(node_texture, row_texel(writer.row) + vec2<u32>(writer.used >> 2u, 0u), writer.half_row);
    }
    writer.used += 1u;
}

// Stores a node and starts a new line there.
fn emit(z: f32, t: f32) {
    let step = u32(clamp(round((z - light.depth_start_mm) * own.depth_steps_per_mm), 0.0, DEPTH_STEPS));
    let stored = u32(round(clamp(t, 0.0, 1.0) * 65535.0));
    // A full row takes its link first: one place in the program stores.
    for (var turn = 0; turn < 2; turn++) {
        let full = writer.used == ROW_NODES;
        var word = (step << 16u) | stored;
        var next = NO_ROW;
        if full {
            // A pool that has run out is counted on, so that the host knows how far to grow it.
            next = own.tile_rows + atomicAdd(&counters.overflow_rows, 1u);
            next = select(NO_ROW, next, next < own.pool_rows && writer.row != NO_ROW);
            word = next;
        }
        put(word);
        if !full { break; }
        writer.row = next;
        writer.used = 0u;
    }
    writer.count += 1u;
    writer.origin_z = z;
    // The line goes on from what was stored, so that rounding does not add up.
    writer.origin_t = f32(stored) / 65535.0;
    writer.slope_lo = -STEEPEST;
    writer.slope_hi = STEEPEST;
}

fn line_end() -> f32 {
    // The middle of the window; its lower end where that is darkness, so that opaque things cast full shadows.
    let middle = 0.5 * (writer.slope_lo + writer.slope_hi);
    let slope = min(select(middle, writer.slope_lo, writer.last_t < own.epsilon), 0.0);
    return clamp(writer.origin_t + slope * (writer.last_z - writer.origin_z), 0.0, writer.origin_t);
}

// The curve falls to t between the depths z_from and z_to; it is level from its last point to z_from.
fn push(z_from: f32, z_to: f32, t: f32) {
    // A turn stores at most one node: the first of all, the end of a line whose window has closed, or a vertical step.
    var gap = z_from > writer.last_z;
    var turns_left = MOST_TURNS;
    loop {
        if turns_left == 0 {
            ran_out();
            break;
        }
        turns_left -= 1;
        let z = select(z_to, z_from, gap);
        let level = select(t, writer.last_t, gap);
        let dz = z - writer.origin_z;
        let first = writer.count == 0u;
        let upright = dz * own.depth_steps_per_mm < 1e-3;
        let lo = max(writer.slope_lo, (max(level - own.epsilon, 0.0) - writer.origin_t) / max(dz, 1e-12));
        let hi = min(writer.slope_hi, (level + own.epsilon - writer.origin_t) / max(dz, 1e-12));
        let fresh = writer.slope_hi == STEEPEST;
        let closed = lo > hi && !fresh && !upright;
        let step = upright && abs(level - writer.origin_t) > own.epsilon;
        let store = first || closed || step;
        let done = !(first || closed);
        if done && !upright {
            writer.slope_lo = lo;
            writer.slope_hi = max(hi, lo);
        }
        if store {
            emit(select(select(writer.last_z, z_from, first), z, step && !first), select(select(line_end(), 1.0, first), level, step && !first));
        }
        if first { writer.last_z = z_from; }
        if done {
            writer.last_z = z;
            writer.last_t = level;
        }
        if done && !gap { break; }
        gap = gap && !done && !first;
    }
}

// Says that a ray was not marched to its end.
fn cut_short() {
    atomicAdd(&counters.texels_cut, 1u);
}

// Ends the last line and fills the row, so that a search needs no count.
fn finish() {
    if writer.count > 0u {
        if writer.last_z > writer.origin_z { emit(writer.last_z, line_end()); }
        atomicAdd(&counters.nodes_total, writer.count);
        atomicMax(&counters.nodes_max, writer.count);
        atomicAdd(&counters.texels_hit, 1u);
        // Counted at the end: in the loops above, atomics whose places differ between lanes bring llvmpipe down.
        let tile = writer.record / TILE_TEXELS;
        atomicAdd(&asked[2u * tile], (writer.count - 1u) / ROW_NODES);
        atomicAdd(&asked[2u * tile + 1u], select(0u, 1u, writer.row == NO_ROW));
    }
    if writer.row == NO_ROW { return; }
    let tail = (FILLER << 16u) | u32(round(writer.origin_t * 65535.0));
    for (var turn = 0u; turn <= ROW_NODES; turn++) {
        if writer.used > ROW_NODES { break; }
        put(select(tail, NO_ROW, writer.used == ROW_NODES));
    }
    if writer.used <= ROW_NODES { ran_out(); }
}
