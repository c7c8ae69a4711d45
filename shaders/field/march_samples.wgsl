// Light march by regular samples (Hadwiger et al. 2006, 3.2 and 3.3): the volume's hardware filter at depths that are
// multiples of `light.step_mm`. Between two samples the value is taken to be linear, and the integrals of the
// transfer function give the optical depth.
//
// It offers the same function as `shaders/field/march.wgsl` under the same contract for the sink, but without an
// error bound: it may miss anything between two samples.
#define_import_path umbravox::march

#import umbravox::gradient_depth::gradient_depth
#import umbravox::labels::clamped_value
#import umbravox::ray_march::{ray_through, start_march, advance, skip_search, count_iteration, reached_iteration_limit, sample_depth, segment_end_value}
#import umbravox::transfer::{integral_at, mean_between}
#import umbravox::light::light
#import umbravox::sink::{Sink, sink_piece, longest_depth}
#import umbravox::watch::report_iteration_limit
#import umbravox::work::{count_work, PIECES}

// Largest number of equal pieces of one segment between two samples.
const MAX_PIECES: f32 = 16.0;

// Marches the ray o + z d (grid space, d per mm) over the depths [z_from, z_to].
fn march(sink: ptr<function, Sink>, o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) {
    let ray = ray_through(o, d, z_from, z_to, light.step_mm);
    var state = start_march(ray, u32(MAX_PIECES) + 4u);
    var done = false;
    // Length of the pieces of a segment, mm; 0 at the start of a segment.
    var piece_mm = 0.0;
    loop {
        advance(&state, ray);
        skip_search(&state);
        if state.hit {
            // Part of the segment whose values may have extinction.
            let behind = sample_depth(ray, state.k);
            let end_value = segment_end_value(state);
            let a = clamped_value(state.segment_value);
            let b = clamped_value(end_value);
            let rise = end_value - state.segment_value;
            let mm_a_value = (behind - state.segment_start) / select(rise, 1.0, rise == 0.0);
            let start = state.segment_start + (a - state.segment_value) * mm_a_value;
            let end = max(behind - (end_value - b) * mm_a_value, start);
            let at_a = integral_at(a);
            if piece_mm == 0.0 {
                // The sink limits the optical depth of a piece.
                let length = end - start;
                let depth = mean_between(a, b, at_a, integral_at(b)) * length;
                piece_mm = length / clamp(ceil(depth / longest_depth(sink, start, end)), 1.0, MAX_PIECES);
            }
            // If a piece is too short for float32, the last piece takes the rest of the segment.
            let last = start + 1.5 * piece_mm > end || start + piece_mm <= start;
            let to = select(start + piece_mm, end, last);
            let value = select(mix(a, b, piece_mm / max(end - start, 1e-30)), b, last);
#ifdef GRADIENT_OPACITY
            done = sink_piece(sink, start, to, gradient_depth(ray.o, ray.d, ray.inv_d, start, to, state.shift));
#else
            done = sink_piece(sink, start, to, mean_between(a, value, at_a, integral_at(value)) * (to - start));
#endif
            state.segment_start = to;
            state.segment_value = value;
            state.hit = !last;
            piece_mm = select(piece_mm, 0.0, last);
            count_work(PIECES, 1u);
            count_iteration(&state);
        }
        if done || !(state.hit || state.marching) { break; }
    }
    if reached_iteration_limit(state) || (state.marching && !done) { report_iteration_limit(); }
}
