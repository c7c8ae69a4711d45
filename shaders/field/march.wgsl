// Light march of all shadow methods: cell by cell through the active bricks of one ray.
//
// Inside a cell the value along the ray is a cubic, which is formed exactly. It is cut at its extrema and where it passes a
// breakpoint of the transfer function, which the pre-compressed table finds (Hadwiger et al. 2006, 3.2). Between cuts the
// ordinate of the transfer function is a linear function of a monotone cubic. Four-point Gauss integrates extinction exactly,
// and its logarithm from opacity well if opacity does not near 1 too fast. docs/bound.md derives how short pieces have to be.
//
// The sink, a module that defines `umbravox::sink`, takes the pieces. It offers
//   struct Sink                                     the state of one ray
//   fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool
//       takes the optical depth between two depths (mm). Pieces come in the order of the march and do not overlap; stretches
//       without extinction may be skipped or come with depth 0. The result true ends the ray.
//   fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32
//       the largest optical depth of a smooth stretch between two depths (mm) whose chord is straight enough for the sink;
//       FAR if the course inside a piece does not matter
//
// Control flow: one inner loop advances to the next cell with extinction, another takes the pieces of a stretch, and the
// outer loop takes one stretch in each iteration. Lanes of a subgroup wait for each other only there, and expensive code
// stands in the program once. Loops exit at their last line, as in `umbravox::ray_march`.
#define_import_path umbravox::march

#import umbravox::field::{field, Cell, next_cell_values, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::transfer::{interval_start, interval_at, extinction_in, ordinates_in, extinction_of, extinction_slope, uneven, nodes_between, MORE_NODES}
#import umbravox::labels::{label_shift, shifted_cubic, label_borders, next_label_border, UNKNOWN_SHIFT, CUTS_BY_LABEL}
#import umbravox::quirks::STEPS_TOGETHER
#import umbravox::sink::{Sink, sink_piece, longest_depth}
#import umbravox::watch::report_iteration_limit
#import umbravox::work::{count_work, CELLS, PIECES}

