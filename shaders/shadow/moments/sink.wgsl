// Sink that computes the moments of the matter along one ray (Muenstermann et al. 2018): the optical depth, and
// the means over it of powers of the depth, or of points on the unit circle. With LIGHT, absorbed light takes the place
// of optical depth.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::vectors::vector_map
#import umbravox::moments::params
#ifdef RAY_STATES
#import umbravox::ray_state::{put_float, take_float}
#endif

const MOMENTS: u32 = #{MOMENTS};
const FAR: f32 = #{FAR};

struct Sink {
    optical_depth: f32,
#ifdef LIGHT
    transmittance: f32,
#endif
}

// Optical depth or absorbed light, then each moment times it.
var<private> sums: array<f32, #{MOMENTS} + 1>;

fn start_sink(march: u32) -> Sink {
    for (var k = 0u; k <= MOMENTS; k++) { sums[k] = 0.0; }
#ifdef LIGHT
    return Sink(0.0, 1.0);
#else
    return Sink(0.0);
#endif
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
#ifdef LIGHT
    // Absorbed light is spread evenly over a piece, which has to be short for that.
    return params.longest_depth * inverseSqrt((*sink).transmittance);
#else
    return FAR;
#endif
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    let d = min(depth, vector_map.max_depth - (*sink).optical_depth);
    let from_share = (z_from - light.depth_start_mm) / light.depth_range_mm;
    // The piece ends where the ray ends.
    let z_end = z_from + (z_to - z_from) * (d / depth);
    let to_share = (z_end - light.depth_start_mm) / light.depth_range_mm;
#ifdef LIGHT
    let behind = exp(-((*sink).optical_depth + d));
    let mass = (*sink).transmittance - behind;
    (*sink).transmittance = behind;
#else
    let mass = d;
#endif
    sums[0] += mass;
#ifdef TRIGONOMETRIC
    // The mean of e^(i k phi) over the piece is that at its middle times sin(k h) / (k h).
    let middle = 0.5 * params.largest_angle * (from_share + to_share);
    let half = 0.5 * params.largest_angle * (to_share - from_share);
    for (var k = 1u; 2u * k <= MOMENTS; k++) {
        let x = f32(k) * half;
        let narrowing = select(sin(x) / max(x, 1e-30), 1.0 - x * x / 6.0, x < 0.05);
        sums[2u * k - 1u] += mass * narrowing * cos(f32(k) * middle);
        sums[2u * k] += mass * narrowing * sin(f32(k) * middle);
    }
#else
    // The mean of x^k from a to b is (a^k + a^(k-1) b + ... + b^k) / (k + 1).
    let a = 2.0 * from_share - 1.0;
    let b = 2.0 * to_share - 1.0;
    var power = 1.0;
    var sum = 1.0;
    for (var k = 1u; k <= MOMENTS; k++) {
        power *= a;
        sum = sum * b + power;
        sums[k] += mass * sum / f32(k + 1u);
    }
#endif
    (*sink).optical_depth += d;
    return (*sink).optical_depth >= vector_map.max_depth;
}

fn met_extinction() -> bool {
    return sums[0] > 0.0;
}

#ifdef WORDS
// Optical depth or absorbed light, and two moments in each other word, as `umbravox::moment_vectors` reads them.
var<private> words: array<u32, #{MOMENTS} / 2 + 1>;

fn finish() {
    let scale = 1.0 / max(sums[0], 1e-30);
#ifndef TRIGONOMETRIC
    // Means of the Chebyshev polynomials T_k from those of powers: T_k = 2 x T_(k-1) - T_(k-2), coefficient by
    // coefficient.
    var before = array<f32, #{MOMENTS} + 1>();
    var here = array<f32, #{MOMENTS} + 1>();
    before[0] = 1.0;
    here[1] = 1.0;
#endif
    var odd = 0.0;
    words[0] = bitcast<u32>(sums[0]);
    for (var k = 1u; k <= MOMENTS; k++) {
#ifdef TRIGONOMETRIC
        let moment = sums[k] * scale;
#else
        var moment = 0.0;
        var next = array<f32, #{MOMENTS} + 1>();
        next[0] = -before[0];
        for (var i = 0u; i <= MOMENTS; i++) { moment += here[i] * sums[i] * scale; }
        for (var i = 1u; i <= MOMENTS; i++) { next[i] = 2.0 * here[i - 1u] - before[i]; }
        before = here;
        here = next;
#endif
        words[k / 2u] = select(pack2x16snorm(vec2<f32>(odd, moment)), words[k / 2u], (k & 1u) == 1u);
        odd = moment;
    }
}

fn word(i: u32) -> u32 {
    return select(0u, words[min(i, MOMENTS / 2u)], i <= MOMENTS / 2u);
}

fn stored_vector(v: u32) -> vec4<u32> {
    return vec4<u32>(word(4u * v), word(4u * v + 1u), word(4u * v + 2u), word(4u * v + 3u));
}
#else
fn finish() {}

fn number(i: u32) -> f32 {
    return select(0.0, sums[min(i, MOMENTS)], i <= MOMENTS);
}

fn stored_vector(v: u32) -> vec4<f32> {
    return vec4<f32>(number(4u * v), number(4u * v + 1u), number(4u * v + 2u), number(4u * v + 3u));
}
#endif

#ifdef RAY_STATES
// Stores the state of a ray that waits.
fn save_sink(sink: ptr<function, Sink>) {
    put_float((*sink).optical_depth);
#ifdef LIGHT
    put_float((*sink).transmittance);
#endif
    for (var k = 0u; k <= MOMENTS; k++) { put_float(sums[k]); }
}

// Restores the state of a ray that has waited.
fn load_sink(sink: ptr<function, Sink>) {
    (*sink).optical_depth = take_float();
#ifdef LIGHT
    (*sink).transmittance = take_float();
#endif
    for (var k = 0u; k <= MOMENTS; k++) { sums[k] = take_float(); }
}
#endif
