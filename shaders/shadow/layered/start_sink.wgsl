// Sink that ends a ray at its first extinction.
#define_import_path umbravox::sink

struct Sink {
    start_mm: f32,
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return 1e30;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if depth > 0.0 { (*sink).start_mm = z_from; }
    return depth > 0.0;
}
