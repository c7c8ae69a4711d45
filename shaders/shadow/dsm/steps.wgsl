// Lists the depths, in steps, of all curve nodes of some texels, for tests of the error bound.

#import umbravox::light::light
#import umbravox::tile_table::{record_of, NO_TILE}
#import umbravox::dsm_layout::{row_texel, NO_ROW, FILLER, MAX_ROWS}

@group(1) @binding(3) var node_rows: texture_2d<u32>;
// For each thread: the texel (numbered row by row), and the index in `steps` at which its nodes begin.
@group(2) @binding(0) var<storage, read> texels: array<vec2<u32>>;
@group(2) @binding(1) var<storage, read_write> steps: array<u32>;

fn put(index: u32, word: u32) -> u32 {
    let step = word >> 16u;
    if step < FILLER && index < arrayLength(&steps) { steps[index] = step; }
    return index + select(0u, 1u, step < FILLER);
}

@compute @workgroup_size(#{LINE_THREADS})
fn list(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * #{LINE_THREADS} + id.x;
    if i >= arrayLength(&texels) { return; }
    let index = texels[i].x;
    var row = record_of(vec2<u32>(index % light.map_size, index / light.map_size));
    if row == NO_TILE { return; }
    var next = texels[i].y;
    for (var rows = 0u; rows < MAX_ROWS; rows++) {
        let head = textureLoad(node_rows, row_texel(row), 0);
        let tail = textureLoad(node_rows, row_texel(row) + vec2<u32>(1u, 0u), 0);
        for (var n = 0u; n < 4u; n++) { next = put(next, head[n]); }
        for (var n = 0u; n < 3u; n++) { next = put(next, tail[n]); }
        row = tail.w;
        if row == NO_ROW { break; }
    }
}
