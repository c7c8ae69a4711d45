// Shadow-map texel of a thread in a pass over tiles: one thread for each texel, and one or several workgroups for
// each tile of the list.
#define_import_path umbravox::tiles

#import umbravox::tuning::{workgroup_item, WORKGROUP_SIDE}
#import umbravox::light::light
#import umbravox::tile_table::TILE

// Tiles of the shadow map that this dispatch builds, numbered row by row.
@group(2) @binding(0) var<storage, read> tile_list: array<u32>;

// Number of workgroups along a side of a tile, and for the whole tile.
const ACROSS: u32 = TILE / WORKGROUP_SIDE;
const WORKGROUPS: u32 = ACROSS * ACROSS;

struct TileTexel {
    // False for workgroups past the list of tiles, and for texels of a border tile that lie outside the map.
    inside: bool,
    texel: vec2<u32>,
    // Index of the texel, counted tile by tile in the order of the list.
    index: u32,
}

fn tile_texel(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> TileTexel {
    let item = workgroup_item(group.y * groups.x + group.x, groups.x * groups.y);
    let part = item % WORKGROUPS;
    let entry = item / WORKGROUPS;
    let tile = tile_list[min(entry, arrayLength(&tile_list) - 1u)];
    let in_tile = vec2<u32>(part % ACROSS, part / ACROSS) * WORKGROUP_SIDE + local.xy;
    let texel = vec2<u32>(tile % light.tiles_across, tile / light.tiles_across) * TILE + in_tile;
    let inside = entry < arrayLength(&tile_list) && all(texel < vec2<u32>(light.map_size));
    return TileTexel(inside, texel, (entry * TILE + in_tile.y) * TILE + in_tile.x);
}
