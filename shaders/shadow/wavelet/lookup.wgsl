// `wavelet`: transmittance from Haar wavelet coefficients of extinction along the light (after Aizenshtein et al.
// 2022). The integral of a wavelet over depth is a triangle over its support. At each level the support of one wavelet
// contains the depth, so that a query adds as many triangles as there are levels.
#define_import_path umbravox::texel_curve

#import umbravox::light::light
#ifdef TEXEL_RANGE
#import umbravox::vectors::VECTORS
#endif
#import umbravox::vectors_read::filtered_vector

const RANK: u32 = #{RANK};

fn texel_transmittance(place: vec2<f32>, z: f32) -> f32 {
    var coefficients = filtered_vector(place, 0u);
    let total = coefficients.x;
    var share = (z - light.depth_start_mm) / light.depth_range_mm;
#ifdef TEXEL_RANGE
    // A texel without matter has no range, and its coefficients are 0.
    let range = filtered_vector(place, VECTORS - 1u).zw;
    share = (share - range.x) / max(range.y, 1e-30);
#endif
    // Position within the support of the wavelet of the present level.
    var at = clamp(share, 0.0, 1.0);
    var depth = total * at;
    var index = 1u;
    for (var level = 0u; level < RANK; level++) {
        // The first vector has the wavelets of the first two levels.
        if level > 1u { coefficients = filtered_vector(place, index / 4u); }
        depth += coefficients[index % 4u] * (1.0 - abs(2.0 * at - 1.0));
        let half = select(0u, 1u, at >= 0.5);
        index = 2u * index + half;
        at = 2.0 * at - f32(half);
    }
    return exp(-clamp(depth, 0.0, total));
}
