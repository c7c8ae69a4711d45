// Sink that computes the Fourier coefficients of extinction along one ray (Jansen & Bavoil 2010).
//
// A piece of optical depth d, spread evenly between the shares s0 and s1 of the map's depth, adds to a_k and b_k
// twice d times the mean of cos(2 pi k s) and sin(2 pi k s): those of its middle times sin(k h) / (k h), h being pi
// (s1 - s0). With TEXEL_RANGE shares refer to the range of the texel, from the first matter to the end of the ray,
// which a first march finds.
#define_import_path umbravox::sink

#import umbravox::series_range::{range_start, range_mm, start_range, extend_range, stored_range}
#import umbravox::vectors::{vector_map, VECTORS}
#ifdef RAY_STATES
#import umbravox::series_range::{save_range, load_range}
#import umbravox::ray_state::{put_words, put_float, take_words, take_float}
#endif

const TERMS: u32 = #{TERMS};
const PI: f32 = 3.14159265358979;
const FAR: f32 = #{FAR};

struct Sink {
    optical_depth: f32,
}

// Fourier coefficients: a_0, then a_k and b_k in pairs. One more term may fill the last vector.
var<private> sums: array<vec4<f32>, VECTORS>;
var<private> total_depth: f32;

fn start_sink(march: u32) -> Sink {
    start_range(march);
    for (var v = 0u; v < VECTORS; v++) { sums[v] = vec4<f32>(0.0); }
    total_depth = 0.0;
    return Sink(0.0);
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return FAR;
}

fn times(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    let d = min(depth, vector_map.max_depth - (*sink).optical_depth);
    // The piece ends where the ray ends.
    let z_end = z_from + (z_to - z_from) * (d / depth);
    if extend_range(z_from, z_end, (*sink).optical_depth == 0.0) {
        (*sink).optical_depth += d;
        total_depth = (*sink).optical_depth;
        return (*sink).optical_depth >= vector_map.max_depth;
    }
    let middle = PI * (z_from + z_end - 2.0 * range_start) / range_mm;
    let half = PI * (z_end - z_from) / range_mm;
    let rotation = vec2<f32>(cos(middle), sin(middle));
    let widening = vec2<f32>(cos(half), sin(half));
    var at = vec2<f32>(1.0, 0.0);
    var wide = vec2<f32>(1.0, 0.0);
    for (var v = 0u; v < VECTORS; v++) {
        // Two terms fill a vector; the first is a_0 with b_0 = 0.
        let even = at;
        let k = f32(2u * v);
        let share = select(wide.y / max(k * half, 1e-30), 1.0 - k * k * half * half / 6.0, k * half < 0.05);
        at = times(at, rotation);
        wide = times(wide, widening);
        let next = (k + 1.0) * half;
        let next_share = select(wide.y / max(next, 1e-30), 1.0 - next * next / 6.0, next < 0.05);
        sums[v] += 2.0 * d * vec4<f32>(even * share, at * next_share);
        at = times(at, rotation);
        wide = times(wide, widening);
    }
    (*sink).optical_depth += d;
    total_depth = (*sink).optical_depth;
    return (*sink).optical_depth >= vector_map.max_depth;
}

fn finish() {}

fn met_extinction() -> bool {
    return total_depth > 0.0;
}

fn stored_vector(v: u32) -> vec4<f32> {
#ifdef TEXEL_RANGE
    // The texel's depth range, as fractions of the map's, takes the place of the term after the last.
    let range = stored_range();
    let last = (TERMS & 1u) == 0u;
    let with_range = select(vec4<f32>(range, 0.0, 0.0), vec4<f32>(sums[v].xy, range), last);
    return select(sums[v], with_range, v == (TERMS + 1u) / 2u);
#else
    return sums[v];
#endif
}

#ifdef RAY_STATES
// Stores the state of a ray that waits.
fn save_sink(sink: ptr<function, Sink>) {
    put_float((*sink).optical_depth);
    save_range();
    for (var v = 0u; v < VECTORS; v++) { put_words(bitcast<vec4<u32>>(sums[v])); }
}

// Restores the state of a ray that has waited.
fn load_sink(sink: ptr<function, Sink>) {
    total_depth = take_float();
    (*sink).optical_depth = total_depth;
    load_range();
    for (var v = 0u; v < VECTORS; v++) { sums[v] = bitcast<vec4<f32>>(take_words()); }
}
#endif
