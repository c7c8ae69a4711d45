// `dsm`: query of the transmittance in a tiled deep shadow map (Hadwiger et al. 2006, 3.5).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::work::{count_work, LOADS}
#import umbravox::tile_table::{record_of, records_around, wrapped_texel, NO_TILE}
#ifdef ALIGN
#import umbravox::align::alignment
#endif
#import umbravox::dsm_layout::{params, row_texel, NO_ROW, FILLER, DEPTH_STEPS, MAX_ROWS}

// Rows of curve nodes, two texels each: seven nodes and the link to the next row.
@group(1) @binding(3) var node_rows: texture_2d<u32>;

// Visibility function of one texel: its first row, and the first four curve nodes.
struct Texel {
    row: u32,
    head: vec4<u32>,
}

// Largest depth of a query in steps: half a step past the end of the map, in front of the filler.
const LAST_STEP: f32 = DEPTH_STEPS + 0.5;

fn texel_at(row: u32) -> Texel {
    if row == NO_TILE { return Texel(NO_ROW, vec4<u32>(0xffffffffu)); }
    count_work(LOADS, 1u);
    return Texel(row, textureLoad(node_rows, row_texel(row), 0));
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

// Returns the transmittance of one texel at a depth in steps.
fn texel_transmittance(texel: Texel, step: f32) -> f32 {
    let limit = u32(step);
    var row = texel.row;
    var passed = (texel.head >> vec4<u32>(16u)) <= vec4<u32>(limit);
    // Before the first node the transmittance is 1.
    let outside = !passed.x || row == NO_ROW;
    var around = narrowed(FILLER, texel.head, passed);
    // Linear search by half rows, without branches inside them: rows are short, and few texels have a second one.
    var searching = passed.w && row != NO_ROW;
    var tail = true;
    for (var half_row = 1u; half_row < 2u * MAX_ROWS; half_row++) {
        if searching {
            count_work(LOADS, 1u);
            let words = textureLoad(node_rows, row_texel(row) + vec2<u32>(select(0u, 1u, tail), 0u), 0);
            // The last word of a row links to the next.
            let nodes = select(words, words.xyzz, tail);
            passed = (nodes >> vec4<u32>(16u)) <= vec4<u32>(limit);
            around = narrowed(around.before, nodes, passed);
            row = select(row, words.w, tail);
            searching = passed.w && row != NO_ROW;
            tail = !tail;
        }
        if !searching { break; }
    }
    let a = f32(around.before >> 16u);
    let b = f32(around.after >> 16u);
    let w = clamp((step - a) / max(b - a, 1e-6), 0.0, 1.0);
    let stored = mix(f32(around.before & 0xffffu), f32(around.after & 0xffffu), w) / 65535.0;
    return select(stored, 1.0, outside);
}

#ifdef FILTER_BILINEAR
// The four texels around a point with their weights, and the depth of the point in steps.
struct Corners {
    a: Texel,
    b: Texel,
    c: Texel,
    d: Texel,
    weights: vec4<f32>,
    step: f32,
    // Shift that aligns the depth of the point in each texel, and its largest value for any weights.
    shift: vec4<f32>,
    most_shift: f32,
}

// Returns the texels around a position on the map and a depth in steps.
fn corners_around(texel: vec2<f32>, step: f32) -> Corners {
    let base = vec2<i32>(floor(texel));
    let w = texel - vec2<f32>(base);
    let records = records_around(base);
    let a = texel_at(records.x);
    let b = texel_at(records.y);
    let c = texel_at(records.z);
    let d = texel_at(records.w);
    let weights = vec4<f32>((1.0 - w.x) * (1.0 - w.y), w.x * (1.0 - w.y), (1.0 - w.x) * w.y, w.x * w.y);
#ifdef ALIGN
    let starts = vec4<u32>(a.head.x, b.head.x, c.head.x, d.head.x) >> vec4<u32>(16u);
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

// Whether a position on the map lies outside of it, where nothing has extinction.
fn is_outside(texel: vec2<f32>) -> bool {
    let last = f32(light.map_size) - 0.5;
    return !(all(texel >= vec2<f32>(-0.5)) && all(texel <= vec2<f32>(last)));
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
    let texel = texel_at(record_of(wrapped_texel(vec2<i32>(round(p.texel)))));
    return texel_transmittance(texel, clamp(step, 0.0, LAST_STEP));
#endif
}

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
