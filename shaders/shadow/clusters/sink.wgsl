// Sink that gathers the matter along one ray in clusters of depth (Mertens et al. 2004): optical depth, mean and spread of
// each.
//
// The first march, from behind, finds where matter ends. The next ones give every piece to the cluster whose mean is
// nearest: first means spread evenly between where matter begins and ends, then those that the march before has found.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::vectors::own

const CLUSTERS: u32 = #{CLUSTERS};
const FAR: f32 = #{FAR};

struct Sink {
    optical_depth: f32,
}

// Means that pieces are given by, as shares of the map's depth.
var<private> means: array<f32, CLUSTERS>;
// Of each cluster: optical depth, and that times the distance from the mean, and its square.
var<private> sums: array<vec3<f32>, CLUSTERS>;
var<private> seeking: bool;
var<private> begun: bool;
var<private> met: bool;
var<private> end: f32;

fn share_of(z: f32) -> f32 {
    return (z - light.depth_start_mm) / light.depth_range_mm;
}

// Mean of a cluster; the one that it was gathered by where it is empty.
fn mean_of(c: u32) -> f32 {
    return means[c] + sums[c].y / max(sums[c].x, 1e-30);
}

fn start_sink(turn: u32) -> Sink {
    seeking = turn == 0u;
    begun = turn > 1u;
    met = turn > 0u && met;
    for (var c = 0u; c < CLUSTERS; c++) {
        if begun { means[c] = mean_of(c); }
        sums[c] = vec3<f32>(0.0);
    }
    return Sink(0.0);
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return FAR;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    met = true;
    if seeking {
        // This march looks from behind: its depths are negative, and its first piece starts at the end.
        end = share_of(-z_from);
        return true;
    }
    let d = min(depth, own.most_depth - (*sink).optical_depth);
    let a = share_of(z_from);
    // Where the ray is over, so is the piece.
    let b = share_of(z_from + (z_to - z_from) * (d / depth));
    if !begun {
        begun = true;
        for (var c = 0u; c < CLUSTERS; c++) { means[c] = mix(a, end, (f32(c) + 0.5) / f32(CLUSTERS)); }
    }
    let middle = 0.5 * (a + b);
    var nearest = 0u;
    for (var c = 1u; c < CLUSTERS; c++) {
        nearest = select(nearest, c, abs(means[c] - middle) < abs(means[nearest] - middle));
    }
    let off = middle - means[nearest];
    // The mean square over an even piece is that of its middle and a twelfth of its length's.
    sums[nearest] += d * vec3<f32>(1.0, off, off * off + (b - a) * (b - a) / 12.0);
    (*sink).optical_depth += d;
    return (*sink).optical_depth >= own.most_depth;
}

fn finish() {}

fn met_something() -> bool {
    return met;
}

// Mean, spread and optical depth of each cluster, one after another.
fn number(i: u32) -> f32 {
    let c = min(i / 3u, CLUSTERS - 1u);
    let depth = sums[c].x;
    let off = sums[c].y / max(depth, 1e-30);
    let spread = sqrt(max(sums[c].z / max(depth, 1e-30) - off * off, 0.0));
    let of_cluster = select(select(depth, spread, i % 3u == 1u), means[c] + off, i % 3u == 0u);
    return select(0.0, of_cluster, i < 3u * CLUSTERS && depth > 0.0);
}

fn vector_of(v: u32) -> vec4<f32> {
    return vec4<f32>(number(4u * v), number(4u * v + 1u), number(4u * v + 2u), number(4u * v + 3u));
}
