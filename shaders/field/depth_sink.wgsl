// Sink that adds up the optical depth of a ray.
#define_import_path umbravox::sink

#import umbravox::sums::{Sum, empty_sum, add_term}

struct Sink {
    optical_depth: Sum,
}

const FAR: f32 = #{FAR};
// Optical depth that ends the ray: its transmittance is below 1e-6.
const ENOUGH_DEPTH: f32 = #{ENOUGH_DEPTH};

fn start_sink() -> Sink {
    return Sink(empty_sum());
}

// The sink has no limit on the optical depth of a piece, since it does not store the shape of the curve.
fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return FAR;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    (*sink).optical_depth = add_term((*sink).optical_depth, depth);
    return (*sink).optical_depth.total > ENOUGH_DEPTH;
}
