// Optical depth between two depths of a ray, with a gradient opacity: cell by cell. Only with GRADIENT_OPACITY.
#define_import_path umbravox::gradient_depth

#import umbravox::gradient_opacity::{next_cell_part, most_cell_parts}
#import umbravox::labels::{shifted_value, clamped_value}
#import umbravox::transfer::{integral_at, mean_between}

#ifdef GRADIENT_OPACITY
// Returns the optical depth of a length on which the value changes linearly from a to b.
fn linear_depth(a: f32, b: f32, length_mm: f32) -> f32 {
    // Part of the length whose values may have extinction.
    let first = clamped_value(a);
    let last = clamped_value(b);
    let share = select((last - first) / select(b - a, 1.0, b == a), 1.0, b == a);
    return mean_between(first, last, integral_at(first), integral_at(last)) * share * length_mm;
}

// Returns the optical depth of the ray o + t d (grid space, d per mm) between two depths, mm. `shift` is that of the label
// there.
fn gradient_depth(o: vec3<f32>, d: vec3<f32>, inv_d: vec3<f32>, from_mm: f32, to_mm: f32, shift: f32) -> f32 {
    var depth = 0.0;
    var at = from_mm;
    var parts_left = most_cell_parts(d, to_mm - from_mm);
    loop {
        let part = next_cell_part(o, d, inv_d, at, to_mm);
        let half_mm = 0.5 * (part.end - at);
        let middle = shifted_value(part.values.y, shift);
        depth += part.factors.x * linear_depth(shifted_value(part.values.x, shift), middle, half_mm)
            + part.factors.y * linear_depth(middle, shifted_value(part.values.z, shift), half_mm);
        at = part.end;
        parts_left -= 1u;
        if at >= to_mm || parts_left == 0u { break; }
    }
    return depth;
}
#endif
