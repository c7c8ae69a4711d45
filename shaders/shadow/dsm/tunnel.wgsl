// Compression of one texel's visibility function to the fewest nodes (Imai & Iri 1986, 1988): a line goes on until none
// would stay in the tunnel, the curve plus and minus epsilon, and nodes lie where two such lines meet.
//
// Lines that stay in the tunnel from the window that the last line has left, to here, lie between two: the lowest at its end, which
// touches the tunnel's ceiling and then its floor, and the highest, the other way round. Both follow from two convex
// chains of corners: the upper hull of the floor and the lower hull of the ceiling. Where the tunnel falls out under the
// lowest line (or climbs over the highest) that line ends. What it leaves visible lies beyond its last stretch, from where it
// last touches to where it leaves: the window that the next line has to cross. The node between them is where it does, known
// once the next line is.
//
// Chains are kept upside down for the ceiling, so that both are upper hulls: one program serves both. Depths are steps of the
// map's range. docs/bound.md proves what is the least, and what hulls without room for more corners make of it.
#define_import_path umbravox::dsm_nodes

#import umbravox::light::light
#import umbravox::watch::ran_out
#import umbravox::dsm_layout::own
#import umbravox::dsm_rows::{start_rows, store_node, finish_rows, count_narrowed}

const VERTICAL: f32 = 1e30;
// Corners of a hull; a power of two.
const CORNERS: u32 = #{HULL_CORNERS};
// Corners that leave room for those of two pushes: a push adds up to three a side, and makes room on one.
const MOST_CORNERS: u32 = #{HULL_CORNERS} - 6u;
// Depths, in steps, that differ by less are one: what lies between them is taken as a fall over this width.
const UPRIGHT: f32 = #{UPRIGHT_STEPS};
// Turns of a push: the fall that was held back, the gap, the piece.
const PUSH_TURNS: i32 = 3;

const FLOOR: u32 = 0u;
const CEILING: u32 = 1u;

struct Tunnel {
    // By side: places of a chain's first corner, of the corner that its line touches, and behind the last. They only grow.
    begin: vec2<u32>,
    touch: vec2<u32>,
    end: vec2<u32>,
    // These corners themselves, since what lies in rings is slow to read.
    first_x: vec2<f32>,
    first_y: vec2<f32>,
    touch_x: vec2<f32>,
    touch_y: vec2<f32>,
    newest_x: vec2<f32>,
    newest_y: vec2<f32>,
    // Slopes of the lines that touch each side last: the lowest line for the floor, the highest for the ceiling.
    slope: vec2<f32>,
    // The line before: a point of it, its slope, and the depths of its window.
    line_at: vec2<f32>,
    line_slope: f32,
    window: vec2<f32>,
    // Highest point of the floor that the present line has to pass over.
    top: f32,
    // The last corner's depth, and the last point of the curve: `held` where that is not yet a corner.
    last_x: f32,
    last_t: f32,
    held: bool,
    started: bool,
    narrowed: bool,
    // The last node's transmittance.
    node_t: f32,
}

// Two chains, each a ring.
var<private> corners: array<vec2<f32>, 2 * #{HULL_CORNERS}>;
var<private> tunnel: Tunnel;

fn start_writer(row: u32) {
    start_rows(row);
    tunnel.started = false;
    tunnel.held = false;
    tunnel.narrowed = false;
    tunnel.last_t = 1.0;
    tunnel.node_t = 1.0;
}

fn corner(side: u32, place: u32) -> vec2<f32> {
    return corners[side * CORNERS + (place & (CORNERS - 1u))];
}

fn set_corner(side: u32, place: u32, point: vec2<f32>) {
    corners[side * CORNERS + (place & (CORNERS - 1u))] = point;
}

// A side's line at a depth, upside down for the ceiling's.
fn side_line(side: u32, x: f32) -> f32 {
    return tunnel.touch_y[side] + tunnel.slope[side] * (x - tunnel.touch_x[side]);
}

// Nodes never rise, and none lies beyond the tunnel's first point.
fn node(x: f32, t: f32) {
    tunnel.node_t = store_node(x, min(t, tunnel.node_t));
}

