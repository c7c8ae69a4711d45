// Depth ranges of the tiles of a picture, which a pass over bricks finds (`render/project.wgsl`). Ranges are stored as
// integer keys in the order of the depths, since atomics have no floats.
#define_import_path umbravox::tile_depths

struct TileDepths {
    // Number of tiles with a range of their own.
    touched: u32,
    padding: u32,
    // Range of the bricks that cover all tiles.
    everywhere: vec2<u32>,
    // For each tile, row by row: key of the negative nearest depth, and of the farthest depth; 0 without bricks.
    tiles: array<vec2<u32>>,
}

// Returns a key whose order is that of the depths; it is never 0.
fn depth_key(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    return select(bits | 0x80000000u, ~bits, (bits >> 31u) == 1u);
}

// Returns the depth of a key.
fn key_depth(key: u32) -> f32 {
    return bitcast<f32>(select(~key, key & 0x7fffffffu, (key >> 31u) == 1u));
}
