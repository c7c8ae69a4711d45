// Shading of strands by their directions (Kajiya and Kay 1989, "Rendering fur with three dimensional textures").
#define_import_path umbravox::shading

#import umbravox::frame::frame
#import umbravox::field::field
#import umbravox::light::{light_point, light_ray}
#import umbravox::work::{count_work, LOADS}

// Second moments of the strands' directions in world axes, up to a common factor: xx, yy, zz, xy, and xz, yz.
@group(2) @binding(4) var moments: texture_3d<f32>;
@group(2) @binding(5) var more_moments: texture_3d<f32>;
@group(2) @binding(6) var moments_sampler: sampler;

// Returns the shading factor at a grid-space point for unit vectors `l` to the light and `e` to the eye. With `m` the
// mean of u u^T over the directions u of strands, 1 - l^T m l is the mean square of the sine between light and
// strand. The highlight lies about the cone of mirror directions, where the cosines with `l` and `e` differ in sign
// only.
fn strand_factor(g: vec3<f32>, l: vec3<f32>, e: vec3<f32>) -> f32 {
    count_work(LOADS, 2u);
    let at = (g - 0.5) * field.inv_size;
    let d = textureSampleLevel(moments, moments_sampler, at, 0.0);
    let o = textureSampleLevel(more_moments, moments_sampler, at, 0.0);
    let trace = d.x + d.y + d.z;
    let m = mat3x3<f32>(vec3<f32>(d.x, d.w, o.x), vec3<f32>(d.w, d.y, o.y), vec3<f32>(o.x, o.y, d.z));
    let lm = m * l / max(trace, 1e-30);
    let em = m * e / max(trace, 1e-30);
    let sine_l = sqrt(max(1.0 - dot(l, lm), 0.0));
    let sine_e = sqrt(max(1.0 - dot(e, em), 0.0));
    let mirror = max(sine_l * sine_e - dot(e, lm), 0.0);
    return select(1.0, sine_l + #{HIGHLIGHT} * pow(mirror, #{GLOSS}), trace > 0.0);
}

// Returns the shading factor of strands at a grid-space point.
fn shading_factor(g: vec3<f32>, eye_direction: vec3<f32>) -> f32 {
    let to_world = mat3x3<f32>(frame.world_x, frame.world_y, frame.world_z);
    let l = -normalize(to_world * light_ray(light_point(g).texel).d);
    return strand_factor(g, l, -normalize(to_world * eye_direction));
}
