// Copies the nodes of each texel of a deep shadow map from its rows to a head and consecutive tail quads.
//
// A head holds up to four nodes. With more nodes it holds three, and the index of the first tail quad.

#import umbravox::dsm_layout::{params, quad_texel, CONTINUES, FILLER, MAX_NODES}
#import umbravox::dsm_row_layout::{row_texel, NO_ROW, ROW_NODES}
#import umbravox::dsm_counters::{counters, blocks, block_of_record, bit_of_record}

@group(2) @binding(0) var node_rows: texture_2d<u32>;
@group(2) @binding(6) var quads: texture_storage_2d<rgba32uint, write>;

const MAX_ROWS: u32 = MAX_NODES / ROW_NODES + 2u;

// Returns a half row: four nodes, or three nodes and the link to the next row.
fn half_row(row: u32, half: u32) -> vec4<u32> {
    return textureLoad(node_rows, row_texel(row) + vec2<u32>(half, 0u), 0);
}

// Returns the number of nodes in the words of a row, which a filler ends unless the row is full.
fn nodes_in_row(head: vec4<u32>, tail: vec4<u32>) -> u32 {
    let in_head = select(vec4<u32>(0u), vec4<u32>(1u), (head >> vec4<u32>(16u)) < vec4<u32>(FILLER));
    let in_tail = select(vec3<u32>(0u), vec3<u32>(1u), (tail.xyz >> vec3<u32>(16u)) < vec3<u32>(FILLER));
    return in_head.x + in_head.y + in_head.z + in_head.w + in_tail.x + in_tail.y + in_tail.z;
}

// Returns the number of nodes in a row and those that follow it.
fn nodes_from(first: u32) -> u32 {
    var count = 0u;
    var row = first;
    for (var rows = 0u; rows < MAX_ROWS; rows++) {
        if row == NO_ROW { break; }
        let tail = half_row(row, 1u);
        count += nodes_in_row(half_row(row, 0u), tail);
        row = tail.w;
    }
    return count;
}

fn store(quad: u32, words: vec4<u32>) {
    if quad < params.quads { textureStore(quads, quad_texel(quad), words); }
}

// Copies the nodes of a row and of those that follow it to consecutive quads, the last of which is filled up.
fn copy_rows(first_row: u32, count: u32, first_quad: u32) {
    var row = first_row;
    var words = vec4<u32>(0u);
    var quad = vec4<u32>(0u);
    var in_row = 0u;
    for (var i = 0u; i < count; i++) {
        if in_row == ROW_NODES {
            row = words.w;
            in_row = 0u;
        }
        if (in_row & 3u) == 0u { words = half_row(row, in_row >> 2u); }
        let word = words[in_row & 3u];
        let place = i & 3u;
        let is_last = i + 1u == count;
        let filler = (FILLER << 16u) | (word & 0xffffu);
        quad = select(quad, vec4<u32>(filler), vec4<u32>(place) < vec4<u32>(0u, 1u, 2u, 3u));
        let flag = select(0u, CONTINUES, place == 3u && !is_last);
        quad = select(quad, vec4<u32>(word | flag), vec4<u32>(place) == vec4<u32>(0u, 1u, 2u, 3u));
        if place == 3u || is_last { store(first_quad + i / 4u, quad); }
        in_row += 1u;
    }
}

@compute @workgroup_size(#{LINE_THREADS})
fn compact(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let record = id.y * groups.x * #{LINE_THREADS} + id.x;
    if record >= params.tile_rows { return; }
    let block = block_of_record(record);
    let bit = 1u << bit_of_record(record);
    let mask = atomicLoad(&blocks[block].mask);
    if (mask & bit) == 0u { return; }
    let head = blocks[block].first_head + countOneBits(mask & (bit - 1u));
    // The first row is a head, and a tail quad if it has more than four nodes.
    var words = half_row(record, 0u);
    let half = half_row(record, 1u);
    let more_nodes = nodes_from(half.w);
    if nodes_in_row(words, half) > 4u {
        let tail = atomicAdd(&counters.quads, 1u + (more_nodes + 3u) / 4u);
        let flag = select(0u, CONTINUES, more_nodes > 0u);
        store(tail, vec4<u32>(words.w, half.xy, half.z | flag));
        copy_rows(half.w, more_nodes, tail + 1u);
        words = vec4<u32>(words.x | CONTINUES, words.yz, tail);
    }
    store(head, words);
}
