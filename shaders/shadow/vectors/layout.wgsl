// Layout of a shadow map that stores several vectors in each texel: an atlas of tiles. Each tile has a margin that
// repeats its neighbours, so that a filter never leaves a tile. The vectors of a texel lie in planes of the tile, one
// below the other.
#define_import_path umbravox::vectors

#import umbravox::tile_table::{TILE, tile_table}
#import umbravox::work::{count_work, LOADS}

const VECTORS: u32 = #{VECTORS};
// Width of the margin, and side of a tile with its margin, texels.
const TILE_MARGIN: u32 = #{TILE_MARGIN};
const TILE_SIDE: u32 = TILE + 2u * TILE_MARGIN;

// Parameters that all methods with vector maps share; those of one method are at binding 5.
struct VectorMap {
    // Reciprocal size of the atlas, 1 / texels.
    inv_size: vec2<f32>,
    // Optical depth at which a ray ends.
    max_depth: f32,
    // Number of tiles along a row of the atlas.
    tiles_across: u32,
}

@group(1) @binding(1) var<uniform> vector_map: VectorMap;

// Returns the corner of a tile's first plane in the atlas, margin included, from the tile's first record.
fn tile_corner(first: u32) -> vec2<u32> {
    let index = first / (TILE * TILE);
    return vec2<u32>(index % vector_map.tiles_across, (index / vector_map.tiles_across) * VECTORS) * TILE_SIDE;
}

// Returns the first record of a tile of the shadow map.
fn first_record(tile: vec2<u32>) -> u32 {
    count_work(LOADS, 1u);
    return textureLoad(tile_table, tile, 0).x;
}
