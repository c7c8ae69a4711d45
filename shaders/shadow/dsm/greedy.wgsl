// Greedy compression of one texel's visibility function (Lokovic & Veach 2000, 3.2; Hadwiger et al. 2006, 3.3).
//
// The slope taken is never positive, so the stored function never rises.
#define_import_path umbravox::dsm_nodes

#import umbravox::light::light
#import umbravox::watch::ran_out
#import umbravox::dsm_layout::own
#import umbravox::dsm_rows::{start_rows, nodes_stored, store_node, finish_rows}

const STEEPEST: f32 = 1e30;
// Turns of a push: the first node, then for the gap and for the piece the end of a line and what follows it.
const MOST_TURNS: i32 = 8;

struct Writer {
    // Start of the current line (the last node) and the slopes that keep it within epsilon.
    origin_z: f32,
    origin_t: f32,
    slope_lo: f32,
    slope_hi: f32,
    // The last point of the curve.
    last_z: f32,
    last_t: f32,
}

// This thread's writer: naga passes no pointers to parts of variables, so it has a place of its own.
var<private> writer: Writer;

fn start_writer(row: u32) {
    start_rows(row);
    writer = Writer(0.0, 1.0, -STEEPEST, STEEPEST, 0.0, 1.0);
}

// Stores a node and starts a new line there.
fn emit(z: f32, t: f32) {
    // The line goes on from what was stored, so that rounding does not add up.
    writer.origin_t = store_node((z - light.depth_start_mm) * own.depth_steps_per_mm, t);
    writer.origin_z = z;
    writer.slope_lo = -STEEPEST;
    writer.slope_hi = STEEPEST;
}

fn line_end() -> f32 {
    // The middle of the window; its lower end where that is darkness, so that opaque things cast full shadows.
    let middle = 0.5 * (writer.slope_lo + writer.slope_hi);
    let slope = min(select(middle, writer.slope_lo, writer.last_t < own.epsilon), 0.0);
    return clamp(writer.origin_t + slope * (writer.last_z - writer.origin_z), 0.0, writer.origin_t);
}

// The curve falls to t between the depths z_from and z_to; it is level from its last point to z_from.
fn push(z_from: f32, z_to: f32, t: f32) {
    // A turn stores at most one node: the first of all, the end of a line whose window has closed, or a vertical step.
    var gap = z_from > writer.last_z;
    var turns_left = MOST_TURNS;
    loop {
        if turns_left == 0 {
            ran_out();
            break;
        }
        turns_left -= 1;
        let z = select(z_to, z_from, gap);
        let level = select(t, writer.last_t, gap);
        let dz = z - writer.origin_z;
        let first = nodes_stored() == 0u;
        let upright = dz * own.depth_steps_per_mm < 1e-3;
        let lo = max(writer.slope_lo, (max(level - own.epsilon, 0.0) - writer.origin_t) / max(dz, 1e-12));
        let hi = min(writer.slope_hi, (level + own.epsilon - writer.origin_t) / max(dz, 1e-12));
        let fresh = writer.slope_hi == STEEPEST;
        let closed = lo > hi && !fresh && !upright;
        let step = upright && abs(level - writer.origin_t) > own.epsilon;
        let store = first || closed || step;
        let done = !(first || closed);
        if done && !upright {
            writer.slope_lo = lo;
            writer.slope_hi = max(hi, lo);
        }
        if store {
            emit(select(select(writer.last_z, z_from, first), z, step && !first), select(select(line_end(), 1.0, first), level, step && !first));
        }
        if first { writer.last_z = z_from; }
        if done {
            writer.last_z = z;
            writer.last_t = level;
        }
        if done && !gap { break; }
        gap = gap && !done && !first;
    }
}

// Ends the last line and fills the row.
fn finish() {
    if nodes_stored() > 0u && writer.last_z > writer.origin_z { emit(writer.last_z, line_end()); }
    finish_rows(writer.origin_t);
}