// Gauss-Legendre quadrature on [0, 1], exact to the seventh degree.
const GAUSS_POINTS = vec4<f32>(#{GAUSS_OUTER}, #{GAUSS_INNER}, 1.0 - #{GAUSS_INNER}, 1.0 - #{GAUSS_OUTER});
const GAUSS_WEIGHTS = vec4<f32>(#{OUTER_WEIGHT}, #{INNER_WEIGHT}, #{INNER_WEIGHT}, #{OUTER_WEIGHT});
// Steps of Newton's method, each of which at least halves the interval: enough for every bit of a float32.
const ROOT_STEPS: i32 = 40;
// Error in value at a breakpoint, as a share of the largest value of the stretch.
const ROOT_TOLERANCE: f32 = #{ROOT_TOLERANCE};
// Share of a chord below which a piece is not taken by itself.
const LEAST_PIECE: f32 = 1e-6;
// Length below which a piece is straight enough, in smallest voxel spacings: a depth tolerance of the error bound.
const SHORT_PIECE: f32 = #{SHORT_PIECE};
// Times that a piece over which opacity nears 1 is shortened, by half at least: enough for every bit of a float32.
const SHORTENINGS: i32 = 40;
// Pieces of one cell beyond those that are counted one by one: their optical depths add up to at most that of the ray.
const MAX_THICK_PIECES: u32 = 512u;
// Stretches of a cell's chord: between extrema, and between labels.
const MAX_STRETCHES: u32 = 3u * CUTS_BY_LABEL;
// Pieces of a ray whose sum satisfies the error bound.
const MAX_PIECES: u32 = #{MOST_PIECES};

// c.x + u (c.y + u (c.z + u c.w))
fn cubic(c: vec4<f32>, u: f32) -> f32 {
    return c.x + u * (c.y + u * (c.z + u * c.w));
}

fn cubic_slope(c: vec4<f32>, u: f32) -> f32 {
    return c.y + u * (2.0 * c.z + 3.0 * u * c.w);
}

// Returns the value along the chord of a cell from f to f + e (cell coordinates in [0, 1]).
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

// Returns where the cubic, monotone from a to b with the values va and vb there, passes v.
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

// Returns the extrema of the cubic inside (0, 1), ascending; 2 stands for none.
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
// Long: the loops share their state, and llvmpipe of Mesa 22.3 crashes on branches in functions of their own.
fn march(sink: ptr<function, Sink>, o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) {
    let inv_d = safe_inverse(d);
    let span = clipped_span(o, d, box_span(o, inv_d, d, field.active_lo, field.active_hi));
    let end = min(span.y, z_to);
    let moves = abs(d) >= vec3<f32>(1e-20);
    let top = vec3<i32>(field.size);
    // Axes along which the ray descends are mirrored about whole bricks, so that bricks stay bricks and the ray ascends along
    // all axes.
    let mirrored = d < vec3<f32>(0.0);
    let whole = ((top + BRICK_CELLS) >> BRICK_SHIFT) * BRICK_CELLS;
    let first_cell = select(vec3<i32>(0), whole - 1, mirrored);
    let sense = select(vec3<i32>(1), vec3<i32>(-1), mirrored);
    let ascending_o = select(o, vec3<f32>(whole) - o, mirrored);
    let ascending_d = abs(d);
    let inv_ascending_d = abs(inv_d);
    let last_cell = select(top, whole - 1, mirrored);
    // Every step leaves a cell for good.
    var cells_left = top.x + top.y + top.z + 3;
    let short_mm = SHORT_PIECE * field.min_spacing_mm;
    // The next cell, and the depth at which the ray enters it.
    var z = max(span.x, z_from);
    var cell = clamp(vec3<i32>(floor(ascending_o + z * ascending_d)), last_cell - top, last_cell);
    var marching = z < end;
    // Values of the last cell if `known`, and the axis along which the ray left it.
    var values = Cell(vec4<f32>(0.0), vec4<f32>(0.0));
    var known = false;
    var along = vec3<bool>(false, false, true);
    // The chord of the present cell, the cubic along it, and the parameter and value up to which it is integrated.
    var chord_z = 0.0;
    var chord_mm = 0.0;
    var c = vec4<f32>(0.0);
    var u = 1.0;
    var value = 0.0;
    var borders = vec3<f32>(2.0);
    var shift = UNKNOWN_SHIFT;
    // Pieces that the cell may still be cut into, and pieces of the whole ray.
    var pieces_left = 0u;
    var pieces = 0u;
    var done = false;
    // A cell or the ray has more pieces than it may have.
    var too_many = false;
    loop {
        var steps = 0u;
        loop {
            steps += 1u;
            if u >= 1.0 && marching {
                let distance = brick_distance_at((first_cell + sense * cell) >> BRICK_SHIFT);
                // Advances the ray by one cell, or skips to the exit of the cube of empty bricks.
                let past = select(cell + 1, ((cell >> BRICK_SHIFT) + distance) * BRICK_CELLS, distance > 0);
                let exits = select(vec3<f32>(FAR), (vec3<f32>(past) - ascending_o) * inv_ascending_d, moves);
                let exit = max(min(min(exits.x, exits.y), min(exits.z, end)), z);
                let p = ascending_o + exit * ascending_d;
                if distance == 0 {
                    values = next_cell_values(values, first_cell + sense * cell, mirrored, along, known);
                    count_work(CELLS, select(0u, 1u, known));
                    let lo4 = min(values.lo, values.hi);
                    let hi4 = max(values.lo, values.hi);
                    let least = min(min(lo4.x, lo4.y), min(lo4.z, lo4.w));
                    let greatest = max(max(hi4.x, hi4.y), max(hi4.z, hi4.w));
                    if known && exit > z && greatest > field.first_value && least < field.last_value {
                        let f = clamp(ascending_o + z * ascending_d - vec3<f32>(cell), vec3<f32>(0.0), vec3<f32>(1.0));
                        let e = clamp(p - vec3<f32>(cell), vec3<f32>(0.0), vec3<f32>(1.0)) - f;
                        c = chord_cubic(values, f, e);
                        chord_z = z;
                        chord_mm = exit - z;
                        u = 0.0;
                        value = c.x;
                        borders = label_borders(f, e);
                        shift = UNKNOWN_SHIFT;
                        // Each stretch passes each interval, is shortened where opacity nears 1, and has short pieces and
                        // pieces that span a share of a whole ray.
                        let short_pieces = u32(min(chord_mm / short_mm, 1e6));
                        pieces_left = MAX_STRETCHES * field.intervals * u32(SHORTENINGS) + short_pieces + MAX_THICK_PIECES;
                    }
                }
                if distance > 0 || known {
                    z = exit;
                    // The ray leaves by a known face; rounding must not move it back, on this or another axis.
                    let inner = clamp(vec3<i32>(floor(p)), cell, past - 1);
                    let leaves = exits <= vec3<f32>(exit);
                    let next = select(select(cell, inner, moves), past, leaves);
                    // Past an edge, a corner or empty bricks no values are known.
                    known = distance == 0 && !(leaves.x && leaves.y) && !(leaves.z && (leaves.x || leaves.y));
                    along = select(vec3<bool>(false, false, true), leaves, known);
                    cell = next;
                    marching = z < end && all(cell <= last_cell);
                    cells_left -= 1;
                    marching = marching && cells_left >= 0;
                } else {
                    // The nearer face is known now: the next step takes the cell.
                    known = true;
                }
            }
            if u < 1.0 || !marching || steps >= STEPS_TOGETHER { break; }
        }
        if u >= 1.0 {
            if !marching {
                done = true;
                break;
            }
            continue;
        }

        // The monotone stretch ahead, nearest to voxels of one label, and the first breakpoint on it.
        let cuts = extrema(c);
        let turn = next_label_border(
            borders, u, select(select(1.0, cuts.y, cuts.y > u && cuts.y < 1.0), cuts.x, cuts.x > u && cuts.x < 1.0));
        let new_shift = label_shift(o + (chord_z + 0.5 * (u + turn) * chord_mm) * d);
        let shown = shifted_cubic(c, new_shift);
        if new_shift != shift {
            shift = new_shift;
            value = cubic(shown, u);
        }
        let turn_value = cubic(shown, turn);
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
            stretch_end = crossing(shown, u, turn, value, turn_value, node);
            end_value = node;
        }
        let j = interval_at(0.5 * (value + end_value));
        var ends = ordinates_in(j, vec4<f32>(value, end_value, value, value));
        // Opacity that nears 1 makes a logarithm too steep for the quadrature.
        for (var k = 0; k < SHORTENINGS; k++) {
            if !uneven(ends, (stretch_end - u) * chord_mm) { break; }
            // For a linear value this share changes the transmitted light by nearly the factor of 2. Where the value begins
            // flat the share is far too small, hence the lower limit; halving at least ends the loop.
            let twice = select(0.5, 1.0, ends.transmitted.y > ends.transmitted.x);
            let share = clamp(0.98 * twice * ends.transmitted.x / abs(ends.transmitted.y - ends.transmitted.x), 0.0625, 0.5);
            stretch_end = max(u + share * (stretch_end - u), min(u + LEAST_PIECE, stretch_end));
            end_value = cubic(shown, stretch_end);
            ends = ordinates_in(j, vec4<f32>(value, end_value, value, value));
        }

        // A chord of length h strays from T exp(-depth) by at most T h^2 (sigma^2 + dsigma/dz) / 8. The slope of a
        // stretch of the cubic is a parabola, which lies between its Bernstein coefficients.
        let sigmas = extinction_of(ends);
        let sigma = max(sigmas.x, sigmas.y);
        let slope_a = cubic_slope(shown, u);
        let steepness = max(
            max(abs(slope_a), abs(slope_a + (stretch_end - u) * (shown.z + 3.0 * u * shown.w))),
            abs(cubic_slope(shown, stretch_end)),
        );
        let rise = extinction_slope(j, min(ends.transmitted.x, ends.transmitted.y)) * steepness / chord_mm;
        let bend = sqrt(sigma * sigma + rise) * chord_mm;
        loop {
            let reach = longest_depth(sink, chord_z + u * chord_mm, chord_z + stretch_end * chord_mm);
            let parts = ceil((stretch_end - u) * min(bend / reach, chord_mm / short_mm));
            let piece_end = select(stretch_end, u + (stretch_end - u) / parts, parts > 1.0);
            let h = piece_end - u;
            let at = u + h * GAUSS_POINTS;
            let mean = dot(GAUSS_WEIGHTS, extinction_in(j, shown.x + at * (shown.y + at * (shown.z + at * shown.w))));
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
        if pieces_left == 0u || pieces > MAX_PIECES {
            too_many = true;
            u = 1.0;
        }
    }
    if !done || too_many || cells_left < 0 { report_iteration_limit(); }
}
