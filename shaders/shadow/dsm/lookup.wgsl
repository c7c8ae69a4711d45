// `dsm`: query of the transmittance in a tiled deep shadow map (Hadwiger et al. 2006, 3.5).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::work::{count_work, LOADS}
#import umbravox::tile_table::wrapped_texel
#import umbravox::dsm_directory::{head_of, heads_around, NO_HEAD}
#import umbravox::taps::{TAPS, taps_around, tap_at, four_weights}
#ifdef ALIGN
#import umbravox::align::alignment
#endif
#import umbravox::segments::segment_transmittance
#import umbravox::dsm_layout::{
    params, quad_texel, node_step, node_value, CONTINUES, FILLER, DEPTH_STEPS, MAX_NODES
}

// Quads of curve nodes: the heads of texels, and the tail quads of those with more than four nodes.
@group(1) @binding(3) var quads: texture_2d<u32>;

// Largest depth of a query in steps: half a step past the end of the map, in front of the filler.
const LAST_STEP: f32 = DEPTH_STEPS + 0.5;

// Returns the first curve nodes of a texel.
fn first_nodes(head: u32) -> vec4<u32> {
    if head == NO_HEAD { return vec4<u32>(0xffffffffu); }
    count_work(LOADS, 1u);
    return textureLoad(quads, quad_texel(head), 0);
}

// Curve nodes before and after a depth.
struct Around {
    before: u32,
    after: u32,
}

// Narrows the search with four more curve nodes, of which `passed` lie in front of the depth.
fn narrowed(before: u32, nodes: vec4<u32>, passed: vec4<bool>) -> Around {
    let first = select(select(select(before, nodes.x, passed.x), nodes.y, passed.y), nodes.z, passed.z);
    let next = select(select(select(nodes.w, nodes.z, !passed.z), nodes.y, !passed.y), nodes.x, !passed.x);
    return Around(select(first, nodes.w, passed.w), next);
}

// Returns the transmittance of one texel at a depth in steps, from its first curve nodes.
fn texel_transmittance(first: vec4<u32>, step: f32) -> f32 {
    let limit = u32(step);
    let has_tail = (first.x & CONTINUES) != 0u;
    let nodes = select(first, first.xyzz, has_tail);
    var passed = (nodes >> vec4<u32>(16u)) <= vec4<u32>(limit);
    // Before the first node the transmittance is 1.
    let outside = !passed.x;
    var around = narrowed(FILLER, nodes, passed);
    // Linear search by quads, without branches inside them: few texels have a second tail quad.
    var searching = passed.w && has_tail;
    var quad = first.w;
    for (var i = 0u; i < MAX_NODES / 4u; i++) {
        if searching {
            count_work(LOADS, 1u);
            let words = textureLoad(quads, quad_texel(quad), 0);
            passed = (words >> vec4<u32>(16u)) <= vec4<u32>(limit);
            around = narrowed(around.before, words, passed);
            searching = passed.w && (words.w & CONTINUES) != 0u;
            quad += 1u;
        }
        if !searching { break; }
    }
    let a = f32(node_step(around.before));
    let b = f32(node_step(around.after));
    let w = clamp((step - a) / max(b - a, 1e-6), 0.0, 1.0);
    let stored = mix(node_value(around.before), node_value(around.after), w);
    return select(segment_transmittance(stored), 1.0, outside);
}

#ifdef FILTER_BILINEAR
// First curve nodes of the four texels around a point with their weights, and the depth of the point in steps.
struct Corners {
    a: vec4<u32>,
    b: vec4<u32>,
    c: vec4<u32>,
    d: vec4<u32>,
    weights: vec4<f32>,
    step: f32,
    // Shift that aligns the depth of the point in each texel, and its largest value for any weights.
    shift: vec4<f32>,
    most_shift: f32,
}

// Returns the texels around a position on the map and a depth in steps.
fn corners_around(texel: vec2<f32>, step: f32) -> Corners {
    let taps = taps_around(texel);
    let heads = heads_around(taps.corner);
    let a = first_nodes(heads.x);
    let b = first_nodes(heads.y);
    let c = first_nodes(heads.z);
    let d = first_nodes(heads.w);
    let weights = four_weights(taps);
#ifdef ALIGN
    let starts = vec4<u32>(a.x, b.x, c.x, d.x) >> vec4<u32>(16u);
    let mm_per_step = 1.0 / params.depth_steps_per_mm;
    let aligned = alignment(vec4<f32>(starts) * mm_per_step, starts < vec4<u32>(FILLER), weights, step * mm_per_step);
    let most_shift = aligned.most * params.depth_steps_per_mm;
    return Corners(a, b, c, d, weights, step, aligned.shift * params.depth_steps_per_mm, most_shift);
#else
    return Corners(a, b, c, d, weights, step, vec4<f32>(0.0), 0.0);
#endif
}

