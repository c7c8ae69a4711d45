// Ranges of the volume value and of extinction over boxes in grid space.
#define_import_path umbravox::ranges

#import umbravox::field::{field, texel_value, voxel_texel, FAR}
#import umbravox::transfer::{interval_at, interval_start, extinction_in}
#import umbravox::work::{count_work, LOADS}

struct Enclosing {
    // Grid units per mm along each axis.
    grid_per_mm: vec3<f32>,
    // Half width of a prism in texels, and the margin around it at both ends of the map's depth range, mm.
    half_texels: f32,
    margins_mm: vec2<f32>,
    // Length of a slab of a prism, mm.
    slab_mm: f32,
    // Largest error of an interpolated value.
    value_error: f32,
    // Number of bricks around that of a point on the axis of a prism that the prism may reach there.
    brick_margin: i32,
}

@group(2) @binding(5) var<uniform> enclosing: Enclosing;
// Least and largest extinction (1/mm) of 2^row consecutive intervals of the transfer function, from interval `column`
// on: any range of intervals is the union of two of these.
@group(2) @binding(6) var extinction_ranges: texture_2d<f32>;

// Relative error of extinction and of the length of a slab in float32, with a reserve.
const ROUNDING: f32 = 4e-6;

// Part of the voxel grid that a box needs along each axis: coordinates of its ends in voxels, its first voxel, and the
// number of segments between voxels.
struct VoxelBox {
    low: vec3<f32>,
    high: vec3<f32>,
    first: vec3<i32>,
    segments: vec3<i32>,
}

const NOTHING: vec2<f32> = vec2<f32>(FAR, -FAR);

fn voxel_box(lo: vec3<f32>, hi: vec3<f32>) -> VoxelBox {
    // Values are clamped beyond the outermost voxels.
    let last = vec3<f32>(field.size) - 1.0;
    let low = clamp(lo - 1.0, vec3<f32>(0.0), last);
    let high = clamp(hi - 1.0, vec3<f32>(0.0), last);
    let first = vec3<i32>(floor(low));
    return VoxelBox(low, high, first, max(vec3<i32>(ceil(high)) - first, vec3<i32>(1)));
}

fn voxel_value(voxel: vec3<i32>) -> f32 {
    return texel_value(voxel_texel(min(voxel, vec3<i32>(field.size) - 1)));
}

// Returns the range of values on a row of voxels along x. Values are linear on each segment, so that the ends of its
// part inside the box have the extremes.
fn row_range(box: VoxelBox, y: i32, z: i32) -> vec2<f32> {
    var found = NOTHING;
    // Three segments at a time: software adapters limit the iterations of loops.
    for (var i = 0; i < box.segments.x; i += 3) {
        count_work(LOADS, 4u);
        let x = box.first.x + i;
        let v = vec4<f32>(
            voxel_value(vec3<i32>(x, y, z)),
            voxel_value(vec3<i32>(x + 1, y, z)),
            voxel_value(vec3<i32>(x + 2, y, z)),
            voxel_value(vec3<i32>(x + 3, y, z)),
        );
        let starts = vec3<f32>(vec3<i32>(x) + vec3<i32>(0, 1, 2));
        let from_low = mix(v.xyz, v.yzw, clamp(box.low.x - starts, vec3<f32>(0.0), vec3<f32>(1.0)));
        let to_high = mix(v.xyz, v.yzw, clamp(box.high.x - starts, vec3<f32>(0.0), vec3<f32>(1.0)));
        let inside = vec3<bool>(true, i + 1 < box.segments.x, i + 2 < box.segments.x);
        let least = select(vec3<f32>(FAR), min(from_low, to_high), inside);
        let most = select(vec3<f32>(-FAR), max(from_low, to_high), inside);
        found.x = min(found.x, min(least.x, min(least.y, least.z)));
        found.y = max(found.y, max(most.x, max(most.y, most.z)));
    }
    return found;
}

