// `osm`: lookup in an opacity shadow map (Kim & Neumann 2001, 2).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::tile_table::{record_of, wrapped_texel}
#import umbravox::layers::own
#import umbravox::layers_read::{place_of, optical_depth_at}

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
    let p = light_point(g);
    let side = own.filter_side;
    // Nothing with extinction lies between the light and what its map does not cover.
    let margin = 0.5 * f32(own.kernel);
    let last = f32(light.map_size) - 1.0 + margin;
    // Nor in front of its range, where a point light's own place has no texel.
    if p.z <= light.depth_start_mm { return 1.0; }
    if !(all(p.texel >= vec2<f32>(-margin)) && all(p.texel <= vec2<f32>(last))) { return 1.0; }
    // The planes are the same for every texel.
    let place = place_of(0u, light.depth_start_mm, light.depth_start_mm + own.reach_mm, p.z);
#ifdef FILTER_BILINEAR
    let base = floor(p.texel);
#else
    let base = round(p.texel);
#endif
    let w = p.texel - base;
    let corner = vec2<i32>(base) - i32((own.kernel - 1u) / 2u);
    var sum = 0.0;
    var i = 0u;
    loop {
        let at = vec2<u32>(i % side, i / side);
        let record = record_of(wrapped_texel(corner + vec2<i32>(at)));
        let depth = optical_depth_at(record, place);
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
