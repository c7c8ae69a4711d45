// Integral of a Fourier series of extinction along the light (Jansen & Bavoil 2010).
#define_import_path umbravox::fourier_series

#import umbravox::vectors::VECTORS
#import umbravox::vectors_read::filtered_vector

const TERMS: u32 = #{TERMS};
const TAU: f32 = 6.28318530717959;

// Returns the optical depth at an atlas position from the light to a fraction of the series' depth range.
fn series_depth(place: vec2<f32>, share: f32) -> f32 {
    let s = clamp(share, 0.0, 1.0);
    let rotation = vec2<f32>(cos(TAU * s), sin(TAU * s));
    var wave = rotation;
    let first = filtered_vector(place, 0u);
    // Integrals of the terms: a_k sin(2 pi k s) + b_k (1 - cos(2 pi k s)), each divided by 2 pi k.
    var waves = weight(1u) * (first.z * wave.y + first.w * (1.0 - wave.x));
    for (var v = 1u; v < VECTORS; v++) {
        let pair = filtered_vector(place, v);
        for (var i = 0u; i < 2u; i++) {
            wave = vec2<f32>(wave.x * rotation.x - wave.y * rotation.y, wave.x * rotation.y + wave.y * rotation.x);
            let k = 2u * v + i;
            let term = select(pair.xy, pair.zw, i == 1u);
            waves += select(0.0, weight(k) / f32(k), k <= TERMS) * (term.x * wave.y + term.y * (1.0 - wave.x));
        }
    }
    return 0.5 * first.x * s + waves / TAU;
}

// Returns the weight of a Fourier term: 1, or the Lanczos factor sin(x) / x at x = pi k / (n + 1).
fn weight(k: u32) -> f32 {
#ifdef LANCZOS
    let x = 0.5 * TAU * f32(k) / f32(TERMS + 1u);
    return sin(x) / x;
#else
    return 1.0;
#endif
}
