// Compression of the visibility function of one texel to the fewest nodes (`compress=optimal`; Imai & Iri 1986,
// 1988).
//
// The tunnel is the curve plus and minus epsilon. A line continues until no line stays in the tunnel; nodes lie where
// two consecutive lines meet. The lines that stay in the tunnel so far lie between two extremes: the lowest, which
// touches the ceiling of the tunnel and then its floor, and the highest, which touches the floor and then the
// ceiling. Two convex chains of corners determine both: the upper hull of the floor and the lower hull of the
// ceiling. A line ends where the tunnel leaves it. The window of the next line reaches from the last contact of the
// line to the point where it leaves the tunnel. The next line crosses the window, and the node is the crossing.
//
// The chain of the ceiling is stored upside down, so that both are upper hulls and share their code. Depths are steps
// of the map's range. docs/bound.md proves the minimum, and states the effect of full hulls.
#define_import_path umbravox::compression

#import umbravox::light::light
#import umbravox::watch::report_iteration_limit
#import umbravox::dsm_layout::params
#import umbravox::curve_nodes::{start_nodes, store_node, finish_nodes, count_narrowed}

const VERTICAL: f32 = 1e30;
// Largest number of corners of a hull; a power of two.
const CORNERS: u32 = #{HULL_CORNERS};
// Number of hull corners that still leaves room for two pushes. A push adds up to three corners on each side, and
// makes room on one.
const MAX_CORNERS: u32 = #{HULL_CORNERS} - 6u;
// Width of a vertical fall in depth steps: depths that differ by less are equal.
const FALL_WIDTH: f32 = #{UPRIGHT_STEPS};
// Largest number of iterations of a push without a pending fall: the gap, the piece.
const PUSH_ITERATIONS: i32 = 2;

const FLOOR: u32 = 0u;
const CEILING: u32 = 1u;

struct Tunnel {
    // For each side: indices of the first corner of its chain, of the corner that its line touches, and of the end.
    // They only grow.
    begin: vec2<u32>,
    touch: vec2<u32>,
    end: vec2<u32>,
    // Copies of these corners, since reads of the ring buffers are slow.
    first_x: vec2<f32>,
    first_y: vec2<f32>,
    touch_x: vec2<f32>,
    touch_y: vec2<f32>,
    newest_x: vec2<f32>,
    newest_y: vec2<f32>,
    // Slopes of the extreme lines, for the side that each touches last: the lowest line for the floor, the highest
    // for the ceiling.
    slope: vec2<f32>,
    // Previous line: a point on it, its slope, and the depths of its window.
    line_at: vec2<f32>,
    line_slope: f32,
    window: vec2<f32>,
    // Highest point of the floor under the present line.
    top: f32,
    // Depth of the last corner, and transmittance at the last point of the curve; `pending` if that point is not yet
    // a corner.
    last_x: f32,
    last_t: f32,
    pending: bool,
    started: bool,
    narrowed: bool,
    // Transmittance of the last stored node.
    node_t: f32,
}

// The two chains of corners (floor, ceiling), each a ring buffer.
var<private> corners: array<vec2<f32>, 2 * #{HULL_CORNERS}>;
var<private> tunnel: Tunnel;

fn start_writer(row: u32) {
    start_nodes(row);
    tunnel.started = false;
    tunnel.pending = false;
    tunnel.narrowed = false;
    tunnel.last_t = 1.0;
    tunnel.node_t = 1.0;
}

fn corner(side: u32, i: u32) -> vec2<f32> {
    return corners[side * CORNERS + (i & (CORNERS - 1u))];
}

fn set_corner(side: u32, i: u32, point: vec2<f32>) {
    corners[side * CORNERS + (i & (CORNERS - 1u))] = point;
}

// Returns the extreme line of a side at a depth, upside down for the ceiling.
fn side_line(side: u32, x: f32) -> f32 {
    return tunnel.touch_y[side] + tunnel.slope[side] * (x - tunnel.touch_x[side]);
}

// Stores a curve node, whose transmittance is never above that of the last one.
fn add_node(x: f32, t: f32) {
    tunnel.node_t = store_node(x, min(t, tunnel.node_t));
}

// Ends the previous line where the next one crosses its window. The flatter of the two lines gives the transmittance,
// so that rounding changes only the depth.
fn end_line(at: vec2<f32>, slope: f32, window: vec2<f32>) {
    let difference = tunnel.line_slope - slope;
    let rise = at.y + slope * (tunnel.line_at.x - at.x) - tunnel.line_at.y;
    let meets = tunnel.line_at.x + rise / select(difference, -VERTICAL, difference == 0.0);
    let x = clamp(meets, tunnel.window.x, tunnel.window.y);
    let before = tunnel.line_at.y + tunnel.line_slope * (x - tunnel.line_at.x);
    add_node(x, select(at.y + slope * (x - at.x), before, abs(tunnel.line_slope) < abs(slope)));
    tunnel.line_at = at;
    tunnel.line_slope = slope;
    tunnel.window = window;
}

