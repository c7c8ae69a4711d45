// Sink that finds the front depth, the mean extinction and the optical depth of one ray, for a Beer shadow map.
#define_import_path umbravox::sink

#import umbravox::light::light
#import umbravox::vectors::vector_map
#ifdef RAY_STATES
#import umbravox::ray_state::{put_float, take_float}
#endif

const FAR: f32 = #{FAR};
// Largest stored extinction: the largest float of 16 bits.
const LARGEST_EXTINCTION: f32 = 65504.0;

struct Sink {
    optical_depth: f32,
}

var<private> total_depth: f32;
// Depth where the matter begins, and the length to which the mean extinction refers, mm.
var<private> front_mm: f32;
var<private> length_mm: f32;

fn start_sink(march: u32) -> Sink {
    total_depth = 0.0;
    length_mm = 0.0;
    return Sink(0.0);
}

fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32 {
    return FAR;
}

fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool {
    if !(depth > 0.0) { return false; }
    let d = min(depth, vector_map.max_depth - total_depth);
    // The piece ends where the ray ends.
    let z_end = z_from + (z_to - z_from) * (d / depth);
    front_mm = select(front_mm, z_from, total_depth == 0.0);
#ifdef MEAN_OF_MATTER
    length_mm += z_end - z_from;
#else
    length_mm = z_end - front_mm;
#endif
    total_depth += d;
    return total_depth >= vector_map.max_depth;
}

fn finish() {}

fn met_extinction() -> bool {
    return total_depth > 0.0;
}

// Front depth as a fraction of the map's range of depths, extinction per range, optical depth.
fn stored_vector(v: u32) -> vec4<f32> {
    let front = (front_mm - light.depth_start_mm) / light.depth_range_mm;
    let extinction = total_depth * light.depth_range_mm / max(length_mm, 1e-30);
    return vec4<f32>(front, min(extinction, LARGEST_EXTINCTION), total_depth, 0.0);
}

#ifdef RAY_STATES
// Stores the state of a ray that waits.
fn save_sink(sink: ptr<function, Sink>) {
    put_float(total_depth);
    put_float(front_mm);
    put_float(length_mm);
}

// Restores the state of a ray that has waited.
fn load_sink(sink: ptr<function, Sink>) {
    total_depth = take_float();
    front_mm = take_float();
    length_mm = take_float();
}
#endif
