// Layout of a tiled deep shadow map (Hadwiger et al. 2006, 3.3 and 3.4). A curve node is one word: depth within the
// map's range in the upper 16 bits, transmittance or its logarithm in the next 15, and a flag.
#define_import_path umbravox::dsm_layout

#import umbravox::segments::LEAST_VALUE

// Largest stored depth, which is the end of the map. The filler behind the last node of a texel lies one step farther.
const DEPTH_STEPS: f32 = #{DEPTH_STEPS};
const FILLER: u32 = #{FILLER};
// Largest number of steps of the regular lattice on a ray.
const MAX_LATTICE_STEPS: u32 = #{MAX_LATTICE_STEPS};
// Largest number of nodes of one texel: two for each depth step.
const MAX_NODES: u32 = #{MAX_NODES};
// Value that the largest integer stands for; 0 stands for 0.
#ifdef OPTICAL_DEPTH
const FARTHEST_VALUE: f32 = LEAST_VALUE;
#else
const FARTHEST_VALUE: f32 = 1.0;
#endif
const LARGEST_INTEGER: f32 = 32767.0;
// Flag in the first word of a head: its last word is the index of the texel's first tail quad. Flag in the last word
// of a tail quad: the texel has another one behind it.
const CONTINUES: u32 = 1u;

struct Params {
    // Error bound of the compression, and the largest optical depth of a piece at transmittance 1 whose chord stays
    // within the tolerance.
    epsilon: f32,
    longest_depth: f32,
    // Distance between depths of the regular lattice, mm.
    step_mm: f32,
    // Index of the first row behind the first rows of all texels, and number of rows in the pool.
    tile_rows: u32,
    pool_rows: u32,
    taps: u32,
    // Offset added to the depth of a shadow query, mm; negative towards the light.
    depth_offset_mm: f32,
    depth_steps_per_mm: f32,
    // Largest weight of neighbours that rounding may give on a light ray through a texel centre.
    least_weight: f32,
    // Number of quads of nodes for which the map has space, and the binary logarithm of the width of their texture.
    quads: u32,
    quads_width_shift: u32,
    // Error bound of the stored transmittance of an enclosing curve.
    transmittance_error: f32,
}

@group(1) @binding(1) var<uniform> params: Params;

// Returns the word of a node with a value: transmittance, or its logarithm (OPTICAL_DEPTH).
fn node_word(step: u32, value: f32) -> u32 {
    let share = clamp(value / FARTHEST_VALUE, 0.0, 1.0);
    return (step << 16u) | (u32(round(share * LARGEST_INTEGER)) << 1u);
}

fn node_step(word: u32) -> u32 {
    return word >> 16u;
}

fn node_value(word: u32) -> f32 {
    return f32((word & 0xffffu) >> 1u) * (FARTHEST_VALUE / LARGEST_INTEGER);
}

// Returns the position of a quad of nodes in the texture of the finished map.
fn quad_texel(quad: u32) -> vec2<u32> {
    return vec2<u32>(quad & ((1u << params.quads_width_shift) - 1u), quad >> params.quads_width_shift);
}
