// The texel of a thread in a pass over tiles: a workgroup a tile of the list, a thread a texel.
#define_import_path umbravox::tiles

#import umbravox::dispatch::spread
#import umbravox::light::light
#import umbravox::tile_table::TILE

// Tiles that this dispatch builds, as numbers row by row.
@group(2) @binding(0) var<storage, read> tile_list: array<u32>;

struct TileTexel {
    // False for workgroups past the list, and for texels of a tile at the border that lie outside the map.
    inside: bool,
    texel: vec2<u32>,
    // Place of the tile in this dispatch's list, and of the texel in that.
    place: u32,
}

fn tile_texel(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> TileTexel {
    let index = spread(group.y * groups.x + group.x, groups.x * groups.y);
    let tile = tile_list[min(index, arrayLength(&tile_list) - 1u)];
    let texel = vec2<u32>(tile % light.tiles_across, tile / light.tiles_across) * TILE + local.xy;
    let inside = index < arrayLength(&tile_list) && all(texel < vec2<u32>(light.map_size));
    return TileTexel(inside, texel, (index * TILE + local.y) * TILE + local.x);
}
