// Shading by the gradient of the value: Lambert's law, and a highlight (BLINN_PHONG).
#define_import_path umbravox::shading

#import umbravox::frame::frame
#import umbravox::field::value_at
#import umbravox::light::{light_point, light_ray}

// Returns the shading factor of the volume at a grid-space point, from its gradient. Surfaces are lit from both
// sides; shadows decide which side the light reaches.
fn shading_factor(g: vec3<f32>, eye_direction: vec3<f32>) -> f32 {
    let gradient_grid = vec3<f32>(
        value_at(g + vec3<f32>(0.5, 0.0, 0.0)) - value_at(g - vec3<f32>(0.5, 0.0, 0.0)),
        value_at(g + vec3<f32>(0.0, 0.5, 0.0)) - value_at(g - vec3<f32>(0.0, 0.5, 0.0)),
        value_at(g + vec3<f32>(0.0, 0.0, 0.5)) - value_at(g - vec3<f32>(0.0, 0.0, 0.5)),
    );
    let to_world = mat3x3<f32>(frame.world_x, frame.world_y, frame.world_z);
    // Gradients transform with the inverse transpose; its scale does not matter to a direction.
    let gradient = cross(to_world[1], to_world[2]) * gradient_grid.x
        + cross(to_world[2], to_world[0]) * gradient_grid.y
        + cross(to_world[0], to_world[1]) * gradient_grid.z;
    let size = length(gradient);
    let n = gradient / max(size, 1e-30);
    let l = -normalize(to_world * light_ray(light_point(g).texel).d);
    let diffuse = abs(dot(n, l));
#ifdef BLINN_PHONG
    let sum = l - normalize(to_world * eye_direction);
    // The sum is 0 where light and eye ray have the same direction.
    let h = select(vec3<f32>(0.0), normalize(sum), any(sum != vec3<f32>(0.0)));
    let factor = diffuse + #{HIGHLIGHT} * pow(abs(dot(n, h)), #{GLOSS});
#else
    let factor = diffuse;
#endif
    return select(1.0, mix(1.0, factor, frame.shading_weight), size > 0.0);
}
