// `moments`: query of the transmittance from moments of the matter along the light (Muenstermann et al. 2018).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::vectors_read::atlas_point
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

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let point = atlas_point(p);
    if point.lit { return 1.0; }
    let moments = moments_of(point);
    let mass = moments.first.x;
    if mass <= LEAST_MASS { return 1.0; }
    let share = (p.z - light.depth_start_mm) / light.depth_range_mm;
    if share >= 1.0 { return transmittance_behind(mass); }
    return transmittance_behind(mass * share_before(moments.first, moments.second, moments.third, share));
}
