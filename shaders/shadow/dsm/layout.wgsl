// What a tiled deep shadow map is made of (Hadwiger et al. 2006, 3.3 and 3.4): rows of nodes in a texture.
#define_import_path umbravox::dsm_layout

const NO_ROW: u32 = #{NO_ROW};
const ROW_NODES: u32 = #{ROW_NODES};
// Texels across the texture of nodes; a row is two texels of four words.
const NODE_TEXTURE_WIDTH: u32 = #{NODE_TEXTURE_WIDTH};
// Stored depths end at this step, which also stands for the end of the map; what fills a row behind its last node lies
// one further.
const DEPTH_STEPS: f32 = #{DEPTH_STEPS};
const FILLER: u32 = #{FILLER};
// Steps of a ray's regular lattice.
const MOST_LATTICE_STEPS: u32 = #{MOST_LATTICE_STEPS};
// Rows of one texel: two nodes a depth step, and those of the last row.
const MOST_ROWS: u32 = #{MOST_ROWS};

struct Own {
    // Error allowed to the compression, and the optical depth whose chord stays within the tolerance at transmittance 1.
    epsilon: f32,
    longest_depth: f32,
    // Distance of the regular lattice of depths, mm.
    step_mm: f32,
    // First row past those that belong to tiles, and rows in the pool.
    tile_rows: u32,
    pool_rows: u32,
    taps: u32,
    // Added to a depth before it is looked up, mm (towards the light where negative).
    depth_offset_mm: f32,
    depth_steps_per_mm: f32,
    // Neighbouring texels whose first depths differ by less see the same surface.
    same_surface_steps: f32,
    padding_a: f32,
    padding_b: f32,
    padding_c: f32,
}

@group(1) @binding(1) var<uniform> own: Own;

fn row_texel(row: u32) -> vec2<u32> {
    return vec2<u32>((2u * row) % NODE_TEXTURE_WIDTH, (2u * row) / NODE_TEXTURE_WIDTH);
}
