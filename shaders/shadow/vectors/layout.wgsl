// Where a map of vectors keeps what: an atlas of tiles, each with a margin of one texel that repeats its neighbours', so
// that a filter never leaves a tile. A texel's vectors lie in planes of the tile, one below the other.
#define_import_path umbravox::vectors

#import umbravox::tile_table::{TILE, tile_table}
#import umbravox::work::{count_work, LOADS}

const VECTORS: u32 = #{VECTORS};
// Texels a side of a tile with its margin.
const TILE_SIDE: u32 = TILE + 2u;

struct Own {
    // What the method sets.
    a: vec4<f32>,
    b: vec4<f32>,
    // Texels per texel of the atlas' sides.
    inv_size: vec2<f32>,
    // Optical depth at which a ray is over.
    most_depth: f32,
    // Tiles across the atlas.
    tiles_across: u32,
}

@group(1) @binding(1) var<uniform> own: Own;

// The corner of a tile's first plane in the atlas, margin included, by the number of its first record.
fn tile_corner(first: u32) -> vec2<u32> {
    let place = first / (TILE * TILE);
    return vec2<u32>(place % own.tiles_across, (place / own.tiles_across) * VECTORS) * TILE_SIDE;
}

// The first record of a tile of the map.
fn first_record(tile: vec2<u32>) -> u32 {
    count_work(LOADS, 1u);
    return textureLoad(tile_table, tile, 0).x;
}
