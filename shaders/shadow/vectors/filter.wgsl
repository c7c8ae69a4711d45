// Lookup of methods whose vectors cannot be averaged: the transmittances of the texels around a point are.
#define_import_path umbravox::method

#import umbravox::light::light_point
#import umbravox::vectors_read::place_of
#import umbravox::texel_curve::texel_transmittance

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let place = place_of(p);
    if place.lit { return 1.0; }
#ifdef FILTER_BILINEAR
    let base = floor(place.texel);
    let w = place.texel - base;
    var sum = 0.0;
    // A loop, so that the curve is read in one place of the program.
    for (var i = 0u; i < 4u; i++) {
        let corner = vec2<u32>(i & 1u, i >> 1u);
        let sides = select(1.0 - w, w, corner == vec2<u32>(1u));
        sum += sides.x * sides.y * texel_transmittance(vec2<u32>(base) + corner, p.z);
    }
    return sum;
#else
    return texel_transmittance(vec2<u32>(round(place.texel)), p.z);
#endif
}
