// Packs layers of a light volume into a texture format of fewer bits: one thread for each word.

#import umbravox::lattice::lattice

struct Layers {
    first: u32,
    count: u32,
    row_words: u32,
}

@group(2) @binding(0) var<storage, read> layers: Layers;
@group(2) @binding(1) var<storage, read_write> words: array<u32>;
@group(2) @binding(2) var light_volume: texture_3d<f32>;

fn node_at(x: u32, row: vec2<u32>) -> f32 {
    return textureLoad(light_volume, vec3<u32>(min(x, lattice.counts.x - 1u), row), 0).x;
}

@compute @workgroup_size(8, 8)
fn pack(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= layers.row_words || id.y >= lattice.counts.y || id.z >= layers.count { return; }
    let row = vec2<u32>(id.y, layers.first + id.z);
#ifdef BITS_8
    let x = 4u * id.x;
    let word = pack4x8unorm(vec4<f32>(node_at(x, row), node_at(x + 1u, row), node_at(x + 2u, row), node_at(x + 3u, row)));
#else
    let x = 2u * id.x;
    let word = pack2x16float(vec2<f32>(node_at(x, row), node_at(x + 1u, row)));
#endif
    words[(id.z * lattice.counts.y + id.y) * layers.row_words + id.x] = word;
}
