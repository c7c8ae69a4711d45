// Filtered moments that are stored in 16 bits each.
//
// The first word of a texel is its optical depth (or absorbed light), a float. The others hold two moments each, in even steps from -1 to
// 1. Power moments are stored as means of Chebyshev polynomials: powers follow with positive weights that add up to
// one, so that no rounding error grows.
#define_import_path umbravox::moment_vectors

#import umbravox::vectors::VECTORS
#import umbravox::taps::{TAPS, taps_around, tap_at}
#import umbravox::vectors_read::words_at

struct Moments {
    // Optical depth (or absorbed light), then each moment times it.
    first: vec4<f32>,
    second: vec4<f32>,
    third: vec4<f32>,
}

// Returns the means of the powers 1 to 8 from those of the Chebyshev polynomials T_1 to T_8.
fn powers_of(a: vec4<f32>, b: vec4<f32>) -> array<vec4<f32>, 2> {
    return array<vec4<f32>, 2>(
        vec4<f32>(
            a.x,
            (1.0 + a.y) / 2.0,
            (3.0 * a.x + a.z) / 4.0,
            (3.0 + 4.0 * a.y + a.w) / 8.0,
        ),
        vec4<f32>(
            (10.0 * a.x + 5.0 * a.z + b.x) / 16.0,
            (10.0 + 15.0 * a.y + 6.0 * a.w + b.y) / 32.0,
            (35.0 * a.x + 21.0 * a.z + 7.0 * b.x + b.z) / 64.0,
            (35.0 + 56.0 * a.y + 28.0 * a.w + 8.0 * b.y + b.w) / 128.0,
        ),
    );
}

fn moments_at(texel: vec2<u32>) -> Moments {
    let words = words_at(texel, 0u);
    let a = vec4<f32>(unpack2x16snorm(words.y), unpack2x16snorm(words.z));
    var b = vec4<f32>(unpack2x16snorm(words.w), 0.0, 0.0);
    if VECTORS > 1u { b = vec4<f32>(b.xy, unpack2x16snorm(words_at(texel, 1u).x)); }
#ifdef TRIGONOMETRIC
    let moments = array<vec4<f32>, 2>(a, b);
#else
    let moments = powers_of(a, b);
#endif
    let depth = bitcast<f32>(words.x);
    return Moments(
        depth * vec4<f32>(1.0, moments[0].xyz),
        depth * vec4<f32>(moments[0].w, moments[1].xyz),
        depth * vec4<f32>(moments[1].w, 0.0, 0.0, 0.0),
    );
}

fn moments_of(place: vec2<f32>) -> Moments {
#ifdef AVERAGE_VECTORS
    let taps = taps_around(place);
    var sum = Moments(vec4<f32>(0.0), vec4<f32>(0.0), vec4<f32>(0.0));
    // A loop, so that the code of the read stands in the program once.
    for (var i = 0u; i < TAPS; i++) {
        let tap = tap_at(taps, i);
        let here = moments_at(vec2<u32>(tap.texel));
        sum.first += tap.weight * here.first;
        sum.second += tap.weight * here.second;
        sum.third += tap.weight * here.third;
    }
    return sum;
#else
    return moments_at(vec2<u32>(place));
#endif
}
