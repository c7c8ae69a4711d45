// Counts the curve nodes of each texel of a tiled deep shadow map (Hadwiger et al. 2006, Figure 5 shows them by
// tile).

#import umbravox::light::light
#import umbravox::tile_table::{record_of, NO_TILE}
#import umbravox::dsm_directory::{head_of, NO_HEAD}
#import umbravox::dsm_layout::{quad_texel, CONTINUES, FILLER, MAX_NODES}

@group(1) @binding(3) var quads: texture_2d<u32>;
// First texel, numbered row by row, that this dispatch counts.
@group(2) @binding(0) var<storage, read> first_texel: array<u32>;
@group(2) @binding(1) var<storage, read_write> counts: array<u32>;

fn nodes_in(words: vec4<u32>) -> u32 {
    let nodes = select(vec4<u32>(0u), vec4<u32>(1u), (words >> vec4<u32>(16u)) < vec4<u32>(FILLER));
    return nodes.x + nodes.y + nodes.z + nodes.w;
}

@compute @workgroup_size(#{LINE_THREADS})
fn count(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * #{LINE_THREADS} + id.x;
    if i >= arrayLength(&counts) { return; }
    let index = first_texel[0] + i;
    let texel = vec2<u32>(index % light.map_size, index / light.map_size);
    if texel.y >= light.map_size { return; }
    // Tiles without records differ from tiles whose rays meet no extinction.
    if record_of(texel) == NO_TILE {
        counts[i] = NO_TILE;
        return;
    }
    let head = head_of(texel);
    if head == NO_HEAD { return; }
    let first = textureLoad(quads, quad_texel(head), 0);
    var nodes = nodes_in(first);
    if (first.x & CONTINUES) != 0u {
        nodes = 3u;
        for (var i = 0u; i < MAX_NODES / 4u; i++) {
            let words = textureLoad(quads, quad_texel(first.w + i), 0);
            nodes += nodes_in(words);
            if (words.w & CONTINUES) == 0u { break; }
        }
    }
    counts[i] = nodes;
}
