// The light march that every shadow method shares: cell by cell through the active bricks of one ray.
//
// Inside a cell the value along the ray is a cubic, which is formed exactly; it is cut at its extrema and where it
// passes a breakpoint of the transfer function, found through the pre-compressed table (Hadwiger et al. 2006, 3.2) and
// placed on the cubic. Between cuts extinction is a straight function of a monotone cubic, which four-point
// Gauss integrates exactly, or the logarithm of one, which it integrates well where opacity does not near 1 too fast. How
// short pieces are beyond that is derived in docs/bound.md.
//
// The sink, a module that defines `umbravox::sink`, takes the pieces. It offers
//   struct Sink                                     what one ray has gathered
//   fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool
//       takes the optical depth between two depths (mm); pieces come in the order of the march, none overlap, stretches
//       without extinction may be left out or come with depth 0; true ends the ray
//   fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32
//       the optical depth, of a smooth stretch between two depths (mm), whose chord is straight enough for the sink
//       where it stands; FAR where it does not look inside
//
// Control flow: one inner loop walks to the next cell with extinction, another takes a stretch in pieces, the outer one
// is a single stretch a turn. Lanes of a subgroup then wait for each other only there, and what is expensive stands in the
// program once. Loops end at their last line, as in `umbravox::walk`. That is why `march` is one long function: its loops
// share their state, and llvmpipe of Mesa 22.3 has crashed on branches that were moved into functions of their own.
#define_import_path umbravox::march

#import umbravox::field::{field, Cell, next_cell_values, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::transfer::{interval_start, interval_at, extinction_in, amounts_in, extinction_of, extinction_slope, uneven, nodes_between, MORE_NODES}
#ifdef LABELS
#import umbravox::labels::{shift_at, is_hidden}
#endif
#import umbravox::sink::{Sink, sink_piece, longest_depth}
#import umbravox::watch::ran_out
#import umbravox::work::{count_work, CELLS, PIECES}

