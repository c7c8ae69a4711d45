// March along a ray by regular samples that skips bricks without extinction: eye rays, and light rays with
// `march=samples`.
//
// Samples lie on the lattice k step, whatever is skipped, on the ends of the domain, and on surfaces that the caller
// finds. A march hits the segments between two samples that may have extinction.
//
// Loops here and in the callers exit at their last line: software adapters execute the body of a loop once more for
// an exit at its start.
#define_import_path umbravox::ray_march

#import umbravox::field::{field, value_at, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::labels::{CUTS_BY_LABEL, label_stretch, next_sample, parts_of_step, is_hidden, shifted_value}
#import umbravox::tuning::{quotient, EYE_STEPS_TOGETHER}
#import umbravox::work::count_step
#ifdef RAY_STATES
#import umbravox::field::{missing_page, NEAR_MISSING}
#endif

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
    // Number of steps to take before the march may skip, because samples before them lie in bricks with extinction.
    steps_unskipped: u32,
    // Whether the march goes on: the end of the ray is not reached.
    marching: bool,
    // Whether the march has hit a segment with extinction. The caller integrates it from `segment_start` to the last
    // sample, possibly in parts.
    hit: bool,
    segment_start: f32,
    segment_value: f32,
    // Shift added to the segment's values for its label.
    shift: f32,
#ifdef SURFACES
    // Value one step before the last sample; FAR if there is none.
    before: f32,
    // Search between two samples that the caller must make before the march goes on, one of the constants *_SEARCH.
    search: u32,
#endif
    // Number of iterations that all loops of the ray may still take.
    iterations_left: u32,
#ifdef RAY_STATES
    // Number of the page that must become resident before the next step; -1 if it is. Number of steps that `advance` had
    // taken before.
    missing: i32,
    steps_together: u32,
    // Lattice coordinate of the farthest sample around which all pages are resident. The march may return to samples before.
    resident_k: f32,
#endif
}

#ifdef SURFACES
const NO_SEARCH: u32 = 0u;
// The value passes the first value with extinction on the hit segment.
const SURFACE_SEARCH: u32 = 1u;
// The value may exceed the first value with extinction on both sides of the last sample.
const PEAK_SEARCH: u32 = 2u;
// Largest rise assumed beside a sample, in steps at the steeper of its two slopes.
const PEAK_STEPS: f32 = 2.0;
const FINDS_PEAKS: bool = CUTS_BY_LABEL == 1u;
#else
const FINDS_PEAKS: bool = false;
#endif
// Number of steps that end in empty bricks, the one that skips included, from a brick with extinction to the first skip.
// The first sample behind the brick may be the largest beside a peak in it.
const STEPS_UNSKIPPED: u32 = select(1u, 2u, FINDS_PEAKS);
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
    var march: RayMarch;
    march.k = floor(quotient(ray.start, ray.step_mm));
    march.steps_unskipped = STEPS_UNSKIPPED;
    march.marching = ray.start < ray.end;
#ifdef RAY_STATES
    march.missing = -1;
    march.resident_k = -FAR;
#endif
#ifdef SURFACES
    march.before = FAR;
#endif
    march.iterations_left = parts_of_step(ray.step_mm) * samples * iterations_a_sample + skips;
    return march;
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

// Returns whether the caller must search between two samples before the march goes on.
fn is_searching(march: RayMarch) -> bool {
#ifdef SURFACES
    return march.search != NO_SEARCH;
#else
    return false;
#endif
}

// Goes on after a search that the caller does not make: a march along light rays counts no peaks between its samples.
fn skip_search(march: ptr<function, RayMarch>) {
#ifdef SURFACES
    (*march).search = NO_SEARCH;
    (*march).before = FAR;
#endif
}

fn reached_iteration_limit(march: RayMarch) -> bool {
    return march.iterations_left == 0u;
}

