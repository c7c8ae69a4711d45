// Light space: where a grid-space point falls in the map and how deep it lies, and the ray of a texel.
//
// Light frame: millimetres (a, b, h), h away from the light; depth z is the distance along the ray, mm:
//   orthographic (light at infinity)  z = h
//   perspective                       z = distance to the light - light_distance, formed without cancellation
//   octahedral (light inside or near) z = distance to the light
#define_import_path umbravox::light

#import umbravox::field::FAR

const ORTHOGRAPHIC: u32 = 0u;
const PERSPECTIVE: u32 = 1u;
const OCTAHEDRAL: u32 = 2u;
const TILE: u32 = 16u;

struct LightSpace {
    // Rows of the affine map to the light frame from grid space.
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
    // Error allowed to the compression, and of the polyline that it is given.
    epsilon: f32,
    chord_tolerance: f32,
    // Sampling distance of the light march where it is regular, mm.
    step_mm: f32,
    // First row past those that belong to tiles, and rows in the pool.
    tile_rows: u32,
    pool_rows: u32,
    taps: u32,
    // Added to a depth before it is looked up, mm (towards the light where negative).
    depth_offset_mm: f32,
    // Stored depths: that of step 0, mm, and steps per mm.
    depth_start_mm: f32,
    depth_steps_per_mm: f32,
    // Neighbouring texels whose first depths differ by less see the same surface.
    same_surface_steps: f32,
    // Layered maps (shadow/layers_layout.wgsl). Layers a texel; the first slot of a record that holds one.
    layers: u32,
    first_slot: u32,
    // Blocks a record, words a block less one, and the bits of a slot index that lie inside a block.
    record_blocks: u32,
    block_mask: u32,
    block_slot_shift: u32,
    // Bits of a stored depth; 32 is a float.
    header_bits: u32,
    // Planes that get the optical depth where they lie; those behind get all of it.
    planes_passed: u32,
    // First row of the tabulated splits, the split of the whole map, and the exponent of an untabulated one.
    split_row: u32,
    split_choice: u32,
    split_exponent: f32,
    // Depth that the layers span where a texel has no end of its own, and that of the map, mm.
    reach_mm: f32,
    depth_range_mm: f32,
    // Optical depth of the greatest 8-bit value.
    kappa: f32,
    longest_depth: f32,
    same_surface_mm: f32,
    // Texels a side that are averaged, and that a lookup reads.
    kernel: u32,
    filter_side: u32,
    padding_d: u32,
}

struct LightPoint {
    // Texel coordinates, centres at whole numbers.
    texel: vec2<f32>,
    // Depth, mm.
    z: f32,
}

struct LightRay {
    // Grid-space point of depth 0 and direction per mm.
    o: vec3<f32>,
    d: vec3<f32>,
}

fn octahedral_from_direction(w: vec3<f32>) -> vec2<f32> {
    let p = w.xy / (abs(w.x) + abs(w.y) + abs(w.z));
    let folded = (1.0 - abs(p.yx)) * select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return select(folded, p, w.z >= 0.0);
}

fn direction_from_octahedral(p: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (1.0 - abs(p.yx)) * select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return normalize(vec3<f32>(select(folded, p, z >= 0.0), z));
}

fn light_point(light: LightSpace, g: vec3<f32>) -> LightPoint {
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

// The ray through texel coordinates.
fn light_ray(light: LightSpace, texel: vec2<f32>) -> LightRay {
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
