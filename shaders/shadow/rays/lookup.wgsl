// `rays`: a shadow ray for each query, marched cell by cell to the light.
#define_import_path umbravox::method

#import umbravox::light::{light, light_point, light_ray}
#import umbravox::march::march
#import umbravox::sink::start_sink

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let d = light_ray(p.texel).d;
    // The march starts at the point, where errors matter most, and ends at the light.
    var sink = start_sink();
    march(&sink, g, -d, 0.0, p.z + light.light_distance);
    return exp(-sink.optical_depth.total);
}
