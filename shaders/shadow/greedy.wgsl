// Greedy compression of one texel's visibility function (Lokovic & Veach 2000; Hadwiger et al. 2006, 3.3).
//
// The slope is never positive, so the stored function never rises. Slopes are those of transmittance, or of its
// logarithm (OPTICAL_DEPTH).
#define_import_path umbravox::compression

#import umbravox::light::light
#import umbravox::watch::report_iteration_limit
#import umbravox::segments::{segment_value, LEAST_VALUE, LEAST_RATIO, LEAST_TRANSMITTANCE}
#import umbravox::curve_nodes::{start_nodes, nodes_stored, store_point, finish_nodes, largest_error}
#ifdef RAY_STATES
#import umbravox::curve_nodes::{save_nodes, load_nodes}
#import umbravox::ray_state::{put_float, take_float}
#endif

const STEEPEST: f32 = 1e30;
// Difference of depths below which a line is vertical, as a share of the map's range.
const VERTICAL_SHARE: f32 = 1.5e-8;
// Largest number of iterations of a push: the first node, then the end of a line and its successor for the gap and
// for the piece.
const MAX_ITERATIONS: i32 = 8;

struct Writer {
    // Start of the current line (the last node), and the slopes for which the line stays within epsilon of the curve.
    origin_z: f32,
    origin_value: f32,
    slope_lo: f32,
    slope_hi: f32,
    // Last point of the exact curve.
    last_z: f32,
    last_t: f32,
    last_value: f32,
}

// The writer of this thread: naga passes no pointers to parts of variables.
var<private> writer: Writer;

fn start_writer(row: u32) {
    start_nodes(row);
    writer = Writer(0.0, segment_value(1.0), -STEEPEST, STEEPEST, 0.0, 1.0, segment_value(1.0));
}

// Stores a curve node and starts a new line there.
fn emit(z: f32, value: f32) {
    // The line starts at the stored value, so that rounding errors do not add up.
    writer.origin_value = store_point(z, value);
    writer.origin_z = z;
    writer.slope_lo = -STEEPEST;
    writer.slope_hi = STEEPEST;
}

fn line_end() -> f32 {
    // Slope of the line: the middle of the allowed range, or its lower end near transmittance 0, so that opaque
    // matter casts full shadows.
    let middle = 0.5 * (writer.slope_lo + writer.slope_hi);
    let slope = min(select(middle, writer.slope_lo, writer.last_t < largest_error()), 0.0);
    let value = writer.origin_value + slope * (writer.last_z - writer.origin_z);
    return clamp(value, LEAST_VALUE, writer.origin_value);
}

// Returns the least and the largest value that a line may have at a point of the exact curve, with its transmittance and
// value there.
fn value_window(level: f32, value: f32) -> vec2<f32> {
#ifdef OPTICAL_DEPTH
    // Inside a piece the error may be larger than at its end, by the ratio of the transmittances at both
    // (docs/bound.md).
    let ratio = level / max(writer.last_t, LEAST_TRANSMITTANCE);
    let tolerance = largest_error() * clamp(ratio, LEAST_RATIO, 1.0);
    // The logarithms of 1 - x and 1 + x are -x (1 + x / 2 + x^2 / 3) at most and 2 x / (2 + x) at least.
    let x = tolerance / max(level, LEAST_TRANSMITTANCE);
    let fall = select(x * (1.0 + x * (0.5 + x / 3.0)), value - LEAST_VALUE, x >= 1.0);
    // A line that ended below the least value would be raised to it as a whole.
    return vec2<f32>(max(value - fall, LEAST_VALUE), value + 2.0 * x / (2.0 + x));
#else
    return vec2<f32>(max(level - largest_error(), 0.0), level + largest_error());
#endif
}

// Adds a piece of the exact curve: constant from its last point to z_from, then falling to t at z_to.
fn push(z_from: f32, z_to: f32, t: f32) {
    // An iteration stores at most one node: the first, the end of a line whose window has closed, or a vertical step.
    var gap = z_from > writer.last_z;
    let value = segment_value(t);
    var iterations_left = MAX_ITERATIONS;
    loop {
        if iterations_left == 0 {
            report_iteration_limit();
            break;
        }
        iterations_left -= 1;
        let z = select(z_to, z_from, gap);
        let level = select(t, writer.last_t, gap);
        let dz = z - writer.origin_z;
        let first = nodes_stored() == 0u;
        let vertical = dz < VERTICAL_SHARE * light.depth_range_mm;
        let point_value = select(value, writer.last_value, gap);
        let window = value_window(level, point_value) - writer.origin_value;
        let lo = max(writer.slope_lo, window.x / max(dz, 1e-12));
        let hi = min(writer.slope_hi, window.y / max(dz, 1e-12));
        let fresh = writer.slope_hi == STEEPEST;
        let closed = lo > hi && !fresh && !vertical;
        let step = vertical && (window.x > 0.0 || window.y < 0.0);
        let store = first || closed || step;
        let done = !(first || closed);
        if done && !vertical {
            writer.slope_lo = lo;
            writer.slope_hi = max(hi, lo);
        }
        if store {
            let end = select(line_end(), segment_value(1.0), first);
            let on_curve = step && !first;
            emit(select(select(writer.last_z, z_from, first), z, on_curve), select(end, point_value, on_curve));
        }
        if first { writer.last_z = z_from; }
        if done {
            writer.last_z = z;
            writer.last_t = level;
            writer.last_value = point_value;
        }
        if done && !gap { break; }
        gap = gap && !done && !first;
    }
}

// Ends the last line, and fills the texel's row.
fn finish() {
    if nodes_stored() > 0u && writer.last_z > writer.origin_z { emit(writer.last_z, line_end()); }
    finish_nodes(writer.origin_value);
}

#ifdef RAY_STATES
// Stores the state of the compression of a ray that waits.
fn save_writer() {
    put_float(writer.origin_z);
    put_float(writer.origin_value);
    put_float(writer.slope_lo);
    put_float(writer.slope_hi);
    put_float(writer.last_z);
    put_float(writer.last_t);
    put_float(writer.last_value);
    save_nodes();
}

fn load_writer() {
    writer.origin_z = take_float();
    writer.origin_value = take_float();
    writer.slope_lo = take_float();
    writer.slope_hi = take_float();
    writer.last_z = take_float();
    writer.last_t = take_float();
    writer.last_value = take_float();
    load_nodes();
}
#endif
