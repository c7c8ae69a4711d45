// A picture's frame, and the pixels of a workgroup: one of the picture's tiles.
#define_import_path umbravox::frame

struct Frame {
    // Grid-space centre of a plane across the view near the volume (keeps float32 rays exact for far eyes).
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
    // 1 where the shading counts, 0 where it is only computed (forced).
    shading_weight: f32,
    world_y: vec3<f32>,
    // Tiles of the list in which rays are cast; in the rest nothing can show.
    tiles_cast: u32,
    world_z: vec3<f32>,
    padding_c: f32,
    // Linear light of this pass's light on a lit point, less the ambient share; read with LIGHT_FACTOR alone.
    light: vec3<f32>,
    // 1 where the pass adds to what passes of other lights have left in the picture.
    adds: u32,
}

struct Tile {
    // Pixel of its corner.
    at: vec2<u32>,
    // Depths between which active bricks may show in it, mm along the view from the frame's plane.
    nearest_mm: f32,
    farthest_mm: f32,
}

@group(2) @binding(0) var<uniform> frame: Frame;
@group(2) @binding(1) var<storage, read_write> picture: array<vec4<f32>>;
@group(2) @binding(3) var<storage, read> tiles: array<Tile>;

struct Pixel {
    // False for workgroups past the tiles asked for, and for pixels of a tile that lie outside the picture.
    inside: bool,
    at: vec2<u32>,
    // Place in the band.
    index: u32,
    nearest_mm: f32,
    farthest_mm: f32,
}

// The pixel of a thread in a pass over the tiles from `first` to before `end`; the list is spread over the picture already.
fn pixel_of(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>, first: u32, end: u32) -> Pixel {
    let place = group.y * groups.x + group.x + first;
    let tile = tiles[min(place, arrayLength(&tiles) - 1u)];
    let at = local.xy + tile.at;
    let row = at.y - frame.first_row;
    let inside = place < end && at.x < frame.size.x && row < frame.rows;
    return Pixel(inside, at, row * frame.size.x + at.x, tile.nearest_mm, tile.farthest_mm);
}