// Makes room in the longer chain if a few more corners would fill it: pairs of neighbours are replaced by the point
// outside the hull where the edges beside them meet. The first corner, the touched one and the last stay, and so do
// the two lines.
fn make_room() {
    let lengths = tunnel.end - tunnel.begin;
    let side = select(FLOOR, CEILING, lengths.y > lengths.x);
    if max(lengths.x, lengths.y) <= MAX_CORNERS { return; }
    tunnel.narrowed = true;
    let last = tunnel.end[side] - 1u;
    let touch = tunnel.touch[side];
    var from_corner = tunnel.begin[side] + 1u;
    var to_corner = from_corner;
    // Limits of loops depend on the data here and below: compilers unroll loops with constant limits, to ten thousand
    // instructions.
    let corners_left = last - tunnel.begin[side];
    for (var i = 0u; i < corners_left; i++) {
        let a = corner(side, to_corner - 1u);
        let b = corner(side, from_corner);
        let c = corner(side, from_corner + 1u);
        let d = corner(side, from_corner + 2u);
        let pair = from_corner + 1u < last && from_corner != touch && from_corner + 1u != touch;
        let before = (b.y - a.y) / max(b.x - a.x, 1e-6);
        let behind = (d.y - c.y) / max(d.x - c.x, 1e-6);
        let width = c.x - b.x;
        let u = clamp((c.y - b.y - behind * width) / max(before - behind, 1e-30), 0.0, width);
        let outside = vec2<f32>(b.x + u, max(b.y + before * u, c.y + behind * (u - width)));
        if from_corner <= last {
            if from_corner == touch { tunnel.touch[side] = to_corner; }
            set_corner(side, to_corner, select(b, outside, pair));
            to_corner += 1u;
            from_corner += select(1u, 2u, pair);
        }
        if from_corner > last { break; }
    }
    tunnel.end[side] = to_corner;
}

// Adds a corner to a side: its line is rotated if the corner lies above, and the hull is updated.
fn add_corner(side: u32, point: vec2<f32>) {
    let other = 1u - side;
    let rotated = point.y > side_line(side, point.x);
    if rotated {
        // Tangent to the chain of the other side; corners before its contact cannot be touched any more.
        var first = vec2<f32>(tunnel.first_x[other], tunnel.first_y[other]);
        var begin = tunnel.begin[other];
        let corners_left = tunnel.touch[other] - begin;
        for (var i = 0u; i < corners_left; i++) {
            let next = corner(other, begin + 1u);
            let nearer = (point.y + next.y) * (point.x - first.x) > (point.y + first.y) * (point.x - next.x);
            if !nearer { break; }
            first = next;
            begin += 1u;
        }
        tunnel.begin[other] = begin;
        tunnel.first_x[other] = first.x;
        tunnel.first_y[other] = first.y;
        tunnel.slope[side] = (point.y + first.y) / max(point.x - first.x, 1e-6);
    }
    let least = select(tunnel.touch[side] + 1u, tunnel.begin[side] + 1u, rotated);
    var end = tunnel.end[side];
    var newest = vec2<f32>(tunnel.newest_x[side], tunnel.newest_y[side]);
    let corners_left = end - least;
    for (var i = 0u; i < corners_left; i++) {
        let before = corner(side, end - 2u);
        let hidden = (newest.y - before.y) * (point.x - before.x) <= (point.y - before.y) * (newest.x - before.x);
        if !hidden { break; }
        newest = before;
        end -= 1u;
    }
    set_corner(side, end, point);
    tunnel.newest_x[side] = point.x;
    tunnel.newest_y[side] = point.y;
    tunnel.touch[side] = select(tunnel.touch[side], end, rotated);
    tunnel.touch_x[side] = select(tunnel.touch_x[side], point.x, rotated);
    tunnel.touch_y[side] = select(tunnel.touch_y[side], point.y, rotated);
    tunnel.end[side] = end + 1u;
}

// Begins the line after one that left the tunnel on side `out` at `exit` (upside down for the ceiling). One extreme
// line is the previous line, the other is vertical at the last corner.
fn begin_line(out: u32, exit: vec2<f32>, slope: f32) {
    let last = 1u - out;
    tunnel.begin[out] = tunnel.end[out];
    tunnel.touch[out] = tunnel.end[out];
    set_corner(out, tunnel.end[out], exit);
    tunnel.end[out] += 1u;
    tunnel.first_x[out] = exit.x;
    tunnel.first_y[out] = exit.y;
    tunnel.touch_x[out] = exit.x;
    tunnel.touch_y[out] = exit.y;
    tunnel.newest_x[out] = exit.x;
    tunnel.newest_y[out] = exit.y;
    tunnel.slope[out] = slope;
    tunnel.begin[last] = tunnel.touch[last];
    tunnel.first_x[last] = tunnel.touch_x[last];
    tunnel.first_y[last] = tunnel.touch_y[last];
    tunnel.touch[last] = tunnel.end[last] - 1u;
    tunnel.touch_x[last] = tunnel.newest_x[last];
    tunnel.touch_y[last] = tunnel.newest_y[last];
    tunnel.slope[last] = -VERTICAL;
    tunnel.top = tunnel.first_y[FLOOR];
}

