// `dsm`: query of the transmittance in a tiled deep shadow map (Hadwiger et al. 2006, 3.5).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::work::{count_work, LOADS}
#import umbravox::tile_table::{record_of, records_around, wrapped_texel, NO_TILE}
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

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let step = clamp((p.z + params.depth_offset_mm - light.depth_start_mm) * params.depth_steps_per_mm, 0.0, LAST_STEP);
    // Nothing with extinction lies outside the map.
    let last = f32(light.map_size) - 0.5;
    if !(all(p.texel >= vec2<f32>(-0.5)) && all(p.texel <= vec2<f32>(last))) { return 1.0; }
#ifdef FILTER_BILINEAR
    let base = vec2<i32>(floor(p.texel));
    let w = p.texel - vec2<f32>(base);
    let records = records_around(base);
    let a = texel_at(records.x);
    let b = texel_at(records.y);
    let c = texel_at(records.z);
    let d = texel_at(records.w);
    let weights = vec4<f32>((1.0 - w.x) * (1.0 - w.y), w.x * (1.0 - w.y), (1.0 - w.x) * w.y, w.x * w.y);
    // On a slanted surface the first depth differs between texels. The functions are aligned at their first depths
    // before they are averaged, or the surface would shadow itself.
    let starts = vec4<u32>(a.head.x, b.head.x, c.head.x, d.head.x) >> vec4<u32>(16u);
    let first = vec4<f32>(starts);
    let filled = starts < vec4<u32>(FILLER);
    let nearest = select(vec4<f32>(1e9), first, filled);
    let farthest = select(vec4<f32>(-1e9), first, filled);
    let spread = max(max(farthest.x, farthest.y), max(farthest.z, farthest.w))
        - min(min(nearest.x, nearest.y), min(nearest.z, nearest.w));
    let share = select(vec4<f32>(0.0), weights, filled);
    let here = dot(share, first) / max(dot(share, vec4<f32>(1.0)), 1e-6);
    // The alignment fades with depth, so slowly that depths keep their order.
    let fade = clamp(1.0 - (step - here) / (4.0 * params.same_surface_steps), 0.0, 1.0);
    let shift = select(vec4<f32>(0.0), (first - here) * fade, filled & vec4<bool>(spread < params.same_surface_steps));
    let steps = clamp(step + shift, vec4<f32>(0.0), vec4<f32>(LAST_STEP));
    return dot(weights, vec4<f32>(
        texel_transmittance(a, steps.x),
        texel_transmittance(b, steps.y),
        texel_transmittance(c, steps.z),
        texel_transmittance(d, steps.w),
    ));
#else
    return texel_transmittance(texel_at(record_of(wrapped_texel(vec2<i32>(round(p.texel))))), step);
#endif
}
