// Surfaces between two samples of an eye ray: depths at which the volume's value reaches the first value with
// extinction, and peaks of the value that two samples enclose. Linear values between samples would move a surface into
// or out of its own shadow, and miss what is thinner than a step.
//
// A filter with weights of 8 bits would move a surface by up to 1/256 of a voxel, into or out of its own shadow. With such
// a filter the search interpolates in float32, and first moves the two ends of its range apart.
#define_import_path umbravox::between_samples

#import umbravox::field::{field, exact_value_at, FAR}
#import umbravox::ray_march::{Ray, RayMarch, sample_depth, NO_SEARCH, PEAK_SEARCH, STEPS_UNSKIPPED}
#import umbravox::tuning::{quotient, COARSE_FILTER}

// Largest number of samples in the search for a surface, and number of samples in the search for a peak.
const SURFACE_SAMPLES: u32 = 6u;
const PEAK_SAMPLES: u32 = 4u;
// Number of samples that move the ends of a range apart, and the distance of that, in smallest voxel spacings.
const WIDENING_SAMPLES: u32 = select(0u, 2u, COARSE_FILTER);
const WIDENING: f32 = 1.0 / 64.0;
// Difference from the first value with extinction at which a sample is on the surface, as a fraction of the segment's
// change of value.
const ON_SURFACE: f32 = 2e-3;

// Depth on an eye ray, mm, and the volume's value there, less the first value with extinction.
struct Sample {
    t: f32,
    excess: f32,
}

// Returns the depth at which values that are linear between two samples are 0.
fn linear_root(a: Sample, b: Sample) -> f32 {
    return a.t - a.excess * (b.t - a.t) / (b.excess - a.excess);
}

// Returns whether matter begins or ends on the hit segment and would be opaque all along it. `thickness` is the segment's
// optical depth, divided by that of an opaque segment.
fn crosses_surface(march: RayMarch, thickness: f32) -> bool {
    let start = march.segment_value - field.first_value;
    let end = march.value - field.first_value;
    return min(start, end) < 0.0 && thickness * abs(end - start) > max(start, end);
}

// Ends the search of a march: the hit segment that crosses a surface ends or starts there, or a segment next to a peak
// is hit.
fn find_surface(march: ptr<function, RayMarch>, ray: Ray) {
    let seeks_peak = (*march).search == PEAK_SEARCH;
    let here = sample_depth(ray, (*march).k);
    let start = Sample((*march).segment_start, (*march).segment_value - field.first_value);
    let end = Sample(here, (*march).value - field.first_value);
    // Depths around a peak where the ray enters another cell: trilinear values bend there.
    let before_t = sample_depth(ray, (*march).k - 1.0);
    let g = ray.o + before_t * ray.d;
    let faces = select(ceil(g) - 1.0, floor(g) + 1.0, ray.inv_d > vec3<f32>(0.0));
    let crossings = before_t + (faces - g) * ray.inv_d;
    let bends = select(vec3<f32>(start.t), crossings, crossings < vec3<f32>(sample_depth(ray, (*march).k + 1.0)));

    let enters = start.excess < end.excess;
    var outside = end;
    var inside = start;
    if enters { outside = start; inside = end; }
    // Weights of the two ends.
    var weights = vec2<f32>(1.0);
    var top = Sample(here, end.excess);
    let on_surface = select(ON_SURFACE * abs(end.excess - start.excess), -1.0, seeks_peak);
    // The count is not constant, so that compilers do not unroll the loop: software adapters would take all samples,
    // whether a lane searches or not.
    let samples = select(WIDENING_SAMPLES + SURFACE_SAMPLES, PEAK_SAMPLES, seeks_peak);
    let widens = select(WIDENING_SAMPLES, 0u, seeks_peak);
    let inward_mm = select(-WIDENING, WIDENING, inside.t > outside.t) * field.min_spacing_mm;
    var was_inside = false;
    var i = 0u;
    loop {
        let root = linear_root(Sample(outside.t, weights.x * outside.excess), Sample(inside.t, weights.y * inside.excess));
        let bend = select(select(select(start.t, bends.z, i == 2u), bends.y, i == 1u), bends.x, i == 0u);
        let end_t = clamp(select(inside.t + inward_mm, outside.t - inward_mm, i == 0u), ray.t_in, ray.t_out);
        let t = select(select(root, bend, seeks_peak), end_t, i < widens);
        let next = Sample(t, exact_value_at(ray.o + t * ray.d) - field.first_value);
        if next.excess > top.excess { top = next; }
        // Illinois method (Dowell & Jarratt 1971): the weight of an end that stays twice is halved.
        let is_inside = next.excess > 0.0;
        let again = select(1.0, 0.5, i > widens && is_inside == was_inside);
        weights = select(vec2<f32>(1.0, again * weights.y), vec2<f32>(again * weights.x, 1.0), is_inside);
        was_inside = is_inside;
        // An end moves apart only on its own side of the surface: beyond it lies another surface.
        let moves_end = i >= widens || is_inside == (i == 1u);
        if is_inside && moves_end { inside = next; }
        if !is_inside && moves_end { outside = next; }
        i += 1u;
        if i >= samples || i > widens && abs(next.excess) < on_surface { break; }
    }
    if seeks_peak {
        let first = top.t < here;
        (*march).hit = top.excess > 0.0;
        (*march).segment_start = select(here, before_t, first);
        (*march).segment_value = select((*march).value, (*march).before, first);
        // Rounding must not put the peak before the sample in front of it: the march would find it again.
        let at_top = max(quotient(top.t, ray.step_mm), (*march).k - 1.0);
        (*march).k = select((*march).k, at_top, (*march).hit);
        (*march).value = select((*march).value, field.first_value + top.excess, (*march).hit);
        (*march).steps_unskipped = select((*march).steps_unskipped, STEPS_UNSKIPPED, (*march).hit);
    } else {
        // A widened range may put the surface beside the segment. Its part behind or in front of the surface is not negative.
        let root = linear_root(outside, inside);
        let surface = select(max(root, start.t), min(root, end.t), enters);
        (*march).hit = true;
        (*march).segment_start = select(start.t, surface, enters);
        (*march).segment_value = select((*march).segment_value, field.first_value, enters);
        // Likewise, the next step must not repeat this segment.
        let at_surface = clamp(quotient(surface, ray.step_mm), ceil((*march).k) - 1.0, (*march).k);
        (*march).k = select(at_surface, (*march).k, enters);
        (*march).value = select(field.first_value, (*march).value, enters);
    }
    (*march).before = FAR;
    (*march).search = NO_SEARCH;
}
