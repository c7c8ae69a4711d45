// Shading by a phase function (Henyey and Greenstein 1941, "Diffuse radiation in the galaxy").
#define_import_path umbravox::shading

#import umbravox::frame::frame
#import umbravox::light::{light_point, light_ray}

// Returns the phase function, times 4 pi, for light that is scattered at a grid-space point to the eye.
fn shading_factor(g: vec3<f32>, eye_direction: vec3<f32>) -> f32 {
    let to_world = mat3x3<f32>(frame.world_x, frame.world_y, frame.world_z);
    let l = -normalize(to_world * light_ray(light_point(g).texel).d);
    let cosine = dot(l, normalize(to_world * eye_direction));
    let mean = frame.mean_cosine;
    // At least (1 - |mean|)^2, also with rounding.
    let squared = max(1.0 + mean * mean - 2.0 * mean * cosine, (1.0 - abs(mean)) * (1.0 - abs(mean)));
    return (1.0 - mean * mean) / (squared * sqrt(squared));
}
