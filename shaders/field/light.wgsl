// Light space: projection of grid-space points to texels and depths of a shadow map, and the light ray of a texel.
//
// The light frame has coordinates (a, b, h) in mm, h away from the light. Depth z is the distance along the ray, mm:
//   orthographic (light at infinity)  z = h
//   perspective                       z = distance to the light - light_distance, formed without cancellation
//   octahedral (light inside or near) z = distance to the light
// src/field/light_space has the same mapping in f64.
#define_import_path umbravox::light

const PERSPECTIVE: u32 = #{PERSPECTIVE};
const OCTAHEDRAL: u32 = #{OCTAHEDRAL};

// Projection of a shadow map, and the step along its rays. Parameters of the shadow method are at binding 1.
struct LightSpace {
    // Rows of the affine map from grid space to the light frame.
    frame_from_grid_a: vec4<f32>,
    frame_from_grid_b: vec4<f32>,
    frame_from_grid_h: vec4<f32>,
    // Columns of the inverse: grid units per mm along a, b and h, and the frame's origin in grid space.
    grid_per_a: vec3<f32>,
    light_distance: f32,
    grid_per_b: vec3<f32>,
    projection: u32,
    grid_per_h: vec3<f32>,
    map_size: u32,
    grid_origin: vec3<f32>,
    tiles_across: u32,
    // Texel coordinate (centres at whole numbers) = plane coordinate * scale + offset.
    texel_scale: vec2<f32>,
    texel_offset: vec2<f32>,
    // Depth range of the shadow map, which contains all active bricks: it begins at depth_start_mm and is
    // depth_range_mm long.
    depth_start_mm: f32,
    depth_range_mm: f32,
    // Distance between samples along a light ray, mm, with `march=samples`.
    step_mm: f32,
    // Length of the march towards the light before a query of the shadow map, mm (`near`).
    near_mm: f32,
    // Width of a texel in the middle of the shadow map, mm.
    texel_mm: f32,
}

// Bound in every pipeline, also for shadow methods without a map: shading reads the position of the light.
@group(1) @binding(0) var<uniform> light: LightSpace;

struct LightPoint {
    // Texel coordinates in the shadow map; texel centres are integers.
    texel: vec2<f32>,
    // Depth along the light ray, mm.
    z: f32,
}

struct LightRay {
    // Point of the light ray at depth 0, and its direction per mm, in grid space.
    o: vec3<f32>,
    d: vec3<f32>,
}

fn octahedral_from_direction(w: vec3<f32>) -> vec2<f32> {
    // The sum is 0 at the light alone.
    let p = w.xy / max(abs(w.x) + abs(w.y) + abs(w.z), 1e-20);
    let folded = (1.0 - abs(p.yx)) * select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return select(folded, p, w.z >= 0.0);
}

fn direction_from_octahedral(p: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (1.0 - abs(p.yx)) * select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return normalize(vec3<f32>(select(folded, p, z >= 0.0), z));
}

// Returns the shadow-map texel and the depth of a grid-space point.
fn light_point(g: vec3<f32>) -> LightPoint {
    let g4 = vec4<f32>(g, 1.0);
    let a = dot(light.frame_from_grid_a, g4);
    let b = dot(light.frame_from_grid_b, g4);
    let h = dot(light.frame_from_grid_h, g4);
    var plane = vec2<f32>(a, b);
    var z = h;
    if light.projection == PERSPECTIVE {
        let distance = light.light_distance;
        let axial = distance + h;
        plane = plane / max(axial, 1e-6);
        // |x - light| - distance as (|x - light|^2 - distance^2) / (|x - light| + distance).
        z = (a * a + b * b + h * (h + 2.0 * distance)) / (length(vec3<f32>(a, b, axial)) + distance);
    } else if light.projection == OCTAHEDRAL {
        z = length(vec3<f32>(a, b, h));
        plane = octahedral_from_direction(vec3<f32>(a, b, h) / max(z, 1e-20));
    }
    return LightPoint(plane * light.texel_scale + light.texel_offset, z);
}

// Returns the light ray through texel coordinates of the shadow map.
fn light_ray(texel: vec2<f32>) -> LightRay {
    let plane = (texel - light.texel_offset) / light.texel_scale;
    var start = vec3<f32>(plane, 0.0);
    var w = vec3<f32>(0.0, 0.0, 1.0);
    if light.projection == PERSPECTIVE {
        // light_distance * (w - axis), with 1 - 1 / sqrt(1 + r^2) formed without cancellation.
        let r2 = dot(plane, plane);
        let l = sqrt(1.0 + r2);
        w = vec3<f32>(plane, 1.0) / l;
        start = light.light_distance * vec3<f32>(plane, -r2 / (l + 1.0)) / l;
    } else if light.projection == OCTAHEDRAL {
        start = vec3<f32>(0.0);
        w = direction_from_octahedral(plane);
    }
    return LightRay(
        light.grid_origin + start.x * light.grid_per_a + start.y * light.grid_per_b + start.z * light.grid_per_h,
        w.x * light.grid_per_a + w.y * light.grid_per_b + w.z * light.grid_per_h,
    );
}

// Direction and distance from a point to the light.
struct TowardLight {
    // Direction towards the light, grid units per mm.
    d: vec3<f32>,
    // Distance to the light, mm.
    mm: f32,
}

// Returns direction and distance from a grid-space point to the light. The point may lie behind the light, outside
// its map.
fn toward_light(g: vec3<f32>) -> TowardLight {
    let g4 = vec4<f32>(g, 1.0);
    let position = vec3<f32>(
        dot(light.frame_from_grid_a, g4),
        dot(light.frame_from_grid_b, g4),
        dot(light.frame_from_grid_h, g4) + light.light_distance,
    );
    let is_point = light.projection == PERSPECTIVE || light.projection == OCTAHEDRAL;
    let mm = select(position.z, length(position), is_point);
    let w = select(vec3<f32>(0.0, 0.0, 1.0), position / max(mm, 1e-20), is_point);
    return TowardLight(-(w.x * light.grid_per_a + w.y * light.grid_per_b + w.z * light.grid_per_h), mm);
}

// Returns the depth, mm, behind everything that can cast a shadow.
fn depth_end_mm() -> f32 {
    return light.depth_start_mm + light.depth_range_mm;
}
