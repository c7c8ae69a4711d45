// `half`: a share of the light behind whatever a ray from the light meets first.
#define_import_path umbravox::method

#import umbravox::light::{light, light_point, light_ray}
#import umbravox::march::march
#import umbravox::sink::Sink

struct Own {
    share: f32,
}

@group(1) @binding(1) var<uniform> own: Own;

fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    var sink = Sink(0.0);
    march(&sink, g, -light_ray(p.texel).d, 0.0, p.z + light.light_distance);
    return select(1.0, own.share, sink.optical_depth > 1e-3);
}
