// Sink that passes the visibility function of one ray to the compression, piece by piece.
#define_import_path umbravox::sink

#import umbravox::compression::push
#import umbravox::dsm_layout::params
#import umbravox::segments::LONGEST_PIECE
#import umbravox::sums::{Sum, empty_sum, add_term}
#ifdef RAY_STATES
#import umbravox::sums::{put_sum, take_sum}
#import umbravox::ray_state::{put_float, take_float}
#import umbravox::compression::{save_writer, load_writer}
#endif

// Optical depth at which the ray ends (a term of the error bound).
const OPAQUE_DEPTH: f32 = #{OPAQUE_DEPTH};

struct Sink {
    optical_depth: Sum,
    // Largest optical depth of a piece at the present transmittance whose chord stays within the error tolerance.
    longest_depth: f32,
}

fn start_sink() -> Sink {
    return Sink(empty_sum(), params.longest_depth);
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return (*sink).longest_depth;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if depth <= 0.0 { return false; }
    (*sink).optical_depth = add_term((*sink).optical_depth, depth);
    let half = exp(-0.5 * (*sink).optical_depth.total);
    (*sink).longest_depth = min(params.longest_depth / half, LONGEST_PIECE);
    push(z_from, z_to, half * half);
    return (*sink).optical_depth.total > OPAQUE_DEPTH;
}

#ifdef RAY_STATES
// Stores the state of a ray that waits.
fn save_sink(sink: ptr<function, Sink>) {
    put_sum((*sink).optical_depth);
    put_float((*sink).longest_depth);
    save_writer();
}

// Restores the state of a ray that has waited.
fn load_sink(sink: ptr<function, Sink>) {
    (*sink).optical_depth = take_sum();
    (*sink).longest_depth = take_float();
    load_writer();
}
#endif
