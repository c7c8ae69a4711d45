// A fixed number of nodes of one visibility function (Salvi et al. 2010).
//
// Where there are too many, the inner node is removed that changes the area under the curve least, which is the area of
// the triangle with its neighbours. The neighbours do not move.
#define_import_path umbravox::curve_nodes

#import umbravox::light::light
#import umbravox::avsm::params

const NODES: u32 = #{NODES};

// Largest number of nodes: a piece adds up to three to those that are stored.
const CAPACITY: u32 = #{NODES} + 4u;

// Curve nodes: depth as a fraction of the map's range, and transmittance.
var<private> nodes: array<vec2<f32>, #{NODES} + 4>;
var<private> count: u32;

fn start_nodes(row: u32) {
    count = 0u;
}

fn nodes_stored() -> u32 {
    return count;
}

// Returns the largest error in transmittance that compression may make before nodes are removed.
fn largest_error() -> f32 {
    return params.epsilon;
}

// Removes inner nodes until no more are left than are stored: each time the one that changes the area under the curve
// least.
fn remove_nodes() {
    loop {
        // The loops end at once where no node is too many. Compilers unroll loops with constant limits, and llvmpipe
        // then runs all of their iterations for every piece.
        let end = select(0u, count - 1u, count > NODES);
        var least = 1u;
        var least_area = 3.0e38;
        for (var i = 1u; i < end; i++) {
            let before = nodes[i] - nodes[i - 1u];
            let after = nodes[i + 1u] - nodes[i];
            let area = abs(before.x * after.y - before.y * after.x);
            if area < least_area {
                least = i;
                least_area = area;
            }
        }
        for (var i = least; i < end; i++) { nodes[i] = nodes[i + 1u]; }
        count = select(count, count - 1u, count > NODES);
        if count <= NODES { break; }
    }
}

// Stores a curve node at a depth in mm, and returns its transmittance.
fn store_point(z: f32, t: f32) -> f32 {
    nodes[min(count, CAPACITY - 1u)] = vec2<f32>((z - light.depth_start_mm) / light.depth_range_mm, t);
    count += 1u;
    return t;
}

fn finish_nodes(value: f32) {}

// Returns a node of the curve, which is constant behind the last node.
fn node(i: u32) -> vec2<f32> {
    return select(vec2<f32>(2.0, nodes[max(count, 1u) - 1u].y), nodes[min(i, NODES - 1u)], i < count);
}
