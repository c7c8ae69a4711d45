// `fourier`: transmittance from Fourier coefficients of extinction along the light (Jansen & Bavoil 2010). It integrates
// their series from the light to a depth; with `range=texel` a series covers the depth range of a texel's matter.
#define_import_path umbravox::texel_curve

#import umbravox::light::light
#ifdef TEXEL_RANGE
#import umbravox::vectors_read::filtered_vector
#import umbravox::fourier_series::{TERMS, series_depth}
#else
#import umbravox::fourier_series::series_depth
#endif

fn texel_transmittance(place: vec2<f32>, z: f32) -> f32 {
    let share = (z - light.depth_start_mm) / light.depth_range_mm;
#ifdef TEXEL_RANGE
    let last = filtered_vector(place, (TERMS + 1u) / 2u);
    let range = select(last.xy, last.zw, (TERMS & 1u) == 0u);
    // A texel without matter has no range.
    return select(1.0, exp(-series_depth(place, (share - range.x) / max(range.y, 1e-30))), range.y > 0.0);
#else
    return exp(-series_depth(place, share));
#endif
}
