// `moments`: optical depth from the moments of the matter along the light (Muenstermann et al. 2018).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::vectors::VECTORS
#import umbravox::vectors_read::{place_of, vector_of}
#import umbravox::moment_share::share_before

// Optical depth below which nothing is in the way.
const LEAST_DEPTH: f32 = 1e-7;

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let place = place_of(p);
    if place.lit { return 1.0; }
    var sums: array<f32, #{MOMENTS} + 1>;
    for (var v = 0u; v < VECTORS; v++) {
        let vector = vector_of(place, v);
        for (var i = 0u; i < 4u; i++) {
            if 4u * v + i <= #{MOMENTS} { sums[4u * v + i] = vector[i]; }
        }
    }
    if sums[0] <= LEAST_DEPTH { return 1.0; }
    let share = (p.z - light.depth_start_mm) / light.depth_range_mm;
    // Behind the map's range lies all of it.
    if share >= 1.0 { return exp(-sums[0]); }
    return exp(-sums[0] * share_before(sums, share));
}