// The line before ends where this one crosses its window. The flatter of the two says how high: depth is then all that
// rounding moves.
fn turn_into(at: vec2<f32>, slope: f32, window: vec2<f32>) {
    let difference = tunnel.line_slope - slope;
    let rise = at.y + slope * (tunnel.line_at.x - at.x) - tunnel.line_at.y;
    let meets = tunnel.line_at.x + rise / select(difference, -VERTICAL, difference == 0.0);
    let x = clamp(meets, tunnel.window.x, tunnel.window.y);
    let before = tunnel.line_at.y + tunnel.line_slope * (x - tunnel.line_at.x);
    node(x, select(at.y + slope * (x - at.x), before, abs(tunnel.line_slope) < abs(slope)));
    tunnel.line_at = at;
    tunnel.line_slope = slope;
    tunnel.window = window;
}

// Makes room in the longer chain where a few more corners would fill it: pairs of neighbours become the point where the
// edges beside them meet, outside of the hull. The first corner, the one that is touched and the last stay, and so do the
// two lines.
fn make_room() {
    let lengths = tunnel.end - tunnel.begin;
    let side = select(FLOOR, CEILING, lengths.y > lengths.x);
    if max(lengths.x, lengths.y) <= MOST_CORNERS { return; }
    tunnel.narrowed = true;
    let last = tunnel.end[side] - 1u;
    let touch = tunnel.touch[side];
    var from_place = tunnel.begin[side] + 1u;
    var to_place = from_place;
    for (var turn = 0u; turn < CORNERS; turn++) {
        let a = corner(side, to_place - 1u);
        let b = corner(side, from_place);
        let c = corner(side, from_place + 1u);
        let d = corner(side, from_place + 2u);
        let pair = from_place + 1u < last && from_place != touch && from_place + 1u != touch;
        let before = (b.y - a.y) / max(b.x - a.x, 1e-6);
        let behind = (d.y - c.y) / max(d.x - c.x, 1e-6);
        let width = c.x - b.x;
        let u = clamp((c.y - b.y - behind * width) / max(before - behind, 1e-30), 0.0, width);
        let outside = vec2<f32>(b.x + u, max(b.y + before * u, c.y + behind * (u - width)));
        if from_place <= last {
            if from_place == touch { tunnel.touch[side] = to_place; }
            set_corner(side, to_place, select(b, outside, pair));
            to_place += 1u;
            from_place += select(1u, 2u, pair);
        }
        if from_place > last { break; }
    }
    tunnel.end[side] = to_place;
}

// One more corner of a side: its line is turned over it where it lies above, and the hull takes it in.
fn press(side: u32, point: vec2<f32>) {
    let other = 1u - side;
    let turned = point.y > side_line(side, point.x);
    if turned {
        // The tangent to the other side: what it has left behind is touched no more.
        var first = vec2<f32>(tunnel.first_x[other], tunnel.first_y[other]);
        var begin = tunnel.begin[other];
        for (var turn = 0u; turn < CORNERS; turn++) {
            let next = corner(other, begin + 1u);
            let nearer = (point.y + next.y) * (point.x - first.x) > (point.y + first.y) * (point.x - next.x);
            if !(nearer && begin < tunnel.touch[other]) { break; }
            first = next;
            begin += 1u;
        }
        tunnel.begin[other] = begin;
        tunnel.first_x[other] = first.x;
        tunnel.first_y[other] = first.y;
        tunnel.slope[side] = (point.y + first.y) / max(point.x - first.x, 1e-6);
    }
    let least = select(tunnel.touch[side] + 1u, tunnel.begin[side] + 1u, turned);
    var end = tunnel.end[side];
    var newest = vec2<f32>(tunnel.newest_x[side], tunnel.newest_y[side]);
    for (var turn = 0u; turn < CORNERS; turn++) {
        let before = corner(side, end - 2u);
        let hidden = (newest.y - before.y) * (point.x - before.x) <= (point.y - before.y) * (newest.x - before.x);
        if end <= least || !hidden { break; }
        newest = before;
        end -= 1u;
    }
    set_corner(side, end, point);
    tunnel.newest_x[side] = point.x;
    tunnel.newest_y[side] = point.y;
    tunnel.touch[side] = select(tunnel.touch[side], end, turned);
    tunnel.touch_x[side] = select(tunnel.touch_x[side], point.x, turned);
    tunnel.touch_y[side] = select(tunnel.touch_y[side], point.y, turned);
    tunnel.end[side] = end + 1u;
}

