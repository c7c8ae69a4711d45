// Lists the depths, in steps, of all curve nodes of some texels, for tests of the error bound.

#import umbravox::light::light
#import umbravox::dsm_directory::{head_of, NO_HEAD}
#import umbravox::dsm_layout::{quad_texel, node_step, CONTINUES, FILLER, MAX_NODES}

@group(1) @binding(3) var quads: texture_2d<u32>;
// For each thread: the texel (numbered row by row), and the index in `steps` at which its nodes begin.
@group(2) @binding(0) var<storage, read> texels: array<vec2<u32>>;
@group(2) @binding(1) var<storage, read_write> steps: array<u32>;

// Lists the nodes among the first `count` words of a quad; returns the index behind the last of them.
fn list_quad(first: u32, words: vec4<u32>, count: u32) -> u32 {
    var index = first;
    for (var n = 0u; n < count; n++) {
        let step = node_step(words[n]);
        if step < FILLER && index < arrayLength(&steps) { steps[index] = step; }
        index += select(0u, 1u, step < FILLER);
    }
    return index;
}

@compute @workgroup_size(#{LINE_THREADS})
fn list(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * #{LINE_THREADS} + id.x;
    if i >= arrayLength(&texels) { return; }
    let index = texels[i].x;
    let head = head_of(vec2<u32>(index % light.map_size, index / light.map_size));
    if head == NO_HEAD { return; }
    let first = textureLoad(quads, quad_texel(head), 0);
    let has_tail = (first.x & CONTINUES) != 0u;
    var next = list_quad(texels[i].y, first, select(4u, 3u, has_tail));
    if !has_tail { return; }
    for (var i = 0u; i < MAX_NODES / 4u; i++) {
        let words = textureLoad(quads, quad_texel(first.w + i), 0);
        next = list_quad(next, words, 4u);
        if (words.w & CONTINUES) == 0u { break; }
    }
}
