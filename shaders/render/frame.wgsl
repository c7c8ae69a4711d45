// Camera and size of a picture, and the pixels of a workgroup, which is one tile of the picture.
#define_import_path umbravox::frame

#ifdef DEVICE_TILES
#import umbravox::tile_depths::{TileDepths, key_depth}
#endif

struct Frame {
    // Centre, in grid space, of a plane across the view near the volume. Rays start there, so that float32 stays
    // exact for far eyes.
    plane_center: vec3<f32>,
    plane_distance_mm: f32,
    // Grid units per mm along the camera's axes.
    grid_forward: vec3<f32>,
    step_mm: f32,
    grid_right: vec3<f32>,
    ambient: f32,
    grid_up: vec3<f32>,
    // First row of this band of the picture.
    first_row: u32,
    background: vec3<f32>,
    rows: u32,
    // Half extents of the picture at unit distance: (W/H) tan(fov/2), tan(fov/2).
    half_extent: vec2<f32>,
    size: vec2<u32>,
    // World mm per grid unit (columns), for shading.
    world_x: vec3<f32>,
    // Weight of the shading: 0 if it is computed but not used (`--no-skip gradients`), else 1.
    shading_weight: f32,
    world_y: vec3<f32>,
    // Number of tiles at the start of the list for which rays are cast; the other tiles show only the background.
    tiles_cast: u32,
    world_z: vec3<f32>,
    // Mean cosine of the phase function (`umbravox::shading` of render/phase.wgsl).
    mean_cosine: f32,
    // Light of this pass on a fully lit point, linear RGB, without the ambient part (LIGHT_FACTOR).
    light: vec3<f32>,
    // 1 if this pass adds its light to the picture of earlier passes, else 0.
    adds: u32,
    // Part of the picture that this dispatch draws: its first tile, and its number of tiles along each axis.
    first_tile: vec2<u32>,
    part_tiles: vec2<u32>,
}

@group(2) @binding(0) var<uniform> frame: Frame;
@group(2) @binding(1) var<storage, read_write> picture: array<vec4<f32>>;
#ifdef DEVICE_TILES
@group(2) @binding(3) var<storage, read> tile_depths: TileDepths;
#else
struct Tile {
    // Pixel of the tile's corner.
    at: vec2<u32>,
    // Range of depths in which active bricks may lie, mm along the view from the frame's plane.
    nearest_mm: f32,
    farthest_mm: f32,
}
@group(2) @binding(3) var<storage, read> tiles: array<Tile>;
#endif

struct Pixel {
    // False for workgroups past the range of tiles, for tiles that the pass leaves to another one, and for pixels of a
    // tile that lie outside the picture.
    inside: bool,
    at: vec2<u32>,
    // Index of the pixel in the present band of the picture.
    index: u32,
    nearest_mm: f32,
    farthest_mm: f32,
}

#ifdef DEVICE_TILES
// Side of a block of tiles that follow a Z-order curve, see `WorkOrder` in src/gpu/tuning.rs.
const BLOCK_SIDE: u32 = #{BLOCK_SIDE};

// Returns every second bit of a number below 64.
fn even_bits(i: u32) -> u32 {
    return (i & 1u) | ((i >> 1u) & 2u) | ((i >> 2u) & 4u);
}

// Returns the pixel of a thread in a pass over all tiles of a part of the picture, block by block: a pixel of a tile
// with bricks, or of one without.
fn pixel_of(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>, with_bricks: bool) -> Pixel {
    let item = group.y * groups.x + group.x;
    let block = item / (BLOCK_SIDE * BLOCK_SIDE);
    let across = (frame.part_tiles.x + BLOCK_SIDE - 1u) / BLOCK_SIDE;
    let in_block = item % (BLOCK_SIDE * BLOCK_SIDE);
    let in_part = vec2<u32>(block % across, block / across) * BLOCK_SIDE
        + vec2<u32>(even_bits(in_block), even_bits(in_block >> 1u));
    let tile = frame.first_tile + in_part;
    let at = tile * #{PICTURE_SIDE} + local.xy;
    let row = at.y - frame.first_row;
    let tiles_across = (frame.size.x + #{PICTURE_SIDE} - 1u) / #{PICTURE_SIDE};
    let own = tile_depths.tiles[min(tile.y * tiles_across + tile.x, arrayLength(&tile_depths.tiles) - 1u)];
    let keys = max(own, tile_depths.everywhere);
    let inside = all(in_part < frame.part_tiles) && at.x < frame.size.x && row < frame.rows;
    return Pixel(
        inside && (keys.x > 0u) == with_bricks,
        at,
        row * frame.size.x + at.x,
        -key_depth(keys.x),
        key_depth(keys.y),
    );
}

// Returns the pixel of a thread in a pass that casts eye rays.
fn ray_pixel(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> Pixel {
    return pixel_of(group, groups, local, true);
}

// Returns the pixel of a thread in a pass that fills tiles without bricks.
fn background_pixel(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> Pixel {
    return pixel_of(group, groups, local, false);
}
#else
// Returns the pixel of a thread in a pass over the tiles from `first` to before `end`. The host orders the list of
// tiles, also for software adapters.
fn pixel_of(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>, first: u32, end: u32) -> Pixel {
    let item = group.y * groups.x + group.x + first;
    let tile = tiles[min(item, arrayLength(&tiles) - 1u)];
    let at = local.xy + tile.at;
    let row = at.y - frame.first_row;
    let inside = item < end && at.x < frame.size.x && row < frame.rows;
    return Pixel(inside, at, row * frame.size.x + at.x, tile.nearest_mm, tile.farthest_mm);
}

// Returns the pixel of a thread in a pass that casts eye rays.
fn ray_pixel(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> Pixel {
    return pixel_of(group, groups, local, 0u, frame.tiles_cast);
}

// Returns the pixel of a thread in a pass that fills tiles without bricks.
fn background_pixel(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> Pixel {
    return pixel_of(group, groups, local, frame.tiles_cast, arrayLength(&tiles));
}
#endif
