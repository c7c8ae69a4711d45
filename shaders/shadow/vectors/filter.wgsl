// Shadow query of methods whose texels store vectors. It averages the vectors of the texels around a point
// (AVERAGE_VECTORS), or their transmittances.
#define_import_path umbravox::method

#import umbravox::light::light_point
#import umbravox::taps::{TAPS, taps_around, tap_at, four_weights}
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
#ifdef AVERAGE_VECTORS
    return texel_transmittance(point.texel, p.z);
#else
    let taps = taps_around(point.texel);
#ifdef ALIGN
    let at = vec2<u32>(taps.corner);
    let first = vec4<f32>(
        first_depth(at),
        first_depth(at + vec2<u32>(1u, 0u)),
        first_depth(at + vec2<u32>(0u, 1u)),
        first_depth(at + vec2<u32>(1u, 1u)),
    );
    var shift = alignment(first, first < vec4<f32>(NO_DEPTH), four_weights(taps), p.z).shift;
#endif
    var sum = 0.0;
    // A loop, so that the code of the lookup stands in the program once.
    for (var i = 0u; i < TAPS; i++) {
        let tap = tap_at(taps, i);
#ifdef ALIGN
        let z = p.z + shift[i];
#else
        let z = p.z;
#endif
        sum += tap.weight * texel_transmittance(vec2<f32>(tap.texel), z);
    }
    return sum;
#endif
}
