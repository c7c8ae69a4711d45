// `beer`: transmittance of one texel. Behind the front, optical depth rises with the mean extinction until it is that
// of the whole ray.
#define_import_path umbravox::texel_curve

#import umbravox::align::NO_DEPTH
#import umbravox::light::light
#import umbravox::vectors_read::vector_at

// Returns the depth (mm) where the matter of a texel begins.
fn first_depth(texel: vec2<u32>) -> f32 {
    let curve = vector_at(texel, 0u);
    return select(NO_DEPTH, light.depth_start_mm + curve.x * light.depth_range_mm, curve.z > 0.0);
}

fn texel_transmittance(place: vec2<f32>, z: f32) -> f32 {
    let share = (z - light.depth_start_mm) / light.depth_range_mm;
    let curve = vector_at(vec2<u32>(place), 0u);
    return exp(-min(curve.z, curve.y * max(share - curve.x, 0.0)));
}