// Continues the exact curve on a straight line to transmittance t at depth x: one more corner of the floor and of the
// ceiling.
fn extend_curve(x: f32, t: f32) {
    let low = max(t - params.epsilon, 0.0);
    let high = t + params.epsilon;
    let under = high < side_line(FLOOR, x);
    let over = low > -side_line(CEILING, x);
    if under || over {
        // The side on which the line leaves the tunnel, and the one that it touches last.
        let out = select(FLOOR, CEILING, under);
        let last = 1u - out;
        let sign = select(1.0, -1.0, under);
        let at = vec2<f32>(tunnel.touch_x[last], tunnel.touch_y[last]);
        let before = vec2<f32>(tunnel.newest_x[out], tunnel.newest_y[out]);
        let inside = max(-side_line(last, before.x) - before.y, 0.0);
        let outside = select(low, -high, under) + side_line(last, x);
        let exit_x = before.x + (x - before.x) * (inside / max(inside + outside, 1e-30));
        let exit = vec2<f32>(exit_x, -side_line(last, exit_x));
        let slope = tunnel.slope[last];
        end_line(vec2<f32>(at.x, -sign * at.y), -sign * slope, vec2<f32>(at.x, exit_x));
        begin_line(out, exit, -slope);
    }
    add_corner(FLOOR, vec2<f32>(x, low));
    add_corner(CEILING, vec2<f32>(x, -high));
    tunnel.last_x = x;
}

// Begins the tunnel at the first extinction, with a vertical fall from transmittance 1.
fn start_at(x: f32) {
    let low = max(1.0 - params.epsilon, 0.0);
    set_corner(FLOOR, 0u, vec2<f32>(x, low));
    set_corner(CEILING, 0u, vec2<f32>(x, -1.0));
    tunnel.begin = vec2<u32>(0u);
    tunnel.touch = vec2<u32>(0u);
    tunnel.end = vec2<u32>(1u);
    tunnel.first_x = vec2<f32>(x);
    tunnel.first_y = vec2<f32>(low, -1.0);
    tunnel.touch_x = tunnel.first_x;
    tunnel.touch_y = tunnel.first_y;
    tunnel.newest_x = tunnel.first_x;
    tunnel.newest_y = tunnel.first_y;
    tunnel.slope = vec2<f32>(-VERTICAL);
    tunnel.line_at = vec2<f32>(x, 1.0);
    tunnel.line_slope = -VERTICAL;
    tunnel.window = vec2<f32>(x);
    tunnel.top = low;
    tunnel.last_x = x;
    tunnel.started = true;
}

// Adds a piece of the exact curve: constant from its last point to z_from, then falling to t at z_to.
fn push(z_from: f32, z_to: f32, t: f32) {
    let start = (z_from - light.depth_start_mm) * params.depth_steps_per_mm;
    let end = (z_to - light.depth_start_mm) * params.depth_steps_per_mm;
    if !tunnel.started { start_at(start); }
    make_room();
    var iterations_left = PUSH_ITERATIONS + select(0, 1, tunnel.pending);
    loop {
        if iterations_left == 0 {
            report_iteration_limit();
            break;
        }
        iterations_left -= 1;
        let next = tunnel.last_x + FALL_WIDTH;
        let falls = tunnel.pending && end >= next;
        let gap = !tunnel.pending && start >= next;
        let piece = !falls && !gap;
        let far = end >= next;
        let x = select(select(end, start, gap), next, falls);
        if !piece || far { extend_curve(x, select(t, tunnel.last_t, !piece)); }
        tunnel.pending = piece && !far;
        if piece {
            tunnel.last_t = t;
            break;
        }
    }
    // `make_room` keeps rings from overflowing, which would overwrite the first corner.
    if any(tunnel.end - tunnel.begin > vec2<u32>(CORNERS)) { report_iteration_limit(); }
}

// Ends the last line, and fills the texel's row.
fn finish() {
    if tunnel.started {
        if tunnel.pending { extend_curve(tunnel.last_x + FALL_WIDTH, tunnel.last_t); }
        let x = tunnel.last_x;
        let dark = tunnel.last_t < params.epsilon;
        // The stored function is constant behind its last node: a horizontal line that stays in the tunnel needs no
        // end node.
        let ceiling = min(tunnel.last_t + params.epsilon, 1.0);
        let level = tunnel.top <= ceiling;
        let middle = clamp(0.5 * (tunnel.top + params.epsilon + tunnel.last_t), tunnel.top, max(ceiling, tunnel.top));
        let flat = select(middle, tunnel.top, dark);
        // Otherwise the end is in the middle between the extreme lines, or on the lowest one near transmittance 0.
        let share = select(0.5, 0.0, dark);
        let t = select(mix(side_line(FLOOR, x), -side_line(CEILING, x), share), flat, level);
        let slope = select(min(mix(tunnel.slope[FLOOR], -tunnel.slope[CEILING], share), 0.0), 0.0, level);
        end_line(vec2<f32>(x, t), slope, vec2<f32>(x));
        if !level { add_node(x, t); }
        if tunnel.narrowed { count_narrowed(); }
    }
    finish_nodes(tunnel.node_t);
}
