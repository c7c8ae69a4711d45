// `moments`: transmittance from moments of the matter along the light (Muenstermann et al. 2018).
#define_import_path umbravox::texel_curve

#import umbravox::light::light
#import umbravox::moment_vectors::moments_of
#import umbravox::moment_share::share_before

// Optical depth, or absorbed light, up to which the transmittance counts as 1.
const LEAST_MASS: f32 = 1e-7;

// Returns the transmittance behind an optical depth, or behind matter that absorbs a share of the light.
fn transmittance_behind(mass: f32) -> f32 {
#ifdef LIGHT
    return 1.0 - mass;
#else
    return exp(-mass);
#endif
}

fn texel_transmittance(place: vec2<f32>, z: f32) -> f32 {
    let moments = moments_of(place);
    let mass = moments.first.x;
    let share = (z - light.depth_start_mm) / light.depth_range_mm;
    var before = mass;
    if mass > LEAST_MASS && share < 1.0 {
        before = mass * share_before(moments.first, moments.second, moments.third, share);
    }
    return select(transmittance_behind(before), 1.0, mass <= LEAST_MASS);
}
