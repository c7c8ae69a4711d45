// The light march by regular samples (Hadwiger et al. 2006, 3.2 and 3.3): the volume's hardware filter at depths that are
// multiples of `light.step_mm`, and between two of them the transfer function's integrals, as if the value went straight.
//
// It offers what `shaders/field/march.wgsl` does, with the same contract for the sink, but promises nothing: what lies
// between two samples may be missed.
#define_import_path umbravox::march

#import umbravox::field::field
#import umbravox::walk::{line_through, start_walk, walk_on, count_turn, exhausted, sample_depth}
#import umbravox::transfer::{integral_at, mean_between}
#import umbravox::light::light
#import umbravox::sink::{Sink, sink_piece, longest_depth}
#import umbravox::watch::ran_out
#import umbravox::work::{count_work, PIECES}

// Parts of one stretch, all of one length.
const STRETCH_PARTS: f32 = 16.0;

// Marches the ray o + z d (grid space, d per mm) over the depths [z_from, z_to].
fn march(sink: ptr<function, Sink>, o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) {
    let line = line_through(o, d, z_from, z_to, light.step_mm);
    var walk = start_walk(line, u32(STRETCH_PARTS) + 4u);
    var done = false;
    // Length of the parts of a stretch; 0 where one begins.
    var part_mm = 0.0;
    loop {
        walk_on(&walk, line);
        if walk.found {
            // What of the stretch has values that may have extinction: it starts and ends where they do.
            let behind = sample_depth(line, walk.k);
#ifdef LABELS
            let a = walk.from_value;
            let b = walk.value;
#else
            let a = clamp(walk.from_value, field.first_value, field.last_value);
            let b = clamp(walk.value, field.first_value, field.last_value);
#endif
            let rise = walk.value - walk.from_value;
            let mm_a_value = (behind - walk.from_t) / select(rise, 1.0, rise == 0.0);
            let start = walk.from_t + (a - walk.from_value) * mm_a_value;
            let stretch_end = max(behind - (walk.value - b) * mm_a_value, start);
            let at_a = integral_at(a);
            if part_mm == 0.0 {
                // The sink says how long a piece may be.
                let length = stretch_end - start;
                let depth = mean_between(a, b, at_a, integral_at(b)) * length;
                part_mm = length / clamp(ceil(depth / longest_depth(sink, start, stretch_end)), 1.0, STRETCH_PARTS);
            }
            // A part that float32 cannot tell from nothing takes the rest.
            let last = start + 1.5 * part_mm > stretch_end || start + part_mm <= start;
            let to = select(start + part_mm, stretch_end, last);
            let value = select(mix(a, b, part_mm / max(stretch_end - start, 1e-30)), b, last);
            done = sink_piece(sink, start, to, mean_between(a, value, at_a, integral_at(value)) * (to - start));
            walk.from_t = to;
            walk.from_value = value;
            walk.found = !last;
            part_mm = select(part_mm, 0.0, last);
            count_work(PIECES, 1u);
            count_turn(&walk);
        }
        if done || !(walk.found || walk.walking) { break; }
    }
    // Some adapters end loops that they find long, and say nothing.
    if exhausted(walk) || (walk.walking && !done) { ran_out(); }
}
