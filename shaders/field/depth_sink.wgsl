// Sink that only adds up the optical depth of a stretch of ray.
#define_import_path umbravox::sink

#import umbravox::sums::{Sum, empty_sum, with_part}

struct Sink {
    optical_depth: Sum,
}

// Nobody looks inside a piece.
const FAR: f32 = #{FAR};
// Beyond this the transmittance is nothing to a picture (1e-6).
const ENOUGH_DEPTH: f32 = 13.8;

fn start_sink() -> Sink {
    return Sink(empty_sum());
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return FAR;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    (*sink).optical_depth = with_part((*sink).optical_depth, depth);
    return (*sink).optical_depth.total > ENOUGH_DEPTH;
}
