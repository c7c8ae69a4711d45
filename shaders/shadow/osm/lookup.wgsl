// `osm`: query of the transmittance in an opacity shadow map (Kim & Neumann 2001, 2).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::tile_table::{record_of, wrapped_texel}
#import umbravox::layers::params
#import umbravox::layers_read::{layer_point, optical_depth_at}

// Returns the weight of column or row i of a filter of `side` columns and rows. The point lies `w` past the centre of
// the middle one.
fn tap_weight(i: u32, side: u32, w: f32) -> f32 {
#ifdef FILTER_BILINEAR
    // The mean of side - 1 texels, interpolated between the two nearest positions.
    return select(select(1.0, w, i + 1u == side), 1.0 - w, i == 0u) / f32(side - 1u);
#else
    return 1.0 / f32(side);
#endif
}

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let side = params.filter_side;
    // Nothing with extinction lies outside the map.
    let margin = 0.5 * f32(params.kernel);
    let last = f32(light.map_size) - 1.0 + margin;
    // Nothing with extinction lies in front of the map's depth range, where the position of a point light has no
    // texel.
    if p.z <= light.depth_start_mm { return 1.0; }
    if !(all(p.texel >= vec2<f32>(-margin)) && all(p.texel <= vec2<f32>(last))) { return 1.0; }
    // All texels share the same planes.
    let point = layer_point(0u, light.depth_start_mm, light.depth_start_mm + params.reach_mm, p.z);
#ifdef FILTER_BILINEAR
    let base = floor(p.texel);
#else
    let base = round(p.texel);
#endif
    let w = p.texel - base;
    let corner = vec2<i32>(base) - i32((params.kernel - 1u) / 2u);
    var sum = 0.0;
    var i = 0u;
    loop {
        let at = vec2<u32>(i % side, i / side);
        let record = record_of(wrapped_texel(corner + vec2<i32>(at)));
        let depth = optical_depth_at(record, point);
        let weight = tap_weight(at.x, side, w.x) * tap_weight(at.y, side, w.y);
#ifdef AVERAGE_TRANSMITTANCE
        sum += weight * exp(-depth);
#else
        sum += weight * depth;
#endif
        i += 1u;
        if i >= side * side { break; }
    }
#ifdef AVERAGE_TRANSMITTANCE
    return sum;
#else
    return exp(-sum);
#endif
}
