// Random estimates of the transmittance of a shadow ray: the ray, extinction along it, the extinctions of its bricks, and
// random numbers.
//
// Random numbers depend on the point and the seed alone, so that a picture does not depend on its tiles.
#define_import_path umbravox::random_rays

#import umbravox::field::{field, interpolated_value, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::gradient_opacity::gradient_factor_at
#import umbravox::labels::{label_shift, shifted_value}
#import umbravox::light::{light, light_point, light_ray}
#import umbravox::transfer::extinction_at
#import umbravox::work::{count_work, count_step, SAMPLES, LOADS}

// Limit on the bricks, and cubes of empty bricks, that a ray passes; more than any volume has along three axes.
const MAX_SECTIONS: u32 = 16384u;

// Parameters, which are no uniforms: lavapipe of Mesa 22.3 reads wild addresses if the end of a loop is the larger of a
// uniform and another number.
struct RandomRays {
    seed: u32,
    // Random walks (`ratio`, `residual`) or samples of extinction (`jackknife`, `unbiased`) of an estimate.
    samples: u32,
    // Number of bricks along x and y.
    bricks_across: vec2<u32>,
    // For each brick, x fastest: control extinction, and the largest extinction above it, 1/mm.
    extinctions: array<vec2<f32>>,
}

@group(1) @binding(1) var<storage, read> params: RandomRays;

struct ShadowRay {
    // The ray from a point to the light, in grid space, d per mm.
    o: vec3<f32>,
    d: vec3<f32>,
    inv_d: vec3<f32>,
    // Depths along the ray between which there may be extinction, mm; both 0 if there is none.
    start: f32,
    end: f32,
}

fn shadow_ray(g: vec3<f32>) -> ShadowRay {
    let p = light_point(g);
    let d = -light_ray(p.texel).d;
    let inv_d = safe_inverse(d);
    let span = clipped_span(g, d, box_span(g, inv_d, d, field.active_lo, field.active_hi));
    let start = max(span.x, 0.0);
    let end = min(span.y, p.z + light.light_distance);
    let hits = start < end;
    return ShadowRay(g, d, inv_d, select(0.0, start, hits), select(0.0, end, hits));
}

// Returns the extinction (1/mm) on the ray at the depth t, mm.
fn extinction_on(ray: ShadowRay, t: f32) -> f32 {
    count_work(SAMPLES, 1u);
    count_step();
    let g = clamp(ray.o + t * ray.d, vec3<f32>(0.5), vec3<f32>(field.size) + 0.5);
    let extinction = extinction_at(shifted_value(interpolated_value(g), label_shift(g)));
#ifdef GRADIENT_OPACITY
    return extinction * gradient_factor_at(g);
#else
    return extinction;
#endif
}

// Part of a ray in one brick, or in a cube of empty bricks.
struct Section {
    exit: f32,
    // Brick that the ray enters there.
    next: vec3<i32>,
    // Whether the ray goes on in the grid of bricks.
    goes_on: bool,
    control: f32,
    majorant: f32,
}

fn brick_on(ray: ShadowRay, t: f32) -> vec3<i32> {
    return clamp(vec3<i32>(floor(ray.o + t * ray.d)), vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
}

// Returns the part of the ray from the depth t on, which lies in the given brick.
fn section_from(ray: ShadowRay, brick: vec3<i32>, t: f32) -> Section {
    count_work(LOADS, 1u);
    let across = vec2<i32>(params.bricks_across);
    let extinctions = params.extinctions[(brick.z * across.y + brick.y) * across.x + brick.x];
    let reach = max(brick_distance_at(brick), 1);
    let forward = ray.d > vec3<f32>(0.0);
    let past = select(brick - reach, brick + reach, forward);
    let face = BRICK_CELLS * select(past + 1, past, forward);
    let moves = abs(ray.d) >= vec3<f32>(1e-20);
    let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - ray.o) * ray.inv_d, moves);
    let exit = clamp(min(exits.x, min(exits.y, exits.z)), t, ray.end);
    // Rounding must not move the ray to another brick across a face that it does not reach.
    let inner = clamp(brick_on(ray, exit), select(past + 1, brick, forward), select(brick, past - 1, forward));
    let next = select(inner, past, exits <= vec3<f32>(exit));
    let last = vec3<i32>(field.size) >> BRICK_SHIFT;
    let inside = clamp(next, vec3<i32>(0), last);
    return Section(exit, inside, exit < ray.end && all(inside == next), extinctions.x, extinctions.y);
}

// A permutation of 32-bit words followed by a hash: RXS-M-XS 32 of O'Neill 2014, PCG.
fn hash(word: u32) -> u32 {
    let state = word * 747796405u + 2891336453u;
    let mixed = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (mixed >> 22u) ^ mixed;
}

// Returns the state of the random number generator for a ray.
fn random_state(ray: ShadowRay) -> u32 {
    let o = bitcast<vec3<u32>>(ray.o);
    let d = bitcast<vec3<u32>>(ray.d);
    let light_word = hash(d.x ^ hash(d.y ^ hash(d.z ^ hash(params.seed))));
    return hash(o.x ^ hash(o.y ^ hash(o.z ^ light_word)));
}

// Returns a random number from (0, 1), and advances the generator.
fn random(state: ptr<function, u32>) -> f32 {
    let word = hash(*state);
    *state = *state * 747796405u + 2891336453u;
    return (f32(word >> 9u) + 0.5) * exp2(-23.0);
}
