// `fourier`: optical depth from the Fourier coefficients of extinction along the light (Jansen & Bavoil 2010): the integral
// of their series from the light to a depth.
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::vectors_read::place_of
#import umbravox::fourier_series::series_depth

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let place = place_of(p);
    if place.lit { return 1.0; }
    return exp(-series_depth(place, (p.z - light.depth_start_mm) / light.depth_range_mm));
}
