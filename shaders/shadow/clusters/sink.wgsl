// Sink that clusters the matter along one ray by depth (Mertens et al. 2004): optical depth, mean and standard
// deviation of each cluster.
//
// The first march, towards the light, finds the end of the matter. The next marches assign every piece to the cluster
// with the nearest mean. The first means are spaced evenly over the extent of the matter; later ones are results of
// the march before.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::vectors::vector_map

const CLUSTERS: u32 = #{CLUSTERS};
const FAR: f32 = #{FAR};

struct Sink {
    optical_depth: f32,
}

// Means by which pieces are assigned to clusters, as fractions of the map's range of depths.
var<private> means: array<f32, CLUSTERS>;
// Optical depth of each cluster, and its sums times the distance from the mean and times the square of that.
var<private> sums: array<vec3<f32>, CLUSTERS>;
var<private> finding_end: bool;
var<private> begun: bool;
var<private> met: bool;
var<private> end: f32;

fn share_of(z: f32) -> f32 {
    return (z - light.depth_start_mm) / light.depth_range_mm;
}

// Returns the mean depth of a cluster; for an empty cluster, the mean by which pieces were assigned.
fn mean_of(c: u32) -> f32 {
    return means[c] + sums[c].y / max(sums[c].x, 1e-30);
}

fn start_sink(march: u32) -> Sink {
    finding_end = march == 0u;
    begun = march > 1u;
    met = march > 0u && met;
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
    if finding_end {
        // This march goes towards the light: depths are negative, and the first piece starts at the end.
        end = share_of(-z_from);
        return true;
    }
    let d = min(depth, vector_map.max_depth - (*sink).optical_depth);
    let a = share_of(z_from);
    // The piece ends where the ray ends.
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
    // The mean square over a uniform piece is the square of its middle plus a twelfth of its squared length.
    sums[nearest] += d * vec3<f32>(1.0, off, off * off + (b - a) * (b - a) / 12.0);
    (*sink).optical_depth += d;
    return (*sink).optical_depth >= vector_map.max_depth;
}

fn finish() {}

fn met_extinction() -> bool {
    return met;
}

// Returns number i of the stored sequence: mean, standard deviation and optical depth of each cluster.
fn number(i: u32) -> f32 {
    let c = min(i / 3u, CLUSTERS - 1u);
    let depth = sums[c].x;
    let off = sums[c].y / max(depth, 1e-30);
    let spread = sqrt(max(sums[c].z / max(depth, 1e-30) - off * off, 0.0));
    let value = select(select(depth, spread, i % 3u == 1u), means[c] + off, i % 3u == 0u);
    return select(0.0, value, i < 3u * CLUSTERS && depth > 0.0);
}

fn stored_vector(v: u32) -> vec4<f32> {
    return vec4<f32>(number(4u * v), number(4u * v + 1u), number(4u * v + 2u), number(4u * v + 3u));
}
