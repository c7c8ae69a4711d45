// Writing one texel's nodes: rows of seven nodes and a link to the next row.
//
// A node is one word: depth within the map's range in the upper 16 bits, transmittance in the lower 16.
#define_import_path umbravox::dsm_rows

#import umbravox::watch::ran_out
#import umbravox::dsm_layout::{own, row_texel, NO_ROW, ROW_NODES, DEPTH_STEPS, FILLER}

struct Counters {
    // Rows asked for beyond those of the tiles, whether or not the pool had them.
    overflow_rows: atomic<u32>,
    nodes_total: atomic<u32>,
    nodes_max: atomic<u32>,
    // Texels whose ray meets extinction.
    texels_hit: atomic<u32>,
    // Texels whose ray was given up before its end: the adapter ends long loops.
    texels_cut: atomic<u32>,
    // Texels whose tunnel was made narrower, as its hulls had no more room.
    texels_narrowed: atomic<u32>,
}

@group(2) @binding(1) var node_texture: texture_storage_2d<rgba32uint, write>;
@group(2) @binding(2) var<storage, read_write> counters: Counters;
// For each tile, by its place among those with records: rows beyond its own that it has asked for, and its texels that did
// not get all of theirs.
@group(2) @binding(3) var<storage, read_write> asked: array<atomic<u32>>;

const TILE_TEXELS: u32 = #{TILE_TEXELS};

struct Rows {
    // The texel's record, which is its first row.
    record: u32,
    // Row being filled, nodes in it, nodes in all.
    row: u32,
    used: u32,
    count: u32,
    // The half row that is being filled.
    half_row: vec4<u32>,
}

// This thread's rows: naga passes no pointers to parts of variables, so they have a place of their own.
var<private> rows: Rows;

fn start_rows(row: u32) {
    rows = Rows(row, row, 0u, 0u, vec4<u32>(0u));
}

fn nodes_stored() -> u32 {
    return rows.count;
}

// Puts a word (node or link) into the row and stores the half row that it completes.
fn put(word: u32) {
    let place = rows.used & 3u;
    rows.half_row = select(rows.half_row, vec4<u32>(word), vec4<u32>(place) <= vec4<u32>(0u, 1u, 2u, 3u));
    if place == 3u && rows.row != NO_ROW {
        textureStore(node_texture, row_texel(rows.row) + vec2<u32>(rows.used >> 2u, 0u), rows.half_row);
    }
    rows.used += 1u;
}

// Stores a node at a depth in steps of the map's range; its transmittance as it was rounded.
fn store_node(depth: f32, t: f32) -> f32 {
    let step = u32(clamp(round(depth), 0.0, DEPTH_STEPS));
    let stored = u32(round(clamp(t, 0.0, 1.0) * 65535.0));
    // A full row takes its link first: one place in the program stores.
    for (var turn = 0; turn < 2; turn++) {
        let full = rows.used == ROW_NODES;
        var word = (step << 16u) | stored;
        var next = NO_ROW;
        if full {
            // A pool that has run out is counted on, so that the host knows how far to grow it.
            next = own.tile_rows + atomicAdd(&counters.overflow_rows, 1u);
            next = select(NO_ROW, next, next < own.pool_rows && rows.row != NO_ROW);
            word = next;
        }
        put(word);
        if !full { break; }
        rows.row = next;
        rows.used = 0u;
    }
    rows.count += 1u;
    return f32(stored) / 65535.0;
}

// Says that a ray was not marched to its end.
fn cut_short() {
    atomicAdd(&counters.texels_cut, 1u);
}

// Says that a texel's polyline may have more nodes than it needs.
fn count_narrowed() {
    atomicAdd(&counters.texels_narrowed, 1u);
}

// Counts what was stored and fills the row, so that a search needs no count; `t` is the last node's transmittance.
fn finish_rows(t: f32) {
    if rows.count > 0u {
        atomicAdd(&counters.nodes_total, rows.count);
        atomicMax(&counters.nodes_max, rows.count);
        atomicAdd(&counters.texels_hit, 1u);
        // Counted at the end: in the loops above, atomics whose places differ between lanes bring llvmpipe down.
        let tile = rows.record / TILE_TEXELS;
        atomicAdd(&asked[2u * tile], (rows.count - 1u) / ROW_NODES);
        atomicAdd(&asked[2u * tile + 1u], select(0u, 1u, rows.row == NO_ROW));
    }
    if rows.row == NO_ROW { return; }
    let tail = (FILLER << 16u) | u32(round(t * 65535.0));
    for (var turn = 0u; turn <= ROW_NODES; turn++) {
        if rows.used > ROW_NODES { break; }
        put(select(tail, NO_ROW, rows.used == ROW_NODES));
    }
    if rows.used <= ROW_NODES { ran_out(); }
}
