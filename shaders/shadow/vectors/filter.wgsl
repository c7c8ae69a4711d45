// Shadow query of methods whose stored vectors cannot be averaged: it averages the transmittances of the texels
// around a point.
#define_import_path umbravox::method

#import umbravox::light::light_point
#import umbravox::vectors_read::atlas_point
#ifdef ALIGN
#import umbravox::align::{alignment, NO_DEPTH}
#import umbravox::texel_curve::{texel_transmittance, first_depth}
#else
#import umbravox::texel_curve::texel_transmittance
#endif

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let point = atlas_point(p);
    if point.lit { return 1.0; }
#ifdef FILTER_BILINEAR
    let base = floor(point.texel);
    let w = point.texel - base;
#ifdef ALIGN
    let at = vec2<u32>(base);
    let first = vec4<f32>(
        first_depth(at),
        first_depth(at + vec2<u32>(1u, 0u)),
        first_depth(at + vec2<u32>(0u, 1u)),
        first_depth(at + vec2<u32>(1u, 1u)),
    );
    let weights = vec4<f32>((1.0 - w.x) * (1.0 - w.y), w.x * (1.0 - w.y), (1.0 - w.x) * w.y, w.x * w.y);
    var shift = alignment(first, first < vec4<f32>(NO_DEPTH), weights, p.z).shift;
#endif
    var sum = 0.0;
    // A loop, so that the code of the lookup stands in the program once.
    for (var i = 0u; i < 4u; i++) {
        let corner = vec2<u32>(i & 1u, i >> 1u);
        let sides = select(1.0 - w, w, corner == vec2<u32>(1u));
#ifdef ALIGN
        let z = p.z + shift[i];
#else
        let z = p.z;
#endif
        sum += sides.x * sides.y * texel_transmittance(vec2<u32>(base) + corner, z);
    }
    return sum;
#else
    return texel_transmittance(vec2<u32>(round(point.texel)), p.z);
#endif
}
