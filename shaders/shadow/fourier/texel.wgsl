// `fourier` with `range=texel`: transmittance curve of one texel, a series over the depth range of its matter.
#define_import_path umbravox::texel_curve

#import umbravox::light::light
#import umbravox::vectors_read::vector_at
#import umbravox::fourier_series::{TERMS, SeriesPoint, series_depth}

fn texel_transmittance(texel: vec2<u32>, z: f32) -> f32 {
    let last = vector_at(texel, (TERMS + 1u) / 2u);
    let range = select(last.xy, last.zw, (TERMS & 1u) == 0u);
    let share = (z - light.depth_start_mm) / light.depth_range_mm;
    // A texel without matter has no range.
    return select(1.0, exp(-series_depth(SeriesPoint(texel), (share - range.x) / max(range.y, 1e-30))), range.y > 0.0);
}
