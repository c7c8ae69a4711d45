// `fourier`: query of the transmittance from Fourier coefficients of extinction along the light (Jansen & Bavoil
// 2010): it integrates their series from the light to a depth.
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::vectors_read::atlas_point
#import umbravox::fourier_series::series_depth

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let point = atlas_point(p);
    if point.lit { return 1.0; }
    return exp(-series_depth(point, (p.z - light.depth_start_mm) / light.depth_range_mm));
}
