// The scalar field on the device: values, bricks and their distances. No transfer function in here.
//
// Grid space: g = index + 1, so that cell c = floor(g) interpolates the voxels c - 1 and c (clamped to the edge), the
// domain is [0.5, n + 0.5]^3 and brick b holds the cells BRICK_CELLS b .. BRICK_CELLS (b + 1) - 1.
#define_import_path umbravox::field

#import umbravox::work::{count_work, SAMPLES, LOADS}

const BRICK_CELLS: i32 = #{BRICK_CELLS};
// log2 of it.
const BRICK_SHIFT: vec3<u32> = vec3<u32>(#{BRICK_SHIFT});
const FAR: f32 = #{FAR};

struct Field {
    // Voxels along each axis.
    size: vec3<u32>,
    // Smallest voxel spacing, mm.
    min_spacing_mm: f32,
    inv_size: vec3<f32>,
    // Intervals of the transfer function (umbravox::transfer).
    intervals: u32,
    // Grid-space box of the active bricks, clipped to the domain.
    active_lo: vec3<f32>,
    // Values at or below this one have no extinction, nor have those at or above `last_value`; with LABELS whatever the
    // label, as the volume has them.
    first_value: f32,
    active_hi: vec3<f32>,
    last_value: f32,
    // Value bins and pair bins start at `bin_origin`; the integrals' bins at `table_origin`.
    bin_origin: f32,
    bins_per_value: f32,
    table_origin: f32,
    table_per_value: f32,
    // 1 / reference length (1/mm) where opacity is given, 0 where extinction is.
    inv_reference_length: f32,
    // Linear RGB of everything with extinction, where that is one colour (ONE_COLOR).
    color_r: f32,
    color_g: f32,
    color_b: f32,
    // With LABELS a value without extinction, behind all functions.
    hidden_value: f32,
    // Planes n·g >= d in grid space, as (n, d): what is kept. Those beyond the last keep everything. Read with CLIP.
    clip: array<vec4<f32>, #{MOST_CLIP_PLANES}>,
#ifdef FOLDED
    fold: Fold,
#endif
}

#ifdef FOLDED
// The grid is longer than a texture may be: tiles of it lie side by side in one (src/field/fold.rs).
struct Fold {
    // Voxels from a tile to the next, and tiles, along each axis of the grid.
    period: vec3<i32>,
    tiles: vec3<i32>,
    // Tiles along each axis of the texture, texels from one to the next, and of these the ones before its first voxel.
    placed: vec3<i32>,
    stride: vec3<i32>,
    margin: vec3<i32>,
    // 1 / texels of the texture.
    inv_sides: vec3<f32>,
}
#endif

@group(0) @binding(0) var<uniform> field: Field;
@group(0) @binding(1) var volume: texture_3d<f32>;
@group(0) @binding(2) var linear_clamp: sampler;
// Chebyshev distance of each brick to the nearest active one, in bricks: 0 is active.
@group(0) @binding(3) var brick_distance: texture_3d<u32>;

// The eight values that a cell interpolates, x fastest: lo = z - 1 layer, hi = z layer; (x-y-, x+y-, x-y+, x+y+).
struct Cell {
    lo: vec4<f32>,
    hi: vec4<f32>,
}

#ifdef FOLDED
// From the voxels that lie between `low` and the next one along each axis to their texels.
fn tile_offset(low: vec3<i32>) -> vec3<i32> {
    let tile = min(low / field.fold.period, field.fold.tiles - 1);
    let number = tile.x + field.fold.tiles.x * (tile.y + field.fold.tiles.y * tile.z);
    let row = number / field.fold.placed.x;
    let layer = row / field.fold.placed.y;
    let place = vec3<i32>(number - row * field.fold.placed.x, row - layer * field.fold.placed.y, layer);
    return place * field.fold.stride + field.fold.margin - tile * field.fold.period;
}
#endif

// The texels of the two voxels between which a cell lies.
struct CellEnds {
    low: vec3<i32>,
    high: vec3<i32>,
}

fn ends_of_cell(cell: vec3<i32>) -> CellEnds {
    let last = vec3<i32>(field.size) - 1;
    let low = clamp(cell - 1, vec3<i32>(0), last);
    let high = clamp(cell, vec3<i32>(0), last);
#ifdef FOLDED
    let offset = tile_offset(low);
    return CellEnds(low + offset, high + offset);
#else
    return CellEnds(low, high);
#endif
}

fn cell_values(cell: vec3<i32>) -> Cell {
    count_work(LOADS, 8u);
    let ends = ends_of_cell(cell);
    let a = ends.low;
    let b = ends.high;
    return Cell(
        vec4<f32>(
            textureLoad(volume, a, 0).x,
            textureLoad(volume, vec3<i32>(b.x, a.y, a.z), 0).x,
            textureLoad(volume, vec3<i32>(a.x, b.y, a.z), 0).x,
            textureLoad(volume, vec3<i32>(b.x, b.y, a.z), 0).x,
        ),
        vec4<f32>(
            textureLoad(volume, vec3<i32>(a.x, a.y, b.z), 0).x,
            textureLoad(volume, vec3<i32>(b.x, a.y, b.z), 0).x,
            textureLoad(volume, vec3<i32>(a.x, b.y, b.z), 0).x,
            textureLoad(volume, b, 0).x,
        ),
    );
}

// The values of a cell that lies one further along an axis (`along`) than one whose values are known, both as seen with
// some axes mirrored: four of them are the same, and four are read, on the face that is farther along. Where nothing is
// known yet those of the nearer face are read (not `held`): asked again, all eight are there.
fn next_cell_values(before: Cell, cell: vec3<i32>, mirrored: vec3<bool>, along: vec3<bool>, held: bool) -> Cell {
    count_work(LOADS, 4u);
    let ends = ends_of_cell(cell);
    let low = ends.low;
    let high = ends.high;
    let near = select(low, high, mirrored);
    let far = select(high, low, mirrored);
    let plane = select(near, far, held);
    let a = select(near, plane, along);
    let b = select(far, plane, along);
    let face = vec4<f32>(
        textureLoad(volume, a, 0).x,
        textureLoad(volume, vec3<i32>(b.x, select(a.y, b.y, along.x), a.z), 0).x,
        textureLoad(volume, vec3<i32>(a.x, select(a.y, b.y, along.z), b.z), 0).x,
        textureLoad(volume, b, 0).x,
    );
    let lo = before.lo;
    let hi = before.hi;
    let kept = select(select(hi, vec4<f32>(lo.zw, hi.zw), along.y), vec4<f32>(lo.yw, hi.yw), along.x);
    let lo_x = vec4<f32>(kept.x, face.x, kept.y, face.y);
    let hi_x = vec4<f32>(kept.z, face.z, kept.w, face.w);
    let lo_y = vec4<f32>(kept.xy, face.xy);
    let hi_y = vec4<f32>(kept.zw, face.zw);
    return Cell(select(select(kept, lo_y, along.y), lo_x, along.x), select(select(face, hi_y, along.y), hi_x, along.x));
}

// The field at a grid-space point inside the domain.
fn value_at(g: vec3<f32>) -> f32 {
    count_work(SAMPLES, 1u);
#ifdef MANUAL_TRILINEAR
    let base = floor(g);
    let w = g - base;
    let c = cell_values(vec3<i32>(base));
    let xy = mix(c.lo, c.hi, w.z);
    let y = mix(xy.xz, xy.yw, w.x);
    return mix(y.x, y.y, w.y);
#else
    count_work(LOADS, 1u);
#ifdef FOLDED
    let index = clamp(g - 1.0, vec3<f32>(0.0), vec3<f32>(field.size - 1u));
    let texel = index + vec3<f32>(tile_offset(vec3<i32>(index))) + 0.5;
    return textureSampleLevel(volume, linear_clamp, texel * field.fold.inv_sides, 0.0).x;
#else
    return textureSampleLevel(volume, linear_clamp, (g - 0.5) * field.inv_size, 0.0).x;
#endif
#endif
}

fn brick_distance_at(brick: vec3<i32>) -> i32 {
    count_work(LOADS, 1u);
    return i32(textureLoad(brick_distance, brick, 0).x);
}

// What clip planes keep of the span of the line o + t d; entry > exit where that is nothing.
fn clipped_span(o: vec3<f32>, d: vec3<f32>, span: vec2<f32>) -> vec2<f32> {
    var kept = span;
#ifdef CLIP
    for (var i = 0u; i < #{MOST_CLIP_PLANES}; i++) {
        let plane = field.clip[i];
        let rise = dot(plane.xyz, d);
        let above = dot(plane.xyz, o) - plane.w;
        let moves = abs(rise) >= 1e-20;
        let at = -above / select(1.0, rise, moves);
        let never = !moves && above < 0.0;
        kept.x = select(kept.x, max(kept.x, select(at, FAR, never)), never || (moves && rise > 0.0));
        kept.y = select(kept.y, min(kept.y, select(at, -FAR, never)), never || (moves && rise < 0.0));
    }
#endif
    return kept;
}

// 1 / d with a finite stand-in where d vanishes.
fn safe_inverse(d: vec3<f32>) -> vec3<f32> {
    let tiny = abs(d) < vec3<f32>(1e-20);
    return select(1.0 / d, vec3<f32>(FAR), tiny);
}

// Entry and exit parameter of the line o + t d with a box; entry > exit where it misses.
fn box_span(o: vec3<f32>, inv_d: vec3<f32>, d: vec3<f32>, lo: vec3<f32>, hi: vec3<f32>) -> vec2<f32> {
    let a = (lo - o) * inv_d;
    let b = (hi - o) * inv_d;
    // A ray parallel to a slab is inside it for ever or never.
    let parallel = abs(d) < vec3<f32>(1e-20);
    let outside = (o < lo) | (o > hi);
    let near = select(min(a, b), select(vec3<f32>(-FAR), vec3<f32>(FAR), outside), parallel);
    let far = select(max(a, b), select(vec3<f32>(FAR), vec3<f32>(-FAR), outside), parallel);
    return vec2<f32>(max(max(near.x, near.y), near.z), min(min(far.x, far.y), far.z));
}