// The window of a line that has left the tunnel by a side, at a point upside down for the ceiling: from there on the line
// that touches it is the one that was, and the other's goes straight down from its last corner (or up).
fn begin_at(out: u32, exit: vec2<f32>, slope: f32) {
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

// The curve goes straight to t at a depth: one more corner of the floor and of the ceiling.
fn go_to(x: f32, t: f32) {
    let low = max(t - own.epsilon, 0.0);
    let high = t + own.epsilon;
    let under = high < side_line(FLOOR, x);
    let over = low > -side_line(CEILING, x);
    if under || over {
        // The side that the line leaves by, and the one that it touches last.
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
        turn_into(vec2<f32>(at.x, -sign * at.y), -sign * slope, vec2<f32>(at.x, exit_x));
        begin_at(out, exit, -slope);
    }
    press(FLOOR, vec2<f32>(x, low));
    press(CEILING, vec2<f32>(x, -high));
    tunnel.last_x = x;
}

// The tunnel begins where there is extinction: from anywhere below all light, straight down.
fn start_at(x: f32) {
    let low = max(1.0 - own.epsilon, 0.0);
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

// The curve falls to t between the depths z_from and z_to; it is level from its last point to z_from.
fn push(z_from: f32, z_to: f32, t: f32) {
    let start = (z_from - light.depth_start_mm) * own.depth_steps_per_mm;
    let end = (z_to - light.depth_start_mm) * own.depth_steps_per_mm;
    if !tunnel.started { start_at(start); }
    make_room();
    var turns_left = PUSH_TURNS;
    loop {
        if turns_left == 0 {
            ran_out();
            break;
        }
        turns_left -= 1;
        let next = tunnel.last_x + UPRIGHT;
        let falls = tunnel.held && end >= next;
        let gap = !tunnel.held && start >= next;
        let piece = !falls && !gap;
        let far = end >= next;
        let x = select(select(end, start, gap), next, falls);
        if !piece || far { go_to(x, select(t, tunnel.last_t, !piece)); }
        tunnel.held = piece && !far;
        if piece {
            tunnel.last_t = t;
            break;
        }
    }
    // No push fills a ring that has had room made in; were one to, its first corner would be lost.
    if any(tunnel.end - tunnel.begin > vec2<u32>(CORNERS)) { ran_out(); }
}

// Ends the last line and fills the row.
fn finish() {
    if tunnel.started {
        if tunnel.held { go_to(tunnel.last_x + UPRIGHT, tunnel.last_t); }
        let x = tunnel.last_x;
        let dark = tunnel.last_t < own.epsilon;
        // Behind its last node the stored function is level: where a level line is left in the tunnel, it needs no end.
        let ceiling = min(tunnel.last_t + own.epsilon, 1.0);
        let level = tunnel.top <= ceiling;
        let middle = clamp(0.5 * (tunnel.top + own.epsilon + tunnel.last_t), tunnel.top, max(ceiling, tunnel.top));
        let flat = select(middle, tunnel.top, dark);
        // Otherwise the middle of the lines that are left; the lowest where that is darkness.
        let share = select(0.5, 0.0, dark);
        let t = select(mix(side_line(FLOOR, x), -side_line(CEILING, x), share), flat, level);
        let slope = select(min(mix(tunnel.slope[FLOOR], -tunnel.slope[CEILING], share), 0.0), 0.0, level);
        turn_into(vec2<f32>(x, t), slope, vec2<f32>(x));
        if !level { node(x, t); }
        if tunnel.narrowed { count_narrowed(); }
    }
    finish_rows(tunnel.node_t);
}
