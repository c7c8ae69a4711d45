// Sink that only adds up the optical depth of a stretch of ray.
#define_import_path umbravox::sink

struct Sink {
    optical_depth: f32,
    // Optical depth that one piece may span; fixed here, since nobody looks inside a piece.
    longest_depth: f32,
}

fn total_sink() -> Sink {
    return Sink(0.0, 0.5);
}

// Beyond this the transmittance is nothing to a picture (1e-6).
const ENOUGH_DEPTH: f32 = 13.8;

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    (*sink).optical_depth += depth;
    return (*sink).optical_depth > ENOUGH_DEPTH;
}