// Returns the union of a range with those at two positions (fractions) between two neighbouring rows or layers.
fn with_segment(found: vec2<f32>, before: vec2<f32>, behind: vec2<f32>, low: f32, high: f32) -> vec2<f32> {
    let a = mix(before, behind, clamp(low, 0.0, 1.0));
    let b = mix(before, behind, clamp(high, 0.0, 1.0));
    return vec2<f32>(min(found.x, min(a.x, b.x)), max(found.y, max(a.y, b.y)));
}

fn layer_range(box: VoxelBox, z: i32) -> vec2<f32> {
    var found = NOTHING;
    var before = vec2<f32>(0.0);
    for (var i = 0; i <= box.segments.y; i++) {
        let row = row_range(box, box.first.y + i, z);
        let start = f32(box.first.y + i - 1);
        if i > 0 { found = with_segment(found, before, row, box.low.y - start, box.high.y - start); }
        before = row;
    }
    return found;
}

// Returns a range that contains the interpolated values of a box in grid space, and their float32 errors.
fn value_range(lo: vec3<f32>, hi: vec3<f32>) -> vec2<f32> {
    let box = voxel_box(lo, hi);
    var found = NOTHING;
    var before = vec2<f32>(0.0);
    for (var i = 0; i <= box.segments.z; i++) {
        let layer = layer_range(box, box.first.z + i);
        let start = f32(box.first.z + i - 1);
        if i > 0 { found = with_segment(found, before, layer, box.low.z - start, box.high.z - start); }
        before = layer;
    }
    return found + vec2<f32>(-enclosing.value_error, enclosing.value_error);
}

// Returns the range of extinction (1/mm) over a range of values. Extinction is monotone within an interval of the
// transfer function.
fn extinction_between(values: vec2<f32>) -> vec2<f32> {
    let i = interval_at(values.x);
    let j = interval_at(values.y);
    let low_end = select(interval_start(i + 1u), values.y, i == j);
    let high_start = select(interval_start(j), values.x, i == j);
    let low = extinction_in(i, vec4<f32>(values.x, low_end, values.x, low_end)).xy;
    let high = extinction_in(j, vec4<f32>(high_start, values.y, high_start, values.y)).xy;
    var found = vec2<f32>(min(min(low.x, low.y), min(high.x, high.y)), max(max(low.x, low.y), max(high.x, high.y)));
    if j > i + 1u {
        let level = firstLeadingBit(j - i - 1u);
        let a = textureLoad(extinction_ranges, vec2<u32>(i + 1u, level), 0).xy;
        let b = textureLoad(extinction_ranges, vec2<u32>(j - (1u << level), level), 0).xy;
        found = vec2<f32>(min(found.x, min(a.x, b.x)), max(found.y, max(a.y, b.y)));
    }
    return found * vec2<f32>(1.0 - ROUNDING, 1.0 + ROUNDING);
}

// Returns the range of extinction (1/mm) over a box in grid space. There is none outside the domain and behind clip
// planes.
fn extinction_range(lo: vec3<f32>, hi: vec3<f32>) -> vec2<f32> {
    let end = vec3<f32>(field.size) + 0.5;
    var partly = any(lo < vec3<f32>(0.5)) || any(hi > end);
    var outside = any(hi < vec3<f32>(0.5)) || any(lo > end);
#ifdef CLIP
    for (var i = 0u; i < #{MOST_CLIP_PLANES}; i++) {
        let plane = field.clip[i];
        let middle = dot(plane.xyz, 0.5 * (lo + hi)) - plane.w;
        let reach = dot(abs(plane.xyz), 0.5 * (hi - lo));
        partly = partly || middle < reach;
        outside = outside || middle < -reach;
    }
#endif
    let found = extinction_between(value_range(lo, hi));
    return vec2<f32>(select(found.x, 0.0, partly), select(found.y, 0.0, outside));
}
