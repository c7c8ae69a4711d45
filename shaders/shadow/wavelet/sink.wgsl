// Sink that computes the Haar wavelet coefficients of extinction along one ray (after Aizenshtein et al. 2022).
//
// The coefficient of a wavelet is half the difference between the optical depths of the two halves of its support. It
// follows from the optical depths in front of the start, the middle and the end of the support, which are nodes:
// multiples of 2^-rank of the depth range. So a piece stores only the optical depths at the nodes that it passes.
#define_import_path umbravox::sink

#import umbravox::series_range::{range_start, range_mm, start_range, extend_range, stored_range}
#import umbravox::vectors::{vector_map, VECTORS}
#ifdef RAY_STATES
#import umbravox::series_range::{save_range, load_range}
#import umbravox::ray_state::{put_word, put_float, take_word, take_float}
#endif

const RANK: u32 = #{RANK};
const FAR: f32 = #{FAR};
// Largest optical depth of a piece with a node, at transmittance 1: the piece counts as uniform.
const LONGEST_DEPTH: f32 = #{LONGEST_DEPTH};
// Number of coefficients, and of intervals between nodes.
const LEAVES: u32 = 1u << RANK;

struct Sink {
    optical_depth: f32,
}

// Optical depths in front of the nodes, without the node at the start of the range.
var<private> nodes: array<f32, LEAVES>;
// Number of nodes that the march has passed; the node at the end of the range is left to `finish`.
var<private> passed: u32;
var<private> total_depth: f32;

fn start_sink(march: u32) -> Sink {
    passed = select(0u, LEAVES - 1u, start_range(march));
    total_depth = 0.0;
    return Sink(0.0);
}

// Returns the position of a depth, in intervals between nodes.
fn node_coordinate(z: f32) -> f32 {
    return (z - range_start) * (f32(LEAVES) / range_mm);
}

// Only the optical depth at nodes is stored: a stretch without nodes may be one piece of any length.
fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    let passes = passed < LEAVES - 1u && node_coordinate(z_to) >= f32(passed + 1u);
    return select(FAR, LONGEST_DEPTH * exp(0.5 * (*sink).optical_depth), passes);
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    let before = (*sink).optical_depth;
    let d = min(depth, vector_map.max_depth - before);
    // The piece ends where the ray ends.
    let z_end = z_from + (z_to - z_from) * (d / depth);
    extend_range(z_from, z_end, before == 0.0);
    let start = node_coordinate(z_from);
    let end = node_coordinate(z_end);
    let nodes_in_front = u32(clamp(end, 0.0, f32(LEAVES - 1u)));
    for (var n = passed; n < nodes_in_front; n++) {
        nodes[n] = before + d * clamp((f32(n + 1u) - start) / max(end - start, 1e-30), 0.0, 1.0);
    }
    passed = max(passed, nodes_in_front);
    total_depth = before + d;
    (*sink).optical_depth = total_depth;
    return total_depth >= vector_map.max_depth;
}

fn finish() {
    for (var n = passed; n < LEAVES; n++) { nodes[n] = total_depth; }
}

fn met_extinction() -> bool {
    return total_depth > 0.0;
}

// Returns the optical depth in front of a node.
fn depth_before(node: u32) -> f32 {
    return select(nodes[clamp(node, 1u, LEAVES) - 1u], 0.0, node == 0u);
}

// Returns coefficient i: the optical depth of the ray, then the wavelets level by level from the widest one.
fn coefficient(i: u32) -> f32 {
    let level = firstLeadingBit(clamp(i, 1u, LEAVES - 1u));
    let width = LEAVES >> level;
    let start = (i - (1u << level)) * width;
    let wavelet = depth_before(start + width / 2u) - 0.5 * (depth_before(start) + depth_before(start + width));
    return select(select(0.0, wavelet, i < LEAVES), total_depth, i == 0u);
}

fn stored_vector(v: u32) -> vec4<f32> {
    let i = 4u * v;
    var last = vec2<f32>(coefficient(i + 2u), coefficient(i + 3u));
#ifdef TEXEL_RANGE
    // The last vector has room for the range.
    last = select(last, stored_range(), v == VECTORS - 1u);
#endif
    return vec4<f32>(coefficient(i), coefficient(i + 1u), last);
}

#ifdef RAY_STATES
// Stores the state of a ray that waits.
fn save_sink(sink: ptr<function, Sink>) {
    put_float((*sink).optical_depth);
    save_range();
    put_word(passed);
    for (var n = 0u; n < LEAVES; n++) { put_float(nodes[n]); }
}

// Restores the state of a ray that has waited.
fn load_sink(sink: ptr<function, Sink>) {
    total_depth = take_float();
    (*sink).optical_depth = total_depth;
    load_range();
    passed = take_word();
    for (var n = 0u; n < LEAVES; n++) { nodes[n] = take_float(); }
}
#endif
