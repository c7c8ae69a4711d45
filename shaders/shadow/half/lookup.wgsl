// `half`: a constant transmittance behind the first extinction on a light ray.
#define_import_path umbravox::method

#import umbravox::light::{light, light_point, light_ray}
#import umbravox::march::march
#import umbravox::sink::start_sink

struct HalfParams {
    share: f32,
}

@group(1) @binding(1) var<uniform> params: HalfParams;

fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    var sink = start_sink();
    march(&sink, g, -light_ray(p.texel).d, 0.0, p.z + light.light_distance);
    return select(1.0, params.share, sink.optical_depth.total > 1e-3);
}