#ifdef SKIP_BRICKS
fn brick_at(ray: Ray, t: f32) -> vec3<i32> {
    return clamp(vec3<i32>(floor(ray.o + t * ray.d)), vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
}
#endif

#ifdef RAY_STATES
#ifdef SKIP_BRICKS
// Distance in bricks of a sample to active bricks above which a step only skips: no step is longer than 8 voxels.
const ONLY_SKIPS: i32 = 3;
#endif

// Returns the number of a page that the next step and the shading of its segment read and that is not resident, or -1.
fn page_before_step(march: ptr<function, RayMarch>, ray: Ray) -> i32 {
    let next = next_sample((*march).k);
    if next <= (*march).resident_k { return -1; }
    let ahead = sample_depth(ray, next);
#ifdef SKIP_BRICKS
    if (*march).steps_unskipped == 0u && brick_distance_at(brick_at(ray, ahead)) > ONLY_SKIPS { return -1; }
#endif
    let missing = missing_page(vec3<i32>(floor(ray.o + ahead * ray.d)), NEAR_MISSING);
    (*march).resident_k = select((*march).resident_k, next, missing < 0);
    return missing;
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
    var k = select(next, quotient(ahead, ray.step_mm), stretch.cut);
#ifdef SKIP_BRICKS
    let brick = brick_at(ray, ahead);
    let distance = brick_distance_at(brick);
    // A segment between two inactive bricks is empty if they touch and thus share values, or if all bricks between
    // them are empty. A long step may pass an active brick.
    let apart = abs(brick - brick_at(ray, behind));
    let farthest = max(apart.x, max(apart.y, apart.z));
    let touch = select(farthest, apart.x + apart.y + apart.z, FINDS_PEAKS) <= 1;
    let joined = touch || farthest <= distance - 1;
    occupied = distance == 0 || FINDS_PEAKS && !joined;
    let forward = ray.d > vec3<f32>(0.0);
    let face = select((brick - (distance - 1)) * BRICK_CELLS, (brick + distance) * BRICK_CELLS, forward);
    let moves = abs(ray.d) >= vec3<f32>(1e-20);
    let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - ray.o) * ray.inv_d, moves);
    let last_empty = floor(quotient(min(exits.x, min(exits.y, exits.z)), ray.step_mm));
    // Rounding may put the last face before the sample, which has passed it.
    skips = distance > 0 && (*march).steps_unskipped == 0u && joined && (!FINDS_PEAKS || k < last_empty);
    k = select(k, max(last_empty, k), skips);
#endif
    // Whether samples enclose a peak must not depend on where a ray or a skip ends: one more sample comes first.
    let first = (*march).k - select(0.0, 1.0, FINDS_PEAKS);
    let value = value_at(ray.o + select(sample_depth(ray, first), ahead, (*march).valid) * ray.d);
    let last = (*march).value;
    let taken = (*march).valid && !skips;
    let visible = min(last, value) < field.last_value && max(last, value) > field.first_value;
    (*march).hit = taken && visible && !is_hidden(stretch.shift);
    var start = behind;
    var peak = false;
#ifdef SURFACES
    // Matter may also lie beside the largest of three samples without extinction. The segment's start is then the top
    // of the parabola through them.
    let before = (*march).before;
    let rise = last - before;
    let fall = last - value;
    let reaches = last + PEAK_STEPS * max(rise, fall) > field.first_value;
    peak = FINDS_PEAKS && taken && rise > 0.0 && fall >= 0.0 && last <= field.first_value && reaches;
    let top = behind + 0.5 * ray.step_mm * (rise - fall) / (rise + fall);
    start = select(behind, clamp(top, ray.t_in, ray.t_out), peak);
    (*march).search = select(NO_SEARCH, PEAK_SEARCH, peak);
    (*march).before = select(select(FAR, last, taken && k - (*march).k == 1.0), before, peak);
#endif
    (*march).segment_start = start;
    (*march).segment_value = shifted_value(last, stretch.shift);
    (*march).shift = stretch.shift;
    (*march).value = select(value, last, peak);
    // After a skip the last sample has no value yet: the next step reads it. A peak is searched first.
    let moves_on = (taken && !peak) || skips;
    (*march).k = select(select((*march).k, first, !(*march).valid), k, moves_on);
    let fewer = max((*march).steps_unskipped, 1u) - 1u;
    let steps_unskipped = select(fewer, STEPS_UNSKIPPED, occupied);
    (*march).steps_unskipped = select((*march).steps_unskipped, steps_unskipped, moves_on);
    (*march).valid = !skips;
    let goes_on = sample_depth(ray, select(k, k - 1.0, FINDS_PEAKS)) < ray.end && sample_depth(ray, k) < ray.t_out;
    (*march).marching = !moves_on || goes_on;
}

// Advances the march until it hits a segment with extinction, the ray ends, or EYE_STEPS_TOGETHER steps are taken.
fn advance(march: ptr<function, RayMarch>, ray: Ray) {
    var steps = 0u;
#ifdef RAY_STATES
    steps = (*march).steps_together;
    (*march).steps_together = 0u;
#endif
    loop {
#ifdef RAY_STATES
        if (*march).marching && !(*march).hit && !is_searching(*march) {
            (*march).missing = page_before_step(march, ray);
            if (*march).missing >= 0 {
                (*march).steps_together = steps;
                break;
            }
        }
#endif
        steps += 1u;
        if (*march).marching && !(*march).hit && !is_searching(*march) {
            step(march, ray);
            count_iteration(march);
        }
        if (*march).hit || is_searching(*march) || !(*march).marching || steps >= EYE_STEPS_TOGETHER { break; }
    }
}
