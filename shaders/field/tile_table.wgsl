// Layout table of a tiled shadow map (Hadwiger et al. 2006, 3.4): it leads from a texel to its record.
#define_import_path umbravox::tile_table

#import umbravox::light::{light, OCTAHEDRAL}
#import umbravox::work::{count_work, LOADS}

const TILE: u32 = #{TILE};
const NO_TILE: u32 = #{NO_TILE};

// Index of the first record of each tile of the shadow map, or NO_TILE for tiles without active bricks. The records
// of a tile are consecutive.
@group(1) @binding(2) var tile_table: texture_2d<u32>;

// Returns the record index of a shadow-map texel, or NO_TILE.
fn record_of(texel: vec2<u32>) -> u32 {
    count_work(LOADS, 1u);
    let first = textureLoad(tile_table, texel / TILE, 0).x;
    return select(first + (texel.y % TILE) * TILE + texel.x % TILE, NO_TILE, first == NO_TILE);
}

// Wraps a texel that may lie outside the shadow map: an octahedral map continues at the mirrored position on the same
// edge.
fn wrapped_texel(texel: vec2<i32>) -> vec2<u32> {
    let last = i32(light.map_size) - 1;
    var t = texel;
    if light.projection == OCTAHEDRAL {
        if t.x < 0 || t.x > last { t = vec2<i32>(clamp(t.x, 0, last), last - t.y); }
        if t.y < 0 || t.y > last { t = vec2<i32>(last - t.x, clamp(t.y, 0, last)); }
    }
    return vec2<u32>(clamp(t, vec2<i32>(0), vec2<i32>(last)));
}
