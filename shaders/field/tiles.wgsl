// Shadow-map texel of a thread in a pass over tiles: one workgroup for each tile of the list, one thread for each
// texel.
#define_import_path umbravox::tiles

#import umbravox::quirks::workgroup_item
#import umbravox::light::light
#import umbravox::tile_table::TILE

// Tiles of the shadow map that this dispatch builds, numbered row by row.
@group(2) @binding(0) var<storage, read> tile_list: array<u32>;

struct TileTexel {
    // False for workgroups past the list of tiles, and for texels of a border tile that lie outside the map.
    inside: bool,
    texel: vec2<u32>,
    // Index of the texel, counted tile by tile in the order of the list.
    index: u32,
}

fn tile_texel(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> TileTexel {
    let item = workgroup_item(group.y * groups.x + group.x, groups.x * groups.y);
    let tile = tile_list[min(item, arrayLength(&tile_list) - 1u)];
    let texel = vec2<u32>(tile % light.tiles_across, tile / light.tiles_across) * TILE + local.xy;
    let inside = item < arrayLength(&tile_list) && all(texel < vec2<u32>(light.map_size));
    return TileTexel(inside, texel, (item * TILE + local.y) * TILE + local.x);
}