// Returns the transmittances of the texels around a point, with depths shifted by `shift` steps.
fn corner_transmittances(around: Corners, shift: vec4<f32>) -> vec4<f32> {
    let steps = clamp(around.step + shift, vec4<f32>(0.0), vec4<f32>(LAST_STEP));
    return vec4<f32>(
        texel_transmittance(around.a, steps.x),
        texel_transmittance(around.b, steps.y),
        texel_transmittance(around.c, steps.z),
        texel_transmittance(around.d, steps.w),
    );
}
#endif

#ifdef LOWER
// Distance from the map, in texels, up to which rounding may have moved a position on its border.
const BORDER: f32 = 1e-3;
#else
const BORDER: f32 = 0.0;
#endif

// Whether a position on the map lies outside of it, where nothing has extinction.
fn is_outside(texel: vec2<f32>) -> bool {
    let first = -0.5 - BORDER;
    let last = f32(light.map_size) - 0.5 + BORDER;
    return !(all(texel >= vec2<f32>(first)) && all(texel <= vec2<f32>(last)));
}

// Returns the depth of a query in steps of the map, which may lie outside of its range.
fn depth_step(depth_mm: f32) -> f32 {
    let from_start_mm = depth_mm + params.depth_offset_mm - light.depth_start_mm;
    return from_start_mm * params.depth_steps_per_mm;
}

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    if is_outside(p.texel) { return 1.0; }
    let step = depth_step(p.z);
#ifdef FILTER_BILINEAR
    let around = corners_around(p.texel, step);
    return dot(around.weights, corner_transmittances(around, around.shift));
#else
    let taps = taps_around(p.texel);
    var sum = 0.0;
    for (var i = 0u; i < TAPS; i++) {
        let tap = tap_at(taps, i);
        let first = first_nodes(head_of(wrapped_texel(tap.texel)));
        sum += tap.weight * texel_transmittance(first, clamp(step, 0.0, LAST_STEP));
    }
    return sum;
#endif
}

#ifdef BOUNDS
// Returns the bound on the transmittance from the light to a grid-space point that an enclosing curve gives. Before its
// first node a curve is 1 without error.
fn bounding_transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    if is_outside(p.texel) { return 1.0; }
    let first = first_nodes(head_of(wrapped_texel(vec2<i32>(round(p.texel)))));
    let step = clamp(depth_step(p.z), 0.0, LAST_STEP);
    let stored = texel_transmittance(first, step);
#ifdef LOWER
    let bound = max(stored - params.transmittance_error, 0.0);
#else
    let bound = min(stored + params.transmittance_error, 1.0);
#endif
    return select(bound, 1.0, node_step(first.x) > u32(step));
}
#endif

#ifdef KNOWN_RANGE
// Transmittance of a map at a point, and the range in which the texels around it allow it.
struct Ranged {
    mean: f32,
    least: f32,
    most: f32,
}

// Returns the part of a texel's range that a weight of it, or of all other texels, opens. On the light ray through a
// texel centre, rounding gives its neighbours no more than the least weight: they open nothing.
fn opened(weight: vec4<f32>) -> vec4<f32> {
    return clamp((weight - params.least_weight) / (7.0 * params.least_weight), vec4<f32>(0.0), vec4<f32>(1.0));
}

// Returns the transmittance at a grid-space point with its range: the values of the texels around the point, at depths
// that differ by as much as their first depths do.
fn ranged_transmittance(g: vec3<f32>) -> Ranged {
    let p = light_point(g);
    if is_outside(p.texel) { return Ranged(1.0, 1.0, 1.0); }
    let around = corners_around(p.texel, depth_step(p.z));
    let w = around.weights;
    let shares = opened(w);
    let others = 1.0 - max(max(w.x, w.y), max(w.z, w.w));
    let widest = around.most_shift * opened(vec4<f32>(others)).x;
    var found = Ranged(0.0, 1.0, 0.0);
    // A loop, so that the code of the lookup stands in the program once.
    for (var k = 0u; k < 3u; k++) {
        let shift = select(vec4<f32>(select(-widest, widest, k == 1u)), around.shift, k == 0u);
        let values = corner_transmittances(around, shift);
        found.mean = select(found.mean, dot(w, values), k == 0u);
        let reached = mix(vec4<f32>(found.mean), values, shares);
        found.least = min(found.least, min(min(reached.x, reached.y), min(reached.z, reached.w)));
        found.most = max(found.most, max(max(reached.x, reached.y), max(reached.z, reached.w)));
        if widest == 0.0 { break; }
    }
    return found;
}
#endif
