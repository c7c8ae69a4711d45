// The integral of a series of extinction along the light (Jansen & Bavoil 2010).
#define_import_path umbravox::fourier_series

#import umbravox::vectors::VECTORS
#ifdef TEXEL_RANGE
#import umbravox::vectors_read::vector_at
#else
#import umbravox::vectors_read::{Place, vector_of}
#endif

const TERMS: u32 = #{TERMS};
const TURN: f32 = 6.28318530717959;

#ifdef TEXEL_RANGE
// Series over ranges of their own have no mean: each is read at its texel.
struct Place {
    texel: vec2<u32>,
}

fn vector_of(place: Place, v: u32) -> vec4<f32> {
    return vector_at(place.texel, v);
}
#endif

// Optical depth from the light to a share of the depth that the series is over.
fn series_depth(at: Place, share: f32) -> f32 {
    let s = clamp(share, 0.0, 1.0);
    let turn = vec2<f32>(cos(TURN * s), sin(TURN * s));
    var wave = turn;
    let first = vector_of(at, 0u);
    // What the terms say of the way from the light: a_k sin(2 pi k s) + b_k (1 - cos(2 pi k s)), each by 2 pi k.
    var waves = weight(1u) * (first.z * wave.y + first.w * (1.0 - wave.x));
    for (var v = 1u; v < VECTORS; v++) {
        let pair = vector_of(at, v);
        for (var i = 0u; i < 2u; i++) {
            wave = vec2<f32>(wave.x * turn.x - wave.y * turn.y, wave.x * turn.y + wave.y * turn.x);
            let k = 2u * v + i;
            let term = select(pair.xy, pair.zw, i == 1u);
            waves += select(0.0, weight(k) / f32(k), k <= TERMS) * (term.x * wave.y + term.y * (1.0 - wave.x));
        }
    }
    return 0.5 * first.x * s + waves / TURN;
}

// What is kept of a term: all, or as Lanczos has it, who weighs with sin(x) / x at x = pi k / (n + 1).
fn weight(k: u32) -> f32 {
#ifdef LANCZOS
    let x = 0.5 * TURN * f32(k) / f32(TERMS + 1u);
    return sin(x) / x;
#else
    return 1.0;
#endif
}