// Of Gauss and Legendre on [0, 1], exact to the seventh degree.
const GAUSS_POINTS = vec4<f32>(#{GAUSS_OUTER}, #{GAUSS_INNER}, 1.0 - #{GAUSS_INNER}, 1.0 - #{GAUSS_OUTER});
const GAUSS_WEIGHTS = vec4<f32>(#{OUTER_WEIGHT}, #{INNER_WEIGHT}, #{INNER_WEIGHT}, #{OUTER_WEIGHT});
// Cells that a lane walks through before those of its subgroup that have found something go on (best of 2, 4 and no
// limit on llvmpipe).
const WALK_STEPS: u32 = 4u;
// Newton's steps at least halve the way to a root, also where the cubic is flat: enough for every bit of a float32.
const ROOT_STEPS: i32 = 40;
// Value, as a share of what the stretch holds, to which a breakpoint is found.
const ROOT_TOLERANCE: f32 = #{ROOT_TOLERANCE};
// A chord's share below which a piece is not worth its own turn.
const LEAST_PIECE: f32 = 1e-6;
// Length below which a piece is straight enough, in smallest voxel spacings: a stated depth of the bound.
const SHORT_PIECE: f32 = #{SHORT_PIECE};
// Shortenings, by half at least, of a piece over which opacity nears 1: enough for all that float32 knows of it.
const SHORTENINGS: i32 = 40;

// Parts of one cell beyond those that are counted one by one: their depths add up to no more than a ray's.
const MOST_PARTS: u32 = 512u;
// Stretches of a cell's chord, at the most: between extrema, and with LABELS between middles.
#ifdef LABELS
const STRETCHES: u32 = 6u;
#else
const STRETCHES: u32 = 3u;
#endif
// Pieces of a ray whose sums are as good as is promised.
const MOST_PIECES: u32 = #{MOST_PIECES};

// c.x + u (c.y + u (c.z + u c.w))
fn cubic(c: vec4<f32>, u: f32) -> f32 {
    return c.x + u * (c.y + u * (c.z + u * c.w));
}

fn cubic_slope(c: vec4<f32>, u: f32) -> f32 {
    return c.y + u * (2.0 * c.z + 3.0 * u * c.w);
}

// The value along a cell's chord from f to f + e (cell coordinates in [0, 1]).
fn chord_cubic(cell: Cell, f: vec3<f32>, e: vec3<f32>) -> vec4<f32> {
    let c0 = cell.lo.x;
    let cx = cell.lo.y - cell.lo.x;
    let cy = cell.lo.z - cell.lo.x;
    let cz = cell.hi.x - cell.lo.x;
    let cxy = (cell.lo.w - cell.lo.z) - cx;
    let cxz = (cell.hi.y - cell.hi.x) - cx;
    let cyz = (cell.hi.z - cell.hi.x) - cy;
    let cxyz = ((cell.hi.w - cell.hi.z) - (cell.hi.y - cell.hi.x)) - cxy;
    return vec4<f32>(
        c0 + f.x * (cx + f.y * (cxy + f.z * cxyz) + f.z * cxz) + f.y * (cy + f.z * cyz) + f.z * cz,
        e.x * (cx + f.y * (cxy + f.z * cxyz) + f.z * cxz)
            + e.y * (cy + f.x * (cxy + f.z * cxyz) + f.z * cyz)
            + e.z * (cz + f.x * (cxz + f.y * cxyz) + f.y * cyz),
        e.x * e.y * (cxy + f.z * cxyz) + e.x * e.z * (cxz + f.y * cxyz) + e.y * e.z * (cyz + f.x * cxyz),
        e.x * e.y * e.z * cxyz,
    );
}

// Where the cubic, monotone from a to b with the values va and vb there, passes v.
fn crossing(c: vec4<f32>, a: f32, b: f32, va: f32, vb: f32, v: f32) -> f32 {
    var lo = a;
    var hi = b;
    let rising = vb > va;
    var u = a + (b - a) * clamp((v - va) / (vb - va), 0.0, 1.0);
    let enough = ROOT_TOLERANCE * max(abs(va), abs(vb));
    for (var i = 0; i < ROOT_STEPS; i++) {
        let excess = cubic(c, u) - v;
        if abs(excess) <= enough { break; }
        if (excess > 0.0) == rising { hi = u; } else { lo = u; }
        let slope = cubic_slope(c, u);
        var next = u - excess / select(slope, 1.0, slope == 0.0);
        if !(next >= lo && next <= hi) { next = 0.5 * (lo + hi); }
        u = next;
    }
    return clamp(u, a, b);
}

// Extrema of the cubic inside (0, 1), ascending; 2 stands for none.
fn extrema(c: vec4<f32>) -> vec2<f32> {
    let a = 3.0 * c.w;
    let b = c.z;
    let size = abs(c.y) + abs(c.z) + abs(c.w);
    var roots = vec2<f32>(2.0);
    if size == 0.0 { return roots; }
    let disc = b * b - a * c.y;
    if disc > 0.0 {
        let q = -(b + select(-1.0, 1.0, b >= 0.0) * sqrt(disc));
        if q != 0.0 { roots.x = c.y / q; }
        if abs(a) > 1e-7 * size { roots.y = q / a; }
    }
    roots = select(vec2<f32>(2.0), roots, (roots > vec2<f32>(0.0)) & (roots < vec2<f32>(1.0)));
    return vec2<f32>(min(roots.x, roots.y), max(roots.x, roots.y));
}

// Marches the ray o + z d (grid space, d per mm) over the depths [z_from, z_to].
fn march(sink: ptr<function, Sink>, o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) {
    let inv_d = safe_inverse(d);
    let span = clipped_span(o, d, box_span(o, inv_d, d, field.active_lo, field.active_hi));
    let end = min(span.y, z_to);
    let moves = abs(d) >= vec3<f32>(1e-20);
    let top = vec3<i32>(field.size);
    // From here on in a frame whose axes all go with the ray: those along which it goes down are mirrored about whole
    // bricks, so that bricks stay bricks.
    let mirrored = d < vec3<f32>(0.0);
    let whole = ((top + BRICK_CELLS) >> BRICK_SHIFT) * BRICK_CELLS;
    let first_cell = select(vec3<i32>(0), whole - 1, mirrored);
    let sense = select(vec3<i32>(1), vec3<i32>(-1), mirrored);
    let from_o = select(o, vec3<f32>(whole) - o, mirrored);
    let way = abs(d);
    let inv_way = abs(inv_d);
    let last_cell = select(top, whole - 1, mirrored);
    // Every step leaves a cell for good, and on each axis the ray goes one way.
    var cells_left = top.x + top.y + top.z + 3;
    let short_mm = SHORT_PIECE * field.min_spacing_mm;
    // Where the walk stands: the cell not yet looked at, and the depth at which the ray enters it.
    var z = max(span.x, z_from);
    var cell = clamp(vec3<i32>(floor(from_o + z * way)), last_cell - top, last_cell);
    var walking = z < end;
    // Values of the cell that the ray comes from, and the axis along which it does; `held` where they are known.
    var values = Cell(vec4<f32>(0.0), vec4<f32>(0.0));
    var held = false;
    var along = vec3<bool>(false, false, true);
    // The cell that is being taken apart: its chord's start and length, the cubic, and how far it is done.
    var chord_z = 0.0;
    var chord_mm = 0.0;
    var c = vec4<f32>(0.0);
    var u = 1.0;
    var value = 0.0;
#ifdef LABELS
    // Where the chord passes half-way between two voxels on each axis, 2 where it does not; and what is added to its values.
    var middles = vec3<f32>(2.0);
    var shift = 0.0;
#endif
    // The cubic of the values as they are seen: those of the volume, or shifted to their label's function.
    var seen = vec4<f32>(0.0);
    // Pieces that the cell may still be cut into.
    var pieces_left = 0u;
    // Pieces of the whole ray.
    var pieces = 0u;
    // The ray was marched to its end: some adapters end loops that they find long, and say nothing.
    var done = false;
    // A cell, or the ray, has taken more pieces than it may.
    var over = false;
    loop {
        var steps = 0u;
        loop {
            steps += 1u;
            if u >= 1.0 && walking {
                let distance = brick_distance_at((first_cell + sense * cell) >> BRICK_SHIFT);
                // Through one cell, or out of the cube of bricks that are known to be empty.
                let past = select(cell + 1, ((cell >> BRICK_SHIFT) + distance) * BRICK_CELLS, distance > 0);
                let exits = select(vec3<f32>(FAR), (vec3<f32>(past) - from_o) * inv_way, moves);
                let exit = max(min(min(exits.x, exits.y), min(exits.z, end)), z);
                let p = from_o + exit * way;
                if distance == 0 {
                    values = next_cell_values(values, first_cell + sense * cell, mirrored, along, held);
                    count_work(CELLS, select(0u, 1u, held));
                    let lo4 = min(values.lo, values.hi);
                    let hi4 = max(values.lo, values.hi);
                    let least = min(min(lo4.x, lo4.y), min(lo4.z, lo4.w));
                    let most = max(max(hi4.x, hi4.y), max(hi4.z, hi4.w));
                    if held && exit > z && most > field.first_value && least < field.last_value {
                        let f = clamp(from_o + z * way - vec3<f32>(cell), vec3<f32>(0.0), vec3<f32>(1.0));
                        let e = clamp(p - vec3<f32>(cell), vec3<f32>(0.0), vec3<f32>(1.0)) - f;
                        c = chord_cubic(values, f, e);
                        chord_z = z;
                        chord_mm = exit - z;
                        u = 0.0;
                        value = c.x;
#ifdef LABELS
                        let halves = (0.5 - f) / select(e, vec3<f32>(1.0), e == vec3<f32>(0.0));
                        let inside = (e != vec3<f32>(0.0)) & (halves > vec3<f32>(0.0)) & (halves < vec3<f32>(1.0));
                        middles = select(vec3<f32>(2.0), halves, inside);
                        shift = -FAR;
#endif
                        // Intervals, each gone through in every stretch and shortened where opacity nears 1, and
                        // parts that are short or span a share of a whole ray.
                        let short_parts = u32(min(chord_mm / short_mm, 1e6));
                        pieces_left = STRETCHES * field.intervals * u32(SHORTENINGS) + short_parts + MOST_PARTS;
                    }
                }
                if distance > 0 || held {
                    z = exit;
                    // On the face that is left the next cell is known; rounding must not put it back, there or
                    // anywhere.
                    let inner = clamp(vec3<i32>(floor(p)), cell, past - 1);
                    let leaves = exits <= vec3<f32>(exit);
                    let next = select(select(cell, inner, moves), past, leaves);
                    // Past an edge or a corner, and after a leap, nothing is known.
                    held = distance == 0 && !(leaves.x && leaves.y) && !(leaves.z && (leaves.x || leaves.y));
                    along = select(vec3<bool>(false, false, true), leaves, held);
                    cell = next;
                    walking = z < end && all(cell <= last_cell);
                    cells_left -= 1;
                    walking = walking && cells_left >= 0;
                } else {
                    // The nearer face is known now: the next turn takes the cell.
                    held = true;
                }
            }
            if u < 1.0 || !walking || steps >= WALK_STEPS { break; }
        }
        if u >= 1.0 {
            if !walking {
                done = true;
                break;
            }
            continue;
        }

        // The monotone stretch ahead, and the first breakpoint on it.
        let cuts = extrema(c);
#ifdef LABELS
        var turn = select(select(1.0, cuts.y, cuts.y > u && cuts.y < 1.0), cuts.x, cuts.x > u && cuts.x < 1.0);
        let ahead = select(vec3<f32>(1.0), middles, middles > vec3<f32>(u));
        turn = min(turn, min(ahead.x, min(ahead.y, ahead.z)));
        // All of the stretch lies nearest to one voxel.
        let new_shift = shift_at(o + (chord_z + 0.5 * (u + turn) * chord_mm) * d);
        if new_shift != shift {
            shift = new_shift;
            seen = select(
                vec4<f32>(c.x + shift, c.yzw),
                vec4<f32>(field.hidden_value, 0.0, 0.0, 0.0),
                is_hidden(shift),
            );
            value = cubic(seen, u);
        }
        let turn_value = cubic(seen, turn);
#else
        let turn = select(select(1.0, cuts.y, cuts.y > u && cuts.y < 1.0), cuts.x, cuts.x > u && cuts.x < 1.0);
        seen = c;
        let turn_value = cubic(seen, turn);
#endif
        var stretch_end = turn;
        var end_value = turn_value;
        let nodes = nodes_between(value, turn_value);
        var node = 0.0;
        var crosses = false;
        for (var k = 3; k >= 0; k--) {
            let v = interval_start(nodes[k]);
            if nodes[k] < MORE_NODES && (v - value) * (v - turn_value) < 0.0 {
                node = v;
                crosses = true;
            }
        }
#ifdef MANY_BREAKPOINTS
        // More breakpoints than the table holds: the next one ahead ends the value's own interval.
        if nodes.w == MORE_NODES {
            let here = interval_at(value);
            let falling = select(here, here - 1u, interval_start(here) >= value && here > 0u);
            node = select(interval_start(falling), interval_start(here + 1u), turn_value > value);
            crosses = (node - value) * (node - turn_value) < 0.0;
        }
#endif
        if crosses {
            stretch_end = crossing(seen, u, turn, value, turn_value, node);
            end_value = node;
        }
        let j = interval_at(0.5 * (value + end_value));
        var ends = amounts_in(j, vec4<f32>(value, end_value, value, value));
        // Opacity that nears 1 makes a logarithm too steep for the quadrature.
        for (var k = 0; k < SHORTENINGS; k++) {
            if !uneven(ends, (stretch_end - u) * chord_mm) { break; }
            // Were the value straight, this would change it by nearly the factor. Where it begins flat that is far too
            // little, hence the limit; halving at least ends it.
            let twice = select(0.5, 1.0, ends.lacking.y > ends.lacking.x);
            let kept = clamp(0.98 * twice * ends.lacking.x / abs(ends.lacking.y - ends.lacking.x), 0.0625, 0.5);
            stretch_end = max(u + kept * (stretch_end - u), min(u + LEAST_PIECE, stretch_end));
            end_value = cubic(seen, stretch_end);
            ends = amounts_in(j, vec4<f32>(value, end_value, value, value));
        }

        // A chord of length h strays from T exp(-depth) by at most T h^2 (sigma^2 + dsigma/dz) / 8. The slope of a
        // stretch of the cubic is a parabola, which lies between its Bernstein coefficients.
        let sigmas = extinction_of(ends);
        let sigma = max(sigmas.x, sigmas.y);
        let slope_a = cubic_slope(seen, u);
        let steepness = max(
            max(abs(slope_a), abs(slope_a + (stretch_end - u) * (seen.z + 3.0 * u * seen.w))),
            abs(cubic_slope(seen, stretch_end)),
        );
        let rise = extinction_slope(j, min(ends.lacking.x, ends.lacking.y)) * steepness / chord_mm;
        let bend = sqrt(sigma * sigma + rise) * chord_mm;
        loop {
            let reach = longest_depth(sink, chord_z + u * chord_mm, chord_z + stretch_end * chord_mm);
            let parts = ceil((stretch_end - u) * min(bend / reach, chord_mm / short_mm));
            let piece_end = select(stretch_end, u + (stretch_end - u) / parts, parts > 1.0);
            let h = piece_end - u;
            let at = u + h * GAUSS_POINTS;
            let mean = dot(GAUSS_WEIGHTS, extinction_in(j, seen.x + at * (seen.y + at * (seen.z + at * seen.w))));
            done = sink_piece(sink, chord_z + u * chord_mm, chord_z + piece_end * chord_mm, mean * h * chord_mm);
            u = piece_end;
            count_work(PIECES, 1u);
            pieces_left -= 1u;
            pieces += 1u;
            if done || u >= stretch_end || pieces_left == 0u { break; }
        }
        if done { break; }
        value = end_value;
        u = select(u, 1.0, u > 1.0 - LEAST_PIECE);
        if pieces_left == 0u || pieces > MOST_PIECES {
            over = true;
            u = 1.0;
        }
    }
    if !done || over || cells_left < 0 { ran_out(); }
}
