// Counts the curve nodes of each texel of a tiled deep shadow map (Hadwiger et al. 2006, Figure 5 shows them by
// tile).

#import umbravox::light::light
#import umbravox::tile_table::{record_of, NO_TILE}
#import umbravox::dsm_layout::{row_texel, NO_ROW, FILLER, MAX_ROWS}

@group(1) @binding(3) var node_rows: texture_2d<u32>;
// First texel, numbered row by row, that this dispatch counts.
@group(2) @binding(0) var<storage, read> first_texel: array<u32>;
@group(2) @binding(1) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(#{LINE_THREADS})
fn count(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * #{LINE_THREADS} + id.x;
    if i >= arrayLength(&counts) { return; }
    let index = first_texel[0] + i;
    let texel = vec2<u32>(index % light.map_size, index / light.map_size);
    if texel.y >= light.map_size { return; }
    var row = record_of(texel);
    // Tiles without rows differ from tiles whose rays meet no extinction.
    if row == NO_TILE {
        counts[i] = NO_TILE;
        return;
    }
    var nodes = 0u;
    for (var rows = 0u; rows < MAX_ROWS; rows++) {
        let head = textureLoad(node_rows, row_texel(row), 0);
        let tail = textureLoad(node_rows, row_texel(row) + vec2<u32>(1u, 0u), 0);
        let in_head = select(vec4<u32>(0u), vec4<u32>(1u), (head >> vec4<u32>(16u)) < vec4<u32>(FILLER));
        let in_tail = select(vec3<u32>(0u), vec3<u32>(1u), (tail.xyz >> vec3<u32>(16u)) < vec3<u32>(FILLER));
        nodes += in_head.x + in_head.y + in_head.z + in_head.w + in_tail.x + in_tail.y + in_tail.z;
        row = tail.w;
        if row == NO_ROW { break; }
    }
    counts[i] = nodes;
}
