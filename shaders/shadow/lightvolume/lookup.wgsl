// `lightvolume`: query of the transmittance in a light volume, filtered over the eight nodes around a point.
#define_import_path umbravox::method

#import umbravox::field::{field, brick_distance_at, safe_inverse, box_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::lattice::{lattice, lattice_coordinates, transmittance_of}
#import umbravox::light::toward_light
#import umbravox::work::{count_work, LOADS}

@group(1) @binding(3) var light_volume: texture_3d<f32>;
#ifndef BITS_32
@group(1) @binding(4) var linear: sampler;
#endif
// Distance past the face of a brick, in voxels, that decides to which brick a point on a face belongs.
const PAST_FACE: f32 = 1e-3;

// Returns the filtered value of the light volume at a grid-space point.
fn filtered_at(g: vec3<f32>) -> f32 {
    let at = lattice_coordinates(g);
#ifdef BITS_32
    count_work(LOADS, 8u);
    let low = min(vec3<u32>(at), lattice.counts - 2u);
    let w = at - vec3<f32>(low);
    var sum = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let corner = vec3<u32>(i & 1u, (i >> 1u) & 1u, i >> 2u);
        let sides = select(1.0 - w, w, corner == vec3<u32>(1u));
        sum += sides.x * sides.y * sides.z * textureLoad(light_volume, low + corner, 0).x;
    }
    return sum;
#else
    count_work(LOADS, 1u);
    return textureSampleLevel(light_volume, linear, (at + 0.5) / vec3<f32>(lattice.counts), 0.0).x;
#endif
}

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    // Nodes exist around active bricks only. The transmittance in empty space equals that at the first active brick
    // towards the light.
    let to_light = toward_light(g);
    let inv_d = safe_inverse(to_light.d);
    let span = box_span(g, inv_d, to_light.d, field.active_lo, field.active_hi);
    let end = min(span.y, to_light.mm);
    let moves = abs(to_light.d) >= vec3<f32>(1e-20);
    let forward = to_light.d > vec3<f32>(0.0);
    // A point on a face belongs to the brick ahead, whatever the rounding.
    let ahead = select(vec3<f32>(0.0), select(vec3<f32>(-PAST_FACE), vec3<f32>(PAST_FACE), forward), moves);
    var t = max(span.x, 0.0);
    var at = g;
    var meets = false;
    // Every skip leaves a brick for good.
    var skips_left = i32(field.size.x + field.size.y + field.size.z);
    loop {
        at = g + t * to_light.d;
        let cell = vec3<i32>(floor(at + ahead));
        let brick = clamp(cell, vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
        let distance = brick_distance_at(brick);
        meets = distance == 0 && t <= end;
        let face = select((brick - (distance - 1)) * BRICK_CELLS, (brick + distance) * BRICK_CELLS, forward);
        let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - g) * inv_d, moves);
        t = max(min(exits.x, min(exits.y, exits.z)), t);
        skips_left -= 1;
        if meets || t > end || skips_left <= 0 { break; }
    }
    return select(1.0, transmittance_of(filtered_at(at)), meets);
}
