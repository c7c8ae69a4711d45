// `fourier`: optical depth from the Fourier coefficients of extinction along the light (Jansen & Bavoil 2010): the integral
// of their series from the light to a depth.
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::vectors::{own, VECTORS}
#import umbravox::vectors_read::{place_of, vector_of}

const TERMS: u32 = #{TERMS};
const TURN: f32 = 6.28318530717959;

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let place = place_of(p);
    if place.lit { return 1.0; }
    let s = clamp((p.z - light.depth_start_mm) / light.depth_range_mm, 0.0, 1.0);
    let turn = vec2<f32>(cos(TURN * s), sin(TURN * s));
    var at = turn;
    let first = vector_of(place, 0u);
    // What the terms say of the way from the light: a_k sin(2 pi k s) + b_k (1 - cos(2 pi k s)), each by 2 pi k.
    var waves = weight(1u) * (first.z * at.y + first.w * (1.0 - at.x));
    for (var v = 1u; v < VECTORS; v++) {
        let pair = vector_of(place, v);
        for (var i = 0u; i < 2u; i++) {
            at = vec2<f32>(at.x * turn.x - at.y * turn.y, at.x * turn.y + at.y * turn.x);
            let k = 2u * v + i;
            let term = select(pair.xy, pair.zw, i == 1u);
            waves += select(0.0, weight(k) / f32(k), k <= TERMS) * (term.x * at.y + term.y * (1.0 - at.x));
        }
    }
    return exp(-(0.5 * first.x * s + waves / TURN));
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
