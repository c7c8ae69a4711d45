// Projects the outer active bricks into a picture: for each tile of the picture, the range of depths in which bricks
// may lie. One thread for each brick. src/render/eye_tiles.rs does the same on the host, in float64.

#import umbravox::tile_depths::{depth_key}

struct Projection {
    // Axes of a brick in the camera's axes (right, up, forward), mm.
    brick_x: vec3<f32>,
    // Radius of a sphere around a brick, mm, with a margin for rounding.
    radius_mm: f32,
    brick_y: vec3<f32>,
    // Distance from the eye to the plane from which depths count, mm.
    plane_distance_mm: f32,
    brick_z: vec3<f32>,
    // Number of bricks.
    bricks: u32,
    // Centre of the first brick: right and up from the eye, forward from the plane, mm.
    first_center: vec3<f32>,
    // 1 if the eye lies among active bricks, else 0.
    inside: u32,
    pixels_per_tangent: vec2<f32>,
    size: vec2<f32>,
    // Number of tiles of the picture along each axis.
    tiles: vec2<u32>,
    padding: vec2<u32>,
}

// Margin around the projection of a brick, in pixels.
const PIXELS_AROUND: f32 = #{PIXELS_AROUND};
const FAR: f32 = #{FAR};

@group(0) @binding(0) var<uniform> projection: Projection;
// Positions of the bricks: x in the low and y in the high half of the first word, z in the second.
@group(0) @binding(1) var<storage, read> bricks: array<vec2<u32>>;
// The words of `umbravox::tile_depths::TileDepths`.
@group(0) @binding(2) var<storage, read_write> depths: array<atomic<u32>>;

const TOUCHED: u32 = 0u;
const EVERYWHERE: u32 = 2u;
const TILES: u32 = 4u;

// Returns the first and one past the last tile that a range of pixels touches, with a margin.
fn tiles_of(range: vec2<f32>, size: f32) -> vec2<u32> {
    let lo = range.x - PIXELS_AROUND;
    let hi = range.y + PIXELS_AROUND;
    let first = u32(clamp(lo, 0.0, size - 1.0)) / #{PICTURE_SIDE};
    let last = u32(clamp(hi, 0.0, size - 1.0)) / #{PICTURE_SIDE};
    return select(vec2<u32>(first, last + 1u), vec2<u32>(0u), hi < 0.0 || lo >= size);
}

// Returns the range of pixels of a sphere along one axis. A sphere that reaches behind the eye is bounded only on its
// far side.
fn pixels_of(side: f32, per_near: f32, per_far: f32, scale: f32, size: f32) -> vec2<f32> {
    let lo = side - projection.radius_mm;
    let hi = side + projection.radius_mm;
    let least = lo * select(per_near, per_far, lo > 0.0);
    let most = hi * select(per_near, per_far, hi < 0.0);
    return 0.5 * size + scale * vec2<f32>(least, most);
}

@compute @workgroup_size(#{LINE_THREADS})
fn project(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * #{LINE_THREADS} + id.x;
    if i >= projection.bricks { return; }
    let words = bricks[i];
    let at = vec3<f32>(f32(words.x & 0xffffu), f32(words.x >> 16u), f32(words.y));
    let center = projection.first_center
        + (at.x * projection.brick_x + at.y * projection.brick_y + at.z * projection.brick_z);
    let near = center.z - projection.radius_mm;
    let far = center.z + projection.radius_mm;
    let far_mm = far + projection.plane_distance_mm;
    if far_mm <= 0.0 { return; }
    let near_mm = near + projection.plane_distance_mm;
    let from_eye = projection.inside == 1u || near_mm <= 0.0;
    let keys = vec2<u32>(depth_key(select(-near, FAR, from_eye)), depth_key(far));
    let per_near = 1.0 / max(near_mm, 1e-9);
    let per_far = 1.0 / far_mm;
    let scale = projection.pixels_per_tangent;
    let columns = tiles_of(pixels_of(center.x, per_near, per_far, scale.x, projection.size.x), projection.size.x);
    let rows = tiles_of(pixels_of(-center.y, per_near, per_far, scale.y, projection.size.y), projection.size.y);
    if all(vec2<u32>(columns.y - columns.x, rows.y - rows.x) == projection.tiles) {
        // Thousands of bricks around the eye may cover all tiles.
        atomicMax(&depths[EVERYWHERE], keys.x);
        atomicMax(&depths[EVERYWHERE + 1u], keys.y);
        return;
    }
    for (var y = rows.x; y < rows.y; y++) {
        for (var x = columns.x; x < columns.y; x++) {
            let tile = TILES + 2u * (y * projection.tiles.x + x);
            let before = atomicMax(&depths[tile], keys.x);
            atomicMax(&depths[tile + 1u], keys.y);
            if before == 0u { atomicAdd(&depths[TOUCHED], 1u); }
        }
    }
}
