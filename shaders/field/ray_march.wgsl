// March along a ray by regular samples that skips bricks without extinction: eye rays, and light rays with
// `march=samples`.
//
// Samples lie on the lattice k step, whatever is skipped, and on the ends of the domain. A march hits the segments
// between two samples that may have extinction.
//
// Loops here and in the callers exit at their last line: software adapters execute the body of a loop once more for
// an exit at its start.
#define_import_path umbravox::ray_march

#import umbravox::field::{field, value_at, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::labels::{label_stretch, next_sample, parts_of_step, is_hidden, shifted_value}
#import umbravox::tuning::STEPS_TOGETHER
#import umbravox::work::count_step

struct Ray {
    // Point of the ray at depth 0, and its direction per mm, in grid space.
    o: vec3<f32>,
    d: vec3<f32>,
    inv_d: vec3<f32>,
    // Depths of the first and the last sample, mm.
    t_in: f32,
    t_out: f32,
    // Depths at which the march starts and ends, mm.
    start: f32,
    end: f32,
    step_mm: f32,
}

struct RayMarch {
    // Lattice coordinate of the last sample, and the volume value there without the shift of a label; `valid` if the
    // value is known.
    k: f32,
    value: f32,
    valid: bool,
    // Whether the last sample may lie in a brick with extinction.
    occupied: bool,
    // Whether the march goes on: the end of the ray is not reached.
    marching: bool,
    // Whether the march has hit a segment with extinction. The caller integrates it from `segment_start` to the last
    // sample, possibly in parts.
    hit: bool,
    segment_start: f32,
    segment_value: f32,
    // Shift added to the segment's values for its label.
    shift: f32,
    // Number of iterations that all loops of the ray may still take.
    iterations_left: u32,
}

// Largest integer up to which float32 counts exactly.
const MAX_SAMPLES: f32 = 16777216.0;

// Returns the ray o + t d through the domain, from depth `first` to `last` (mm).
fn ray_through(o: vec3<f32>, d: vec3<f32>, first: f32, last: f32, step_mm: f32) -> Ray {
    let inv_d = safe_inverse(d);
    let domain = clipped_span(o, d, box_span(o, inv_d, d, vec3<f32>(0.5), vec3<f32>(field.size) + 0.5));
    let t_in = max(domain.x, first);
    let t_out = min(domain.y, last);
#ifdef SKIP_BRICKS
    let active_span = box_span(o, inv_d, d, field.active_lo, field.active_hi);
    return Ray(o, d, inv_d, t_in, t_out, max(active_span.x, t_in), min(active_span.y, t_out), step_mm);
#else
    return Ray(o, d, inv_d, t_in, t_out, t_in, t_out, step_mm);
#endif
}

// Starts a march whose loops take at most `iterations_a_sample` iterations for each sample.
fn start_march(ray: Ray, iterations_a_sample: u32) -> RayMarch {
    let samples = u32(clamp((ray.end - ray.start) / ray.step_mm, 0.0, MAX_SAMPLES)) + 2u;
    // A skip over empty bricks takes one iteration, and one more to sample where it ends.
    let skips = 3u * (field.size.x + field.size.y + field.size.z);
    let iterations = parts_of_step(ray.step_mm) * samples * iterations_a_sample + skips;
    let k = floor(ray.start / ray.step_mm);
    return RayMarch(k, 0.0, false, true, ray.start < ray.end, false, 0.0, 0.0, 0.0, iterations);
}

// Returns the depth of a sample, mm, from its lattice coordinate.
fn sample_depth(ray: Ray, k: f32) -> f32 {
    return clamp(k * ray.step_mm, ray.t_in, ray.t_out);
}

// Returns the value at the end of the segment that the march has hit.
fn segment_end_value(march: RayMarch) -> f32 {
    return shifted_value(march.value, march.shift);
}

// Counts an iteration of a loop, and ends the march at the iteration limit.
fn count_iteration(march: ptr<function, RayMarch>) {
    (*march).iterations_left -= min((*march).iterations_left, 1u);
    let more = (*march).iterations_left > 0u;
    (*march).marching = (*march).marching && more;
    (*march).hit = (*march).hit && more;
}

fn reached_iteration_limit(march: RayMarch) -> bool {
    return march.iterations_left == 0u;
}

#ifdef SKIP_BRICKS
fn brick_at(ray: Ray, t: f32) -> vec3<i32> {
    return clamp(vec3<i32>(floor(ray.o + t * ray.d)), vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
}
#endif

// Advances the march to the next sample, or to the last sample in the empty bricks around it.
fn step(march: ptr<function, RayMarch>, ray: Ray) {
    count_step();
    let behind = sample_depth(ray, (*march).k);
    let next = next_sample((*march).k);
    let stretch = label_stretch(ray.o, ray.d, ray.inv_d, behind, sample_depth(ray, next));
    let ahead = stretch.end;
    var skips = false;
    var occupied = true;
    var k = select(next, ahead / ray.step_mm, stretch.cut);
#ifdef SKIP_BRICKS
    let brick = brick_at(ray, ahead);
    let distance = brick_distance_at(brick);
    occupied = distance == 0;
    // A segment between two inactive bricks is empty if they touch and thus share values, or if all bricks between
    // them are empty. A long step may pass an active brick.
    let apart = abs(brick - brick_at(ray, behind));
    let joined = max(apart.x, max(apart.y, apart.z)) <= max(distance - 1, 1);
    skips = !occupied && !(*march).occupied && joined;
    let forward = ray.d > vec3<f32>(0.0);
    let face = select((brick - (distance - 1)) * BRICK_CELLS, (brick + distance) * BRICK_CELLS, forward);
    let moves = abs(ray.d) >= vec3<f32>(1e-20);
    let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - ray.o) * ray.inv_d, moves);
    // Rounding may put the last face before the sample, which has passed it.
    k = select(k, max(floor(min(exits.x, min(exits.y, exits.z)) / ray.step_mm), k), skips);
#endif
    let value = value_at(ray.o + select(behind, ahead, (*march).valid) * ray.d);
    let last = (*march).value;
    let taken = (*march).valid && !skips;
    let visible = min(last, value) < field.last_value && max(last, value) > field.first_value;
    (*march).hit = taken && visible && !is_hidden(stretch.shift);
    (*march).segment_start = behind;
    (*march).segment_value = shifted_value(last, stretch.shift);
    (*march).shift = stretch.shift;
    (*march).value = value;
    // After a skip the last sample has no value yet: the next step reads it.
    let moves_on = taken || skips;
    (*march).k = select((*march).k, k, moves_on);
    (*march).occupied = select((*march).occupied, occupied, moves_on);
    (*march).valid = !skips;
    (*march).marching = !moves_on || sample_depth(ray, k) < ray.end;
}

// Advances the march until it hits a segment with extinction, the ray ends, or STEPS_TOGETHER steps are taken.
fn advance(march: ptr<function, RayMarch>, ray: Ray) {
    var steps = 0u;
    loop {
        steps += 1u;
        if (*march).marching && !(*march).hit {
            step(march, ray);
            count_iteration(march);
        }
        if (*march).hit || !(*march).marching || steps >= STEPS_TOGETHER { break; }
    }
}
