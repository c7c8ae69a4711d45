// `moments`: optical depth from the moments of the matter along the light (Muenstermann et al. 2018).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::vectors_read::place_of
#import umbravox::moment_vectors::moments_of
#import umbravox::moment_share::share_before

// Optical depth below which nothing is in the way.
const LEAST_DEPTH: f32 = 1e-7;

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let place = place_of(p);
    if place.lit { return 1.0; }
    let moments = moments_of(place);
    let optical_depth = moments.first.x;
    if optical_depth <= LEAST_DEPTH { return 1.0; }
    let share = (p.z - light.depth_start_mm) / light.depth_range_mm;
    // Behind the map's range lies all of it.
    if share >= 1.0 { return exp(-optical_depth); }
    return exp(-optical_depth * share_before(moments.first, moments.second, moments.third, share));
}
