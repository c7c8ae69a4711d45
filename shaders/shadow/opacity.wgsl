// `osm`: lookup in an opacity shadow map (Kim & Neumann 2001, 2).
#define_import_path umbravox::method

#import umbravox::light::{LightSpace, light_point}
#import umbravox::layers::{record_of, wrapped_texel}
#import umbravox::layers_read::{place_of, optical_depth_at}

#ifdef LIVE
@group(1) @binding(0) var<storage, read> light: LightSpace;
#else
@group(1) @binding(0) var<uniform> light: LightSpace;
#endif

// Weight of one of the filter's columns or rows, `side` of them, where the point lies `w` past the middle one's
// centre.
fn tap_weight(i: u32, side: u32, w: f32) -> f32 {
#ifdef FILTER_BILINEAR
    // A mean of side - 1 texels, at each of the two nearest places.
    return select(select(1.0, w, i + 1u == side), 1.0 - w, i == 0u) / f32(side - 1u);
#else
    return 1.0 / f32(side);
#endif
}

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(light, g);
    let side = light.filter_side;
    // Nothing with extinction lies between the light and what its map does not cover.
    let margin = 0.5 * f32(light.kernel);
    let last = f32(light.map_size) - 1.0 + margin;
    // Nor in front of its range, where a point light's own place has no texel.
    if p.z <= light.depth_start_mm { return 1.0; }
    if !(all(p.texel >= vec2<f32>(-margin)) && all(p.texel <= vec2<f32>(last))) { return 1.0; }
    // The planes are the same for every texel.
    let place = place_of(light, 0u, light.depth_start_mm, light.depth_start_mm + light.reach_mm, p.z);
#ifdef FILTER_BILINEAR
    let base = floor(p.texel);
#else
    let base = round(p.texel);
#endif
    let w = p.texel - base;
    let corner = vec2<i32>(base) - i32((light.kernel - 1u) / 2u);
    var depth = 0.0;
    for (var i = 0u; i < side * side; i++) {
        let at = vec2<u32>(i % side, i / side);
        let record = record_of(light, wrapped_texel(light, corner + vec2<i32>(at)));
        depth += tap_weight(at.x, side, w.x) * tap_weight(at.y, side, w.y) * optical_depth_at(light, record, place);
    }
    return exp(-depth);
}
