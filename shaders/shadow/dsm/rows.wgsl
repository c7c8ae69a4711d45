// Writer of the nodes of one texel: rows of seven nodes and a link to the next row.
#define_import_path umbravox::curve_nodes

#import umbravox::light::light
#import umbravox::watch::report_iteration_limit
#import umbravox::dsm_layout::{params, node_word, node_value, DEPTH_STEPS, FILLER}
#import umbravox::dsm_row_layout::{row_texel, NO_ROW, ROW_NODES}
#import umbravox::dsm_counters::{counters, blocks, block_of_record, bit_of_record}
#ifdef RAY_STATES
#import umbravox::ray_state::{put_word, put_words, take_word, take_words}
#endif

@group(2) @binding(1) var node_texture: texture_storage_2d<rgba32uint, write>;
// For each built tile, in the order of records: number of rows requested beyond its first rows, and of texels that
// did not get all rows.
@group(2) @binding(3) var<storage, read_write> requested_rows: array<atomic<u32>>;

const TILE_TEXELS: u32 = #{TILE_TEXELS};

struct Rows {
    // Record index of the texel, which is also its first row.
    record: u32,
    // Present row, number of nodes in it, number of nodes of the texel.
    row: u32,
    used: u32,
    count: u32,
    // Words of the present half row.
    half_row: vec4<u32>,
}

// The rows of this thread: naga passes no pointers to parts of variables.
var<private> rows: Rows;

fn start_nodes(row: u32) {
    rows = Rows(row, row, 0u, 0u, vec4<u32>(0u));
}

fn nodes_stored() -> u32 {
    return rows.count;
}

// Adds a word (curve node or link) to the row, and stores the half row when it is complete.
fn put(word: u32) {
    let place = rows.used & 3u;
    rows.half_row = select(rows.half_row, vec4<u32>(word), vec4<u32>(place) <= vec4<u32>(0u, 1u, 2u, 3u));
    if place == 3u && rows.row != NO_ROW {
        textureStore(node_texture, row_texel(rows.row) + vec2<u32>(rows.used >> 2u, 0u), rows.half_row);
    }
    rows.used += 1u;
}

// Stores a curve node at a depth in steps of the map's range, and returns its rounded value.
fn store_node(depth: f32, value: f32) -> f32 {
    let node = node_word(u32(clamp(round(depth), 0.0, DEPTH_STEPS)), value);
    // A full row gets its link first. The loop keeps the code of the store in the program once.
    for (var i = 0; i < 2; i++) {
        let full = rows.used == ROW_NODES;
        var word = node;
        var next = NO_ROW;
        if full {
            // Rows beyond the pool are counted, too, so that the host knows how far to grow it.
            next = params.tile_rows + atomicAdd(&counters.overflow_rows, 1u);
            next = select(NO_ROW, next, next < params.pool_rows && rows.row != NO_ROW);
            word = next;
        }
        put(word);
        if !full { break; }
        rows.row = next;
        rows.used = 0u;
    }
    rows.count += 1u;
    return node_value(node);
}

// Stores a curve node at a depth in mm, and returns its rounded value.
fn store_point(z: f32, value: f32) -> f32 {
    return store_node((z - light.depth_start_mm) * params.depth_steps_per_mm, value);
}

// Returns the largest error in transmittance that compression may make.
fn largest_error() -> f32 {
    return params.epsilon;
}

// Reports a ray that was not marched to its end.
fn report_cut_ray() {
    atomicAdd(&counters.texels_cut, 1u);
}

// Reports a texel whose stored polyline may have more nodes than necessary.
fn count_narrowed() {
    atomicAdd(&counters.texels_narrowed, 1u);
}

#ifdef WORKGROUP_SUMS
// Counters of this workgroup: one thread adds them to those of the pass, since the threads of a card that add to one
// address wait for each other.
struct WorkgroupSums {
    nodes_total: atomic<u32>,
    nodes_max: atomic<u32>,
    quads_needed: atomic<u32>,
    requested_rows: atomic<u32>,
    incomplete: atomic<u32>,
}

var<workgroup> sums: WorkgroupSums;

// Adds the counters of the workgroup to those of the pass. All threads of the workgroup call it, with a record of the
// workgroup's tile.
fn add_counts(record: u32, thread: u32) {
    workgroupBarrier();
    let quads_needed = atomicLoad(&sums.quads_needed);
    if thread == 0u && quads_needed > 0u {
        atomicAdd(&counters.nodes_total, atomicLoad(&sums.nodes_total));
        atomicMax(&counters.nodes_max, atomicLoad(&sums.nodes_max));
        atomicAdd(&counters.quads_needed, quads_needed);
        let tile = record / TILE_TEXELS;
        atomicAdd(&requested_rows[2u * tile], atomicLoad(&sums.requested_rows));
        atomicAdd(&requested_rows[2u * tile + 1u], atomicLoad(&sums.incomplete));
    }
}
#endif

// Adds the rows of a texel to the counters, and the texel to its block.
fn count_rows() {
    let requested = (rows.count - 1u) / ROW_NODES;
    let incomplete = select(0u, 1u, rows.row == NO_ROW);
    // A head holds four nodes, or three in front of tail quads.
    let quads_needed = 1u + select(0u, rows.count / 4u, rows.count > 4u);
    atomicOr(&blocks[block_of_record(rows.record)].mask, 1u << bit_of_record(rows.record));
#ifdef WORKGROUP_SUMS
    atomicAdd(&sums.nodes_total, rows.count);
    atomicMax(&sums.nodes_max, rows.count);
    atomicAdd(&sums.quads_needed, quads_needed);
    atomicAdd(&sums.requested_rows, requested);
    atomicAdd(&sums.incomplete, incomplete);
#else
    atomicAdd(&counters.nodes_total, rows.count);
    atomicMax(&counters.nodes_max, rows.count);
    atomicAdd(&counters.quads_needed, quads_needed);
    // Not in `store_node`: llvmpipe of Mesa 22.3 crashes on atomics in loops whose addresses differ between lanes.
    let tile = rows.record / TILE_TEXELS;
    atomicAdd(&requested_rows[2u * tile], requested);
    atomicAdd(&requested_rows[2u * tile + 1u], incomplete);
#endif
}

// Updates the counters and fills the row, so that its node count need not be stored; `value` is
// that of the last node.
fn finish_nodes(value: f32) {
    // Rows of texels without nodes are not read.
    if rows.count == 0u { return; }
    count_rows();
    if rows.row == NO_ROW { return; }
    let tail = node_word(FILLER, value);
    for (var i = 0u; i <= ROW_NODES; i++) {
        if rows.used > ROW_NODES { break; }
        put(select(tail, NO_ROW, rows.used == ROW_NODES));
    }
    if rows.used <= ROW_NODES { report_iteration_limit(); }
}

#ifdef RAY_STATES
// Stores the place and the words of the present row of a ray that waits.
fn save_nodes() {
    put_word(rows.row);
    put_word(rows.used);
    put_word(rows.count);
    put_words(rows.half_row);
}

fn load_nodes() {
    rows.row = take_word();
    rows.used = take_word();
    rows.count = take_word();
    rows.half_row = take_words();
}
#endif
