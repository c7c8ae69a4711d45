// `dom` and `bom`: query of the transmittance in an opacity map with layers that follow the depths of each texel
// (Yuksel & Keyser 2008, 3; Voicu 2011, 5).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::tile_table::{record_of, records_around, wrapped_texel}
#import umbravox::layers::params
#import umbravox::layers_read::{Extent, extent_of, layer_point, optical_depth_at}

// Returns the optical depth of one texel at depth z; its layers lie between `start` and `end`.
fn texel_depth(record: u32, extent: Extent, start: f32, end: f32, z: f32) -> f32 {
    if !extent.filled || z <= start { return 0.0; }
    return optical_depth_at(record, layer_point(extent.row, start, end, z));
}

// Averages start or end depths of neighbouring texels if they are close enough to be one surface; otherwise returns
// them unchanged.
fn filtered(depths: vec4<f32>, weights: vec4<f32>, filled: vec4<bool>) -> vec4<f32> {
    let near = select(vec4<f32>(1e30), depths, filled);
    let far = select(vec4<f32>(-1e30), depths, filled);
    let spread = max(max(far.x, far.y), max(far.z, far.w)) - min(min(near.x, near.y), min(near.z, near.w));
    let share = select(vec4<f32>(0.0), weights, filled);
    let mean = dot(share, select(vec4<f32>(0.0), depths, filled)) / max(dot(share, vec4<f32>(1.0)), 1e-6);
    return select(depths, vec4<f32>(mean), vec4<bool>(spread < params.same_surface_mm));
}

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    // Nothing with extinction lies outside the map.
    let last = f32(light.map_size) - 0.5;
    if any(p.texel < vec2<f32>(-0.5)) || any(p.texel > vec2<f32>(last)) { return 1.0; }
#ifdef FILTER_BILINEAR
    let base = vec2<i32>(floor(p.texel));
    let w = p.texel - vec2<f32>(base);
    let weights = vec4<f32>((1.0 - w.x) * (1.0 - w.y), w.x * (1.0 - w.y), (1.0 - w.x) * w.y, w.x * w.y);
    let records = records_around(base);
    let at_a = extent_of(records.x);
    let at_b = extent_of(records.y);
    let at_c = extent_of(records.z);
    let at_d = extent_of(records.w);
    let filled = vec4<bool>(at_a.filled, at_b.filled, at_c.filled, at_d.filled) & (weights > vec4<f32>(0.0));
    if !any(filled) { return 1.0; }
    let starts = filtered(vec4<f32>(at_a.start, at_b.start, at_c.start, at_d.start), weights, filled);
#ifdef ENDS
    let ends = filtered(vec4<f32>(at_a.end, at_b.end, at_c.end, at_d.end), weights, filled);
#else
    let ends = starts + params.reach_mm;
#endif
    let depths = vec4<f32>(
        texel_depth(records.x, at_a, starts.x, ends.x, p.z),
        texel_depth(records.y, at_b, starts.y, ends.y, p.z),
        texel_depth(records.z, at_c, starts.z, ends.z, p.z),
        texel_depth(records.w, at_d, starts.w, ends.w, p.z),
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
