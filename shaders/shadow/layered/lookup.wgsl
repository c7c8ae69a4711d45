// `dom` and `bom`: query of the transmittance in an opacity map with layers that follow the depths of each texel
// (Yuksel & Keyser 2008, 3; Voicu 2011, 5).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::tile_table::{record_of, records_around, wrapped_texel}
#import umbravox::taps::{TAPS, taps_around, tap_at, four_weights}
#ifdef ALIGN
#import umbravox::align::alignment
#endif
#import umbravox::layers_read::{Extent, extent_of, layer_point, optical_depth_at}

// Returns the optical depth of one texel at depth z.
fn texel_depth(record: u32, extent: Extent, z: f32) -> f32 {
    if !extent.filled || z <= extent.start { return 0.0; }
    return optical_depth_at(record, layer_point(extent.row, extent.start, extent.end, z));
}

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    // Nothing with extinction lies outside the map.
    let last = f32(light.map_size) - 0.5;
    if any(p.texel < vec2<f32>(-0.5)) || any(p.texel > vec2<f32>(last)) { return 1.0; }
    let taps = taps_around(p.texel);
#ifdef FILTER_BILINEAR
    let weights = four_weights(taps);
    let records = records_around(taps.corner);
    let at_a = extent_of(records.x);
    let at_b = extent_of(records.y);
    let at_c = extent_of(records.z);
    let at_d = extent_of(records.w);
    let filled = vec4<bool>(at_a.filled, at_b.filled, at_c.filled, at_d.filled) & (weights > vec4<f32>(0.0));
    if !any(filled) { return 1.0; }
    var z = vec4<f32>(p.z);
#ifdef ALIGN
    z += alignment(vec4<f32>(at_a.start, at_b.start, at_c.start, at_d.start), filled, weights, p.z).shift;
#endif
    let depths = vec4<f32>(
        texel_depth(records.x, at_a, z.x),
        texel_depth(records.y, at_b, z.y),
        texel_depth(records.z, at_c, z.z),
        texel_depth(records.w, at_d, z.w),
    );
#ifdef AVERAGE_TRANSMITTANCE
    return dot(weights, exp(-depths));
#else
    return exp(-dot(weights, depths));
#endif
#else
    var sum = 0.0;
    for (var i = 0u; i < TAPS; i++) {
        let tap = tap_at(taps, i);
        let record = record_of(wrapped_texel(tap.texel));
        let depth = texel_depth(record, extent_of(record), p.z);
#ifdef AVERAGE_TRANSMITTANCE
        sum += tap.weight * exp(-depth);
#else
        sum += tap.weight * depth;
#endif
    }
#ifdef AVERAGE_TRANSMITTANCE
    return sum;
#else
    return exp(-sum);
#endif
#endif
}
