// Scalar field on the device: volume values, bricks and brick distances, without the transfer function.
//
// Grid space: g = index + 1, so that cell c = floor(g) interpolates the voxels c - 1 and c (clamped to the edge), the
// domain is [0.5, n + 0.5]^3 and brick b holds the cells BRICK_CELLS b .. BRICK_CELLS (b + 1) - 1.
#define_import_path umbravox::field

#import umbravox::tuning::{filter_point, COARSE_FILTER}
#import umbravox::work::{count_work, SAMPLES, LOADS}

const BRICK_CELLS: i32 = #{BRICK_CELLS};
// log2(BRICK_CELLS).
const BRICK_SHIFT: vec3<u32> = vec3<u32>(#{BRICK_SHIFT});
const FAR: f32 = #{FAR};

struct Field {
    // Number of voxels along each axis.
    size: vec3<u32>,
    // Smallest voxel spacing, mm.
    min_spacing_mm: f32,
    inv_size: vec3<f32>,
    // Number of intervals of the transfer function (umbravox::transfer).
    intervals: u32,
    // Box of the active bricks (those that may have extinction) in grid space, clipped to the domain.
    active_lo: vec3<f32>,
    // Volume values `<= first_value` or `>= last_value` have no extinction for any label. These values are without
    // the shift of a label.
    first_value: f32,
    active_hi: vec3<f32>,
    last_value: f32,
    // Values at which the bins start: `bin_origin` for the value bins and pair bins, `table_origin` for the bins of
    // the integrals.
    bin_origin: f32,
    bins_per_value: f32,
    table_origin: f32,
    table_per_value: f32,
    // Reciprocal of the transfer function's reference length (1/mm) if it stores opacity; 0 if it stores extinction.
    inv_reference_length: f32,
    // The transfer function's only colour, linear RGB (ONE_COLOR).
    color_r: f32,
    color_g: f32,
    color_b: f32,
    // Value without extinction, above the value ranges of all labels' transfer functions; hidden voxels take it
    // (LABELS).
    hidden_value: f32,
    // Clip planes in grid space, as (n, d): points with n·g >= d stay visible (CLIP). Unused entries clip nothing.
    clip: array<vec4<f32>, #{MOST_CLIP_PLANES}>,
#ifdef PAGED
    // Number of pages along each axis.
    page_counts: vec3<i32>,
    // Value of a texel that is a whole number: word_sign * (texel - word_offset) (WHOLE_TEXELS).
    word_sign: f32,
    word_offset: f32,
#endif
}

@group(0) @binding(0) var<uniform> field: Field;
#ifdef WHOLE_TEXELS
@group(0) @binding(1) var volume: texture_3d<u32>;
#else
@group(0) @binding(1) var volume: texture_3d<f32>;
#endif
@group(0) @binding(2) var linear_clamp: sampler;
// Chebyshev distance of each brick to the nearest active brick, in bricks; 0 for active bricks.
@group(0) @binding(3) var brick_distance: texture_3d<u32>;
#ifdef PAGED
// Place of each page of the volume in its texture, ten bits an axis (src/field/pages.rs).
@group(0) @binding(12) var page_table: texture_3d<u32>;
const PAGE_SHIFT: vec3<u32> = vec3<u32>(#{PAGE_SHIFT});
// Texels from one page to the next.
const PAGE_VOXELS: i32 = #{PAGE_VOXELS};
#endif
#ifdef STREAMED
// One bit for each page: whether a ray waits until it is resident.
@group(0) @binding(#{WAITING_BINDING}) var<storage, read_write> waiting_pages: array<atomic<u32>>;
#endif
// Flags in an entry of the page table: the page is not resident; it or one of its neighbours is not.
const MISSING: u32 = #{MISSING};
const NEAR_MISSING: u32 = #{NEAR_MISSING};

// The eight values that a cell interpolates, x fastest: lo = z - 1 layer, hi = z layer; (x-y-, x+y-, x-y+, x+y+).
struct Cell {
    lo: vec4<f32>,
    hi: vec4<f32>,
}

#ifdef PAGED
// Returns the page of the cells above the voxel `low`.
fn page_above(low: vec3<i32>) -> vec3<i32> {
    return min(low >> PAGE_SHIFT, field.page_counts - 1);
}

// Returns the offset from voxel to texel coordinates for the voxel `low` and the next ones along each axis.
fn page_offset(low: vec3<i32>) -> vec3<i32> {
    let page = page_above(low);
    let entry = textureLoad(page_table, page, 0).x;
    let slot = vec3<i32>((vec3<u32>(entry) >> vec3<u32>(0u, 10u, 20u)) & vec3<u32>(1023u));
    return slot * PAGE_VOXELS - (page << PAGE_SHIFT);
}
#endif

#ifdef STREAMED
// Returns the number of the page of a cell if one of the flags is set in its entry, else -1.
fn missing_page(cell: vec3<i32>, flags: u32) -> i32 {
    let page = page_above(clamp(cell - 1, vec3<i32>(0), vec3<i32>(field.size) - 1));
    let entry = textureLoad(page_table, page, 0).x;
    let number = (page.z * field.page_counts.y + page.y) * field.page_counts.x + page.x;
    return select(-1, number, (entry & flags) != 0u);
}

// Lets a ray wait for a page.
fn wait_for_page(page: i32) {
    atomicOr(&waiting_pages[u32(page) >> 5u], 1u << (u32(page) & 31u));
}
#endif

// Returns the texel that stores a voxel.
fn voxel_texel(voxel: vec3<i32>) -> vec3<i32> {
#ifdef PAGED
    return voxel + page_offset(voxel);
#else
    return voxel;
#endif
}

// Returns the value that a texel of the volume stores.
fn texel_value(texel: vec3<i32>) -> f32 {
#ifdef WHOLE_TEXELS
    return field.word_sign * (f32(textureLoad(volume, texel, 0).x) - field.word_offset);
#else
    return textureLoad(volume, texel, 0).x;
#endif
}

// Texels of the lowest and the highest voxel of a cell.
struct CellEnds {
    low: vec3<i32>,
    high: vec3<i32>,
}

fn ends_of_cell(cell: vec3<i32>) -> CellEnds {
    let last = vec3<i32>(field.size) - 1;
    let low = clamp(cell - 1, vec3<i32>(0), last);
    let high = clamp(cell, vec3<i32>(0), last);
#ifdef PAGED
    let offset = page_offset(low);
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
            texel_value(a),
            texel_value(vec3<i32>(b.x, a.y, a.z)),
            texel_value(vec3<i32>(a.x, b.y, a.z)),
            texel_value(vec3<i32>(b.x, b.y, a.z)),
        ),
        vec4<f32>(
            texel_value(vec3<i32>(a.x, a.y, b.z)),
            texel_value(vec3<i32>(b.x, a.y, b.z)),
            texel_value(vec3<i32>(a.x, b.y, b.z)),
            texel_value(b),
        ),
    );
}

// Returns the eight values of a cell that follows the cell with the values `before` along the axis `along`; some axes
// may be mirrored. The two cells share four values, and this reads the four on the far face. If the shared values are
// not known, it reads those of the near face instead, and a second call with `known` completes the cell.
fn next_cell_values(before: Cell, cell: vec3<i32>, mirrored: vec3<bool>, along: vec3<bool>, known: bool) -> Cell {
    let ends = ends_of_cell(cell);
    let low = ends.low;
    let high = ends.high;
    let near = select(low, high, mirrored);
    let far = select(high, low, mirrored);
    let plane = select(near, far, known);
    let a = select(near, plane, along);
    let b = select(far, plane, along);
    let face = vec4<f32>(
        texel_value(a),
        texel_value(vec3<i32>(b.x, select(a.y, b.y, along.x), a.z)),
        texel_value(vec3<i32>(a.x, select(a.y, b.y, along.z), b.z)),
        texel_value(b),
    );
    let lo = before.lo;
    let hi = before.hi;
    let retained = select(select(hi, vec4<f32>(lo.zw, hi.zw), along.y), vec4<f32>(lo.yw, hi.yw), along.x);
    let lo_x = vec4<f32>(retained.x, face.x, retained.y, face.y);
    let hi_x = vec4<f32>(retained.z, face.z, retained.w, face.w);
    let lo_y = vec4<f32>(retained.xy, face.xy);
    let hi_y = vec4<f32>(retained.zw, face.zw);
    return Cell(select(select(retained, lo_y, along.y), lo_x, along.x), select(select(face, hi_y, along.y), hi_x, along.x));
}

// Returns the value at a point of a cell, in cell coordinates in [0, 1].
fn trilinear(cell: Cell, f: vec3<f32>) -> f32 {
    let xy = mix(cell.lo, cell.hi, f.z);
    let y = mix(xy.xz, xy.yw, f.x);
    return mix(y.x, y.y, f.y);
}

// Returns the volume value at a grid-space point inside the domain, interpolated with float32 weights.
fn interpolated_value(g: vec3<f32>) -> f32 {
    let base = floor(g);
    return trilinear(cell_values(vec3<i32>(base)), g - base);
}

// Returns the volume value at a grid-space point inside the domain, interpolated with the weights of the texture filter.
fn value_at(exact: vec3<f32>) -> f32 {
    count_work(SAMPLES, 1u);
    let g = filter_point(exact);
#ifdef MANUAL_TRILINEAR
    return interpolated_value(g);
#else
    count_work(LOADS, 1u);
    return textureSampleLevel(volume, linear_clamp, (g - 0.5) * field.inv_size, 0.0).x;
#endif
}

// Returns the volume value at a grid-space point inside the domain, interpolated with float32 weights on every adapter.
fn exact_value_at(g: vec3<f32>) -> f32 {
    if COARSE_FILTER {
        count_work(SAMPLES, 1u);
        return interpolated_value(g);
    }
    return value_at(g);
}

fn brick_distance_at(brick: vec3<i32>) -> i32 {
    count_work(LOADS, 1u);
    return i32(textureLoad(brick_distance, brick, 0).x);
}

// Clips a span of the ray o + t d to the clip planes; entry > exit if nothing remains.
fn clipped_span(o: vec3<f32>, d: vec3<f32>, span: vec2<f32>) -> vec2<f32> {
    var clipped = span;
#ifdef CLIP
    for (var i = 0u; i < #{MOST_CLIP_PLANES}; i++) {
        let plane = field.clip[i];
        let rise = dot(plane.xyz, d);
        let above = dot(plane.xyz, o) - plane.w;
        let moves = abs(rise) >= 1e-20;
        let at = -above / select(1.0, rise, moves);
        let never = !moves && above < 0.0;
        clipped.x = select(clipped.x, max(clipped.x, select(at, FAR, never)), never || (moves && rise > 0.0));
        clipped.y = select(clipped.y, min(clipped.y, select(at, -FAR, never)), never || (moves && rise < 0.0));
    }
#endif
    return clipped;
}

// Returns 1 / d, finite also for d = 0.
fn safe_inverse(d: vec3<f32>) -> vec3<f32> {
    let tiny = abs(d) < vec3<f32>(1e-20);
    return select(1.0 / d, vec3<f32>(FAR), tiny);
}

// Returns entry and exit of the ray o + t d with a box; entry > exit if it misses.
fn box_span(o: vec3<f32>, inv_d: vec3<f32>, d: vec3<f32>, lo: vec3<f32>, hi: vec3<f32>) -> vec2<f32> {
    let a = (lo - o) * inv_d;
    let b = (hi - o) * inv_d;
    // A ray parallel to a slab is always or never inside it.
    let parallel = abs(d) < vec3<f32>(1e-20);
    let outside = (o < lo) | (o > hi);
    let near = select(min(a, b), select(vec3<f32>(-FAR), vec3<f32>(FAR), outside), parallel);
    let far = select(max(a, b), select(vec3<f32>(FAR), vec3<f32>(-FAR), outside), parallel);
    return vec2<f32>(max(max(near.x, near.y), near.z), min(min(far.x, far.y), far.z));
}
