// Layout of a map of vectors: an atlas of tiles. Each tile has a margin of one texel that repeats its neighbours, so that a
// filter never leaves a tile. The vectors of a texel lie in planes of the tile, one below the other.
#define_import_path umbravox::vectors

#import umbravox::tile_table::{TILE, tile_table}
#import umbravox::work::{count_work, LOADS}

const VECTORS: u32 = #{VECTORS};
// Texels a side of a tile with its margin.
const TILE_SIDE: u32 = TILE + 2u;

// Parameters of every map of vectors; those of one method are at binding 5.
struct VectorMap {
    // 1 / size of the atlas in texels.
    inv_size: vec2<f32>,
    // Optical depth at which a ray ends.
    max_depth: f32,
    // Tiles across the atlas.
    tiles_across: u32,
}

@group(1) @binding(1) var<uniform> vector_map: VectorMap;

// Returns the corner of the first plane of a tile in the atlas, margin included, by the first record of the tile.
fn tile_corner(first: u32) -> vec2<u32> {
    let index = first / (TILE * TILE);
    return vec2<u32>(index % vector_map.tiles_across, (index / vector_map.tiles_across) * VECTORS) * TILE_SIDE;
}

// Returns the first record of a tile of the map.
fn first_record(tile: vec2<u32>) -> u32 {
    count_work(LOADS, 1u);
    return textureLoad(tile_table, tile, 0).x;
}
