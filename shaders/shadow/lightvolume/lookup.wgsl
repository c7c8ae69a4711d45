// Looks a light volume up: what its filter makes of the eight nodes around a point.
#define_import_path umbravox::method

#import umbravox::field::{field, brick_distance_at, safe_inverse, box_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::lattice::{lattice, lattice_coordinates, transmittance_of}
#import umbravox::light::toward_light
#import umbravox::work::{count_work, LOADS}

@group(1) @binding(3) var light_volume: texture_3d<f32>;
#ifndef BITS_32
@group(1) @binding(4) var linear: sampler;
#endif
// Past the face of a brick, in voxels.
const PAST_FACE: f32 = 1e-3;

// What the filter makes of the nodes around a grid-space point.
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

// Transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    // Nodes are known around active bricks. As much light arrives in empty space as at the first active brick on the way
    // to the light.
    let way = toward_light(g);
    let inv_d = safe_inverse(way.d);
    let span = box_span(g, inv_d, way.d, field.active_lo, field.active_hi);
    let end = min(span.y, way.mm);
    let moves = abs(way.d) >= vec3<f32>(1e-20);
    let forward = way.d > vec3<f32>(0.0);
    // A point on a face is in the brick that lies ahead, on whichever side rounding puts it.
    let ahead = select(vec3<f32>(0.0), select(vec3<f32>(-PAST_FACE), vec3<f32>(PAST_FACE), forward), moves);
    var t = max(span.x, 0.0);
    var at = g;
    var meets = false;
    // Every leap leaves a brick for good.
    var leaps_left = i32(field.size.x + field.size.y + field.size.z);
    loop {
        at = g + t * way.d;
        let cell = vec3<i32>(floor(at + ahead));
        let brick = clamp(cell, vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
        let distance = brick_distance_at(brick);
        meets = distance == 0 && t <= end;
        let face = select((brick - (distance - 1)) * BRICK_CELLS, (brick + distance) * BRICK_CELLS, forward);
        let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - g) * inv_d, moves);
        t = max(min(exits.x, min(exits.y, exits.z)), t);
        leaps_left -= 1;
        if meets || t > end || leaps_left <= 0 { break; }
    }
    return select(1.0, transmittance_of(filtered_at(at)), meets);
}
