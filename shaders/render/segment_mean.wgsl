// Mean extinction and colour of a segment of an eye ray.
#define_import_path umbravox::segment_mean

#import umbravox::ray_march::Ray
#import umbravox::gradient_opacity::{next_cell_part, most_cell_parts}
#import umbravox::labels::shifted_value
#import umbravox::transfer::{color_integral_at, mean_color}

// Returns mean extinction (w, 1/mm) and extinction-weighted colour (rgb) for values that are linear from a to b.
fn mean_over(a: f32, b: f32) -> vec4<f32> {
    return mean_color(a, b, color_integral_at(a), color_integral_at(b));
}

#ifdef SHADING
// Returns mean extinction and colour over two halves, with values linear from a to `middle` and on to b.
fn mean_over_halves(a: f32, middle: f32, b: f32) -> vec4<f32> {
    let integral = color_integral_at(middle);
    let first = mean_color(a, middle, color_integral_at(a), integral);
    return 0.5 * (first + mean_color(middle, b, integral, color_integral_at(b)));
}
#endif

#ifdef GRADIENT_OPACITY
// Returns mean extinction and colour between two depths, cell by cell. `shift` is that of the label there.
fn mean_over_cells(ray: Ray, from_mm: f32, to_mm: f32, shift: f32) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    var at = from_mm;
    var parts_left = most_cell_parts(ray.d, to_mm - from_mm);
    loop {
        let part = next_cell_part(ray.o, ray.d, ray.inv_d, at, to_mm);
        let middle = shifted_value(part.values.y, shift);
        let first = part.factors.x * mean_over(shifted_value(part.values.x, shift), middle);
        let second = part.factors.y * mean_over(middle, shifted_value(part.values.z, shift));
        sum += 0.5 * (part.end - at) * (first + second);
        at = part.end;
        parts_left -= 1u;
        if at >= to_mm || parts_left == 0u { break; }
    }
    return sum / max(to_mm - from_mm, 1e-30);
}
#endif
