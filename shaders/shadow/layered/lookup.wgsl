// `dom` and `bom`: lookup in an opacity map whose layers follow each texel's own depths (Yuksel & Keyser 2008, 3;
// the thesis on bounding opacity maps, 5).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::tile_table::{record_of, wrapped_texel}
#import umbravox::layers::own
#import umbravox::layers_read::{Extent, extent_of, place_of, optical_depth_at}

// Optical depth of one texel at depth z, its layers lying between the given depths.
fn texel_depth(record: u32, extent: Extent, start: f32, end: f32, z: f32) -> f32 {
    if !extent.meets || z <= start { return 0.0; }
    return optical_depth_at(record, place_of(extent.row, start, end, z));
}

// Depths of neighbouring texels as a filter gives them where they are close enough to be one surface, and as they are
// where they are not.
fn filtered(depths: vec4<f32>, weights: vec4<f32>, meets: vec4<bool>) -> vec4<f32> {
    let near = select(vec4<f32>(1e30), depths, meets);
    let far = select(vec4<f32>(-1e30), depths, meets);
    let spread = max(max(far.x, far.y), max(far.z, far.w)) - min(min(near.x, near.y), min(near.z, near.w));
    let share = select(vec4<f32>(0.0), weights, meets);
    let mean = dot(share, select(vec4<f32>(0.0), depths, meets)) / max(dot(share, vec4<f32>(1.0)), 1e-6);
    return select(depths, vec4<f32>(mean), vec4<bool>(spread < own.same_surface_mm));
}

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    // Nothing with extinction lies between the light and what its map does not cover.
    let last = f32(light.map_size) - 0.5;
    if any(p.texel < vec2<f32>(-0.5)) || any(p.texel > vec2<f32>(last)) { return 1.0; }
#ifdef FILTER_BILINEAR
    let base = vec2<i32>(floor(p.texel));
    let w = p.texel - vec2<f32>(base);
    let weights = vec4<f32>((1.0 - w.x) * (1.0 - w.y), w.x * (1.0 - w.y), (1.0 - w.x) * w.y, w.x * w.y);
    let a = record_of(wrapped_texel(base));
    let b = record_of(wrapped_texel(base + vec2<i32>(1, 0)));
    let c = record_of(wrapped_texel(base + vec2<i32>(0, 1)));
    let d = record_of(wrapped_texel(base + vec2<i32>(1, 1)));
    let at_a = extent_of(a);
    let at_b = extent_of(b);
    let at_c = extent_of(c);
    let at_d = extent_of(d);
    let meets = vec4<bool>(at_a.meets, at_b.meets, at_c.meets, at_d.meets) & (weights > vec4<f32>(0.0));
    if !any(meets) { return 1.0; }
    let starts = filtered(vec4<f32>(at_a.start, at_b.start, at_c.start, at_d.start), weights, meets);
#ifdef ENDS
    let ends = filtered(vec4<f32>(at_a.end, at_b.end, at_c.end, at_d.end), weights, meets);
#else
    let ends = starts + own.reach_mm;
#endif
    let depths = vec4<f32>(
        texel_depth(a, at_a, starts.x, ends.x, p.z),
        texel_depth(b, at_b, starts.y, ends.y, p.z),
        texel_depth(c, at_c, starts.z, ends.z, p.z),
        texel_depth(d, at_d, starts.w, ends.w, p.z),
    );
#ifdef AVERAGE_TRANSMITTANCE
    return dot(weights, exp(-depths));
#else
    return exp(-dot(weights, depths));
#endif
#else
    let record = record_of(wrapped_texel(vec2<i32>(round(p.texel))));
    let extent = extent_of(record);
    return exp(-texel_depth(record, extent, extent.start, extent.end, p.z));
#endif
}
