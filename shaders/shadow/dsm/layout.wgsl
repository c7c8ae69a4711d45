// Layout of a tiled deep shadow map (Hadwiger et al. 2006, 3.3 and 3.4): rows of nodes in a texture.
#define_import_path umbravox::dsm_layout

const NO_ROW: u32 = #{NO_ROW};
const ROW_NODES: u32 = #{ROW_NODES};
// Width, in texels, of the texture that stores the curve nodes; a row has two texels of four words.
const NODE_TEXTURE_WIDTH: u32 = #{NODE_TEXTURE_WIDTH};
// Largest stored depth, which is the end of the map. The filler of a row behind its last node lies one step farther.
const DEPTH_STEPS: f32 = #{DEPTH_STEPS};
const FILLER: u32 = #{FILLER};
// Largest number of steps of the regular lattice on a ray.
const MAX_LATTICE_STEPS: u32 = #{MAX_LATTICE_STEPS};
// Largest number of rows of one texel: two nodes for each depth step, and the nodes of the last row.
const MAX_ROWS: u32 = #{MAX_ROWS};

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
    padding_a: f32,
    padding_b: f32,
    padding_c: f32,
}

@group(1) @binding(1) var<uniform> params: Params;

fn row_texel(row: u32) -> vec2<u32> {
    return vec2<u32>((2u * row) % NODE_TEXTURE_WIDTH, (2u * row) / NODE_TEXTURE_WIDTH);
}
