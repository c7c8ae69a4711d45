// Layout table of a tiled shadow map (Hadwiger et al. 2006, 3.4): it leads from a texel to its record.
#define_import_path umbravox::tile_table

#import umbravox::light::{light, OCTAHEDRAL}
#import umbravox::work::{count_work, LOADS}

const TILE: u32 = #{TILE};
const NO_TILE: u32 = #{NO_TILE};

// Index of the first record of each tile of the shadow map, or NO_TILE for tiles without active bricks. The records
// of a tile are consecutive.
@group(1) @binding(2) var tile_table: texture_2d<u32>;

// Returns the index of the first record of a tile, or NO_TILE.
fn tile_entry(tile: vec2<u32>) -> u32 {
    count_work(LOADS, 1u);
    return textureLoad(tile_table, tile, 0).x;
}

// Returns the record index of a shadow-map texel, or NO_TILE.
fn record_of(texel: vec2<u32>) -> u32 {
    let first = tile_entry(texel / TILE);
    return select(first + (texel.y % TILE) * TILE + texel.x % TILE, NO_TILE, first == NO_TILE);
}

// Wraps a texel that may lie outside the shadow map: an octahedral map continues at the mirrored position behind the
// same edge.
fn wrapped_texel(texel: vec2<i32>) -> vec2<u32> {
    let last = i32(light.map_size) - 1;
    var t = texel;
    if light.projection == OCTAHEDRAL {
        if t.x < 0 || t.x > last { t = vec2<i32>(select(-1, 2 * last + 1, t.x > last) - t.x, last - t.y); }
        if t.y < 0 || t.y > last { t = vec2<i32>(last - t.x, select(-1, 2 * last + 1, t.y > last) - t.y); }
    }
    return vec2<u32>(clamp(t, vec2<i32>(0), vec2<i32>(last)));
}

// Columns and rows of four texels.
struct FourTexels {
    x: vec4<u32>,
    y: vec4<u32>,
}

// Returns the texel at `base` and those at (1, 0), (0, 1) and (1, 1) from it, wrapped.
fn texels_around(base: vec2<i32>) -> FourTexels {
    let a = wrapped_texel(base);
    let b = wrapped_texel(base + vec2<i32>(1, 0));
    let c = wrapped_texel(base + vec2<i32>(0, 1));
    let d = wrapped_texel(base + vec2<i32>(1, 1));
    return FourTexels(vec4<u32>(a.x, b.x, c.x, d.x), vec4<u32>(a.y, b.y, c.y, d.y));
}

// Returns the record indices (or NO_TILE) of the texel at `base` and of those at (1, 0), (0, 1) and (1, 1) from it.
// Texels of one tile, as most are, share one read of the table.
fn records_around(base: vec2<i32>) -> vec4<u32> {
    let texels = texels_around(base);
    let tiles_x = texels.x / TILE;
    let tiles_y = texels.y / TILE;
    var first = vec4<u32>(tile_entry(vec2<u32>(tiles_x.x, tiles_y.x)));
    if any((tiles_x != tiles_x.xxxx) | (tiles_y != tiles_y.xxxx)) {
        first.y = tile_entry(vec2<u32>(tiles_x.y, tiles_y.y));
        first.z = tile_entry(vec2<u32>(tiles_x.z, tiles_y.z));
        first.w = tile_entry(vec2<u32>(tiles_x.w, tiles_y.w));
    }
    let records = first + (texels.y % TILE) * TILE + texels.x % TILE;
    return select(records, vec4<u32>(NO_TILE), first == vec4<u32>(NO_TILE));
}
