// Transmittance of a scene's shadows with `near`: the last voxels towards the light are marched, and the shadow map
// answers beyond them. A shadow map is wrong between its texels, most of all close to a surface that shadows itself.
//
// The march takes filtered samples, at an eighth of a voxel from the point and then at twice the distance each, up to
// half a voxel apart: matter next to the point decides whether it shadows itself. Between two samples the value is
// taken to be linear, and the integrals of the transfer function give the optical depth, so that no peak is missed
// (Hadwiger et al. 2006, 3.2).
//
// A map with an error bound also gives the range that it allows at the point. The march then only chooses within that
// range, and none is needed where the range is narrow.
#define_import_path umbravox::shadow

#ifdef KNOWN_RANGE
#import umbravox::method::{transmittance as method_transmittance, ranged_transmittance}
#else
#import umbravox::method::transmittance as method_transmittance
#endif
#import umbravox::field::{field, value_at, safe_inverse, box_span, clipped_span}
#import umbravox::gradient_depth::gradient_depth
#import umbravox::labels::{label_shift, shifted_value, clamped_value, is_hidden}
#import umbravox::light::{light, toward_light}
#import umbravox::transfer::{integral_at, mean_between}

// Range of transmittance within which the answer of the map is taken as it is.
const NARROW_RANGE: f32 = 0.01;
// Optical depth that ends the march: its transmittance is below 1e-6.
const ENOUGH_DEPTH: f32 = #{ENOUGH_DEPTH};

// Returns the distance of sample k from the point, in smallest voxel spacings: 1/8, 1/4, 1/2, 1, and half a spacing more
// for each further sample.
fn sample_distance(k: f32) -> f32 {
    return select(exp2(k - 4.0), 0.5 * k - 1.0, k >= 4.0);
}

// Returns the number of the first sample at a distance or beyond it.
fn sample_after(distance: f32) -> f32 {
    return ceil(select(log2(max(distance, 0.1)) + 4.0, 2.0 * distance + 2.0, distance >= 1.0));
}

// Returns the optical depth of the ray g + z d over the depths from 0 to z_end (mm).
fn near_depth(g: vec3<f32>, d: vec3<f32>, z_end: f32) -> f32 {
    let inv_d = safe_inverse(d);
    // Clamped values beyond the domain have no extinction.
    let span = clipped_span(g, d, box_span(g, inv_d, d, vec3<f32>(0.5), vec3<f32>(field.size) + 0.5));
    let start = max(span.x, 0.0);
    let length = max(min(span.y, z_end) - start, 0.0);
    let samples = max(sample_after(length / field.min_spacing_mm), 1.0);
    var k = 0.0;
    var behind = start;
    var last = value_at(g + start * d);
    var sum = 0.0;
    loop {
        k += 1.0;
        let ahead = select(start + sample_distance(k) * field.min_spacing_mm, start + length, k >= samples);
        let step = ahead - behind;
        // The label in the middle of the step holds for the whole step.
        let shift = label_shift(g + 0.5 * (behind + ahead) * d);
        let next = value_at(g + ahead * d);
        let visible = min(last, next) < field.last_value && max(last, next) > field.first_value && !is_hidden(shift);
#ifdef GRADIENT_OPACITY
        let depth = gradient_depth(g, d, inv_d, behind, ahead, shift);
#else
        // Part of the step whose values may have extinction.
        let value_a = shifted_value(last, shift);
        let value_b = shifted_value(next, shift);
        let a = clamped_value(value_a);
        let b = clamped_value(value_b);
        let mm_a_value = step / select(value_b - value_a, 1.0, value_b == value_a);
        let part_mm = max(step - (a - value_a) * mm_a_value - (value_b - b) * mm_a_value, 0.0);
        let depth = mean_between(a, b, integral_at(a), integral_at(b)) * part_mm;
#endif
        sum += select(0.0, depth, visible);
        last = next;
        behind = ahead;
        if k >= samples || sum > ENOUGH_DEPTH { break; }
    }
    return sum;
}

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
#ifdef KNOWN_RANGE
    let map = ranged_transmittance(g);
    if map.most - map.least <= NARROW_RANGE { return map.mean; }
#endif
    let to_light = toward_light(g);
    let near_mm = min(light.near_mm, to_light.mm);
    let depth = near_depth(g, to_light.d, near_mm);
    var beyond = 1.0;
    // The map is not needed behind opaque matter, or if the march reaches the light.
    if depth <= ENOUGH_DEPTH && near_mm < to_light.mm { beyond = method_transmittance(g + near_mm * to_light.d); }
    let marched = exp(-depth) * beyond;
#ifdef KNOWN_RANGE
    return clamp(marched, map.least, map.most);
#else
    return marched;
#endif
}
