// Sink that compresses the visibility function of one ray, and keeps a fixed number of its nodes (Salvi et al. 2010).
#define_import_path umbravox::sink

#import umbravox::avsm::params
#import umbravox::compression
#import umbravox::curve_nodes::{node, nodes_stored, remove_nodes}
#import umbravox::vectors::vector_map

struct Sink {
    optical_depth: f32,
    // Largest optical depth of a piece at the present transmittance whose chord stays within the error tolerance.
    longest_depth: f32,
}

fn start_sink(march: u32) -> Sink {
    compression::start_writer(0u);
    return Sink(0.0, params.longest_depth);
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return (*sink).longest_depth;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    (*sink).optical_depth += min(depth, vector_map.max_depth);
    let half = exp(-0.5 * (*sink).optical_depth);
    (*sink).longest_depth = params.longest_depth / half;
    compression::push(z_from, z_to, half * half);
    remove_nodes();
    return (*sink).optical_depth >= vector_map.max_depth;
}

fn finish() {
    compression::finish();
    remove_nodes();
}

fn met_extinction() -> bool {
    return nodes_stored() > 0u;
}

fn stored_vector(v: u32) -> vec4<f32> {
    return vec4<f32>(node(2u * v), node(2u * v + 1u));
}
