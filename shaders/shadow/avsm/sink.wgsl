// Sink that computes a fixed number of nodes of the visibility function of one ray (Salvi et al. 2010, 3.2).
//
// A piece adds one node, or two after a gap. If there are too many nodes, the inner node is removed that changes the
// area under the curve least, which is the area of the triangle with its neighbours. The neighbours do not move.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::vectors::vector_map
#import umbravox::avsm::params

const NODES: u32 = #{NODES};

struct Sink {
    optical_depth: f32,
    // Largest optical depth of a piece at the present transmittance whose chord stays within the error tolerance.
    longest_depth: f32,
}

// Curve nodes: depth as a fraction of the map's range, and transmittance. There are two more than are stored.
var<private> nodes: array<vec2<f32>, #{NODES} + 2>;
var<private> count: u32;

fn start_sink(march: u32) -> Sink {
    count = 0u;
    return Sink(0.0, params.longest_depth);
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return (*sink).longest_depth;
}

// Removes inner curve nodes until there is room for two more.
fn remove_nodes() {
    loop {
        if count <= NODES { break; }
        var least = 1u;
        var least_area = 3.0e38;
        for (var i = 1u; i <= NODES; i++) {
            let before = nodes[i] - nodes[i - 1u];
            let after = nodes[min(i + 1u, NODES + 1u)] - nodes[i];
            let area = abs(before.x * after.y - before.y * after.x);
            if i + 1u < count && area < least_area {
                least = i;
                least_area = area;
            }
        }
        for (var i = 1u; i <= NODES; i++) {
            if i >= least { nodes[i] = nodes[i + 1u]; }
        }
        count -= 1u;
    }
}

fn append(z: f32, visible: f32) {
    nodes[min(count, NODES + 1u)] = vec2<f32>((z - light.depth_start_mm) / light.depth_range_mm, visible);
    count += 1u;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    let share = (z_from - light.depth_start_mm) / light.depth_range_mm;
    if count == 0u || share > nodes[min(max(count, 1u), NODES + 2u) - 1u].x {
        append(z_from, exp(-(*sink).optical_depth));
    }
    (*sink).optical_depth += min(depth, vector_map.max_depth);
    let half = exp(-0.5 * (*sink).optical_depth);
    (*sink).longest_depth = params.longest_depth / half;
    append(z_to, half * half);
    remove_nodes();
    return (*sink).optical_depth >= vector_map.max_depth;
}

fn finish() {}

fn met_extinction() -> bool {
    return count > 0u;
}

// Returns a node of the curve, which is constant behind the last node.
fn node(i: u32) -> vec2<f32> {
    return select(vec2<f32>(2.0, nodes[max(count, 1u) - 1u].y), nodes[min(i, NODES - 1u)], i < count);
}

fn stored_vector(v: u32) -> vec4<f32> {
    return vec4<f32>(node(2u * v), node(2u * v + 1u));
}
