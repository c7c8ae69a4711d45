// Light march of all shadow methods: cell by cell through the active bricks of one ray.
//
// Inside a cell the value along the ray is a cubic, which is formed exactly. It is cut at its extrema and where it
// passes a breakpoint of the transfer function, which the pre-compressed table finds (Hadwiger et al. 2006, 3.2).
// Between cuts the transfer function's amount is a linear function of a monotone cubic. Four-point Gauss quadrature
// integrates extinction exactly, and extinction from opacity well if opacity does not near 1 too fast. docs/bound.md
// derives how short pieces have to be.
//
// The sink, a module that defines `umbravox::sink`, takes the pieces. It offers
//   struct Sink
//       the state of one ray
//   fn sink_piece(sink: ptr<function, Sink>, z_from: f32, z_to: f32, depth: f32) -> bool
//       takes the optical depth between two depths (mm). Pieces come in the order of the march and do not overlap;
//       stretches without extinction may be skipped or come with depth 0. The result true ends the ray.
//   fn longest_depth(sink: ptr<function, Sink>, z_from: f32, z_to: f32) -> f32
//       the largest optical depth of a smooth piece between two depths (mm) for which the sink may replace the curve
//       by its chord; FAR if the sink does not need the shape of the curve
//
// Control flow: one inner loop advances to the next cell with extinction, another takes the pieces of a stretch, and
// the outer loop takes one stretch in each iteration. Lanes of a subgroup wait for each other only there, and
// expensive code stands in the program once. Loops exit at their last line, as in `umbravox::ray_march`.
#define_import_path umbravox::march

#import umbravox::field::{field, Cell, next_cell_values, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::cubic::{cubic, cubic_slope, chord_cubic, crossing, extrema}
#import umbravox::transfer::{interval_start, interval_at, extinction_in, ordinates_in, extinction_of, extinction_slope, uneven, nodes_between, MORE_NODES}
#import umbravox::gradient_opacity::gradient_factors
#import umbravox::labels::{label_shift, shifted_cubic, label_borders, next_label_border, UNKNOWN_SHIFT, CUTS_BY_LABEL}
#import umbravox::tuning::LIGHT_STEPS_TOGETHER
#import umbravox::sink::{Sink, sink_piece, longest_depth}
#import umbravox::watch::report_iteration_limit
#import umbravox::work::{count_step, count_work, CELLS, LOADS, PIECES}
#ifdef RAY_STATES
#import umbravox::field::{missing_page, wait_for_page, MISSING, NEAR_MISSING}
#import umbravox::ray_state::{has_state, start_state, finish_ray, put_word, put_float, take_word, take_float}
#endif

// Gauss-Legendre quadrature on [0, 1] with four points, exact to degree seven.
const GAUSS_POINTS = vec4<f32>(#{GAUSS_OUTER}, #{GAUSS_INNER}, 1.0 - #{GAUSS_INNER}, 1.0 - #{GAUSS_OUTER});
const GAUSS_WEIGHTS = vec4<f32>(#{OUTER_WEIGHT}, #{INNER_WEIGHT}, #{INNER_WEIGHT}, #{OUTER_WEIGHT});
// Fraction of a chord below which a piece is not integrated separately.
const LEAST_PIECE: f32 = 1e-6;
// Length, in smallest voxel spacings, below which a piece needs no further division: a depth tolerance of the error
// bound.
const SHORT_PIECE: f32 = #{SHORT_PIECE};
// Number of times that a piece is shortened, by half at least, if opacity nears 1 on it: enough for every bit of a
// float32.
const SHORTENINGS: i32 = 40;
// Limit on the pieces of one cell that are split because of their optical depth. Their optical depths add up to at
// most that of the ray.
const MAX_THICK_PIECES: u32 = 512u;
// Largest number of stretches of a cell's chord, which extrema and label borders cut.
const MAX_STRETCHES: u32 = 3u * CUTS_BY_LABEL;
// Largest number of pieces of a ray for which the rounding error of the sum satisfies the error bound.
const MAX_PIECES: u32 = #{MOST_PIECES};

// Light ray in a frame in which it ascends along all axes. The other axes are mirrored about whole bricks, so that
// bricks map to bricks.
struct AscendingRay {
    // The ray in grid space, d per mm.
    o: vec3<f32>,
    d: vec3<f32>,
    mirrored: vec3<bool>,
    moves: vec3<bool>,
    ascending_o: vec3<f32>,
    ascending_d: vec3<f32>,
    inv_ascending_d: vec3<f32>,
    // A cell of the mirrored frame is the cell first_cell + sense * cell of the grid.
    first_cell: vec3<i32>,
    sense: vec3<i32>,
    last_cell: vec3<i32>,
    // Depths at which the march starts and ends, mm.
    start: f32,
    end: f32,
}

struct CellMarch {
    // Depth at which the ray enters the next cell, and that cell.
    z: f32,
    cell: vec3<i32>,
    // Whether the march goes on: the end of the ray is not reached. Every step leaves a cell for good.
    marching: bool,
    cells_left: i32,
    // Values of the cell before if `known`, and the axis along which the ray left it.
    values: Cell,
    known: bool,
    along: vec3<bool>,
    // Chord of the present cell: its start and length (mm), the cubic of values along it, and the parameter and value
    // up to which it is integrated.
    chord_z: f32,
    chord_mm: f32,
    c: vec4<f32>,
    u: f32,
    value: f32,
    // Label borders on the chord, and the shift of values for the label at u.
    borders: vec3<f32>,
    shift: f32,
    // Number of pieces into which the cell may still be cut.
    pieces_left: u32,
#ifdef RAY_STATES
    // Number of the page that must become resident before the march goes on; -1 if it goes on.
    missing: i32,
#endif
#ifdef GRADIENT_OPACITY
    // Start of the chord in the cell, its end minus its start, and -1 along mirrored axes, else 1.
    chord_start: vec3<f32>,
    chord_vector: vec3<f32>,
    sense: vec3<f32>,
#endif
}

// Stretch of a chord on which the transfer function's amount is a linear function of a monotone cubic.
struct Stretch {
    // Cubic of the values along the chord, shifted for the label.
    shown: vec4<f32>,
    end: f32,
    end_value: f32,
    // Index of the transfer-function interval of the stretch.
    j: u32,
    // Curvature of the transmittance curve: a piece of length h differs from its chord by at most (h bend)^2 / 8
    // times its transmittance.
    bend: f32,
}

fn ascending_ray(o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) -> AscendingRay {
    let inv_d = safe_inverse(d);
    let span = clipped_span(o, d, box_span(o, inv_d, d, field.active_lo, field.active_hi));
    let top = vec3<i32>(field.size);
    let mirrored = d < vec3<f32>(0.0);
    let whole = ((top + BRICK_CELLS) >> BRICK_SHIFT) * BRICK_CELLS;
    return AscendingRay(
        o,
        d,
        mirrored,
        abs(d) >= vec3<f32>(1e-20),
        select(o, vec3<f32>(whole) - o, mirrored),
        abs(d),
        abs(inv_d),
        select(vec3<i32>(0), whole - 1, mirrored),
        select(vec3<i32>(1), vec3<i32>(-1), mirrored),
        select(top, whole - 1, mirrored),
        max(span.x, z_from),
        min(span.y, z_to),
    );
}

fn start_cells(ray: AscendingRay) -> CellMarch {
    let top = vec3<i32>(field.size);
    let cell = clamp(vec3<i32>(floor(ray.ascending_o + ray.start * ray.ascending_d)), ray.last_cell - top, ray.last_cell);
    var march: CellMarch;
    march.z = ray.start;
    march.cell = cell;
    march.marching = ray.start < ray.end;
    march.cells_left = top.x + top.y + top.z + 3;
    march.along = vec3<bool>(false, false, true);
    march.u = 1.0;
#ifdef GRADIENT_OPACITY
    march.sense = vec3<f32>(ray.sense);
#endif
    return march;
}

#ifdef RAY_STATES
#ifdef LABELS
const READ_FLAGS: u32 = NEAR_MISSING;
#else ifdef GRADIENT_OPACITY
const READ_FLAGS: u32 = NEAR_MISSING;
#else
const READ_FLAGS: u32 = MISSING;
#endif

// Flag in the stored number of pieces: a cell exceeds its limit of pieces.
const TOO_MANY: u32 = 0x80000000u;

// Stores the state of a march that waits for a page. Between two cells no chord is pending.
fn suspend_cells(march: CellMarch, pieces: u32, too_many: bool) {
    wait_for_page(march.missing);
    start_state();
    put_float(march.z);
    put_word(bitcast<u32>(march.cell.x));
    put_word(bitcast<u32>(march.cell.y));
    put_word(bitcast<u32>(march.cell.z));
    put_word(bitcast<u32>(march.cells_left));
    put_word(select(pieces, pieces | TOO_MANY, too_many));
}

// Continues a march that has waited, and returns its number of pieces with the flag TOO_MANY. The values of the near face of the cell are read
// again.
fn resume_cells(march: ptr<function, CellMarch>) -> u32 {
    (*march).z = take_float();
    (*march).cell.x = bitcast<i32>(take_word());
    (*march).cell.y = bitcast<i32>(take_word());
    (*march).cell.z = bitcast<i32>(take_word());
    (*march).cells_left = bitcast<i32>(take_word());
    (*march).marching = true;
    return take_word();
}
#endif

// Starts the chord of the present cell, which ends at the depth `exit` and the point p.
fn start_chord(march: ptr<function, CellMarch>, ray: AscendingRay, p: vec3<f32>, exit: f32) {
    let corner = vec3<f32>((*march).cell);
    let f = clamp(ray.ascending_o + (*march).z * ray.ascending_d - corner, vec3<f32>(0.0), vec3<f32>(1.0));
    let e = clamp(p - corner, vec3<f32>(0.0), vec3<f32>(1.0)) - f;
    (*march).c = chord_cubic((*march).values, f, e);
#ifdef GRADIENT_OPACITY
    (*march).chord_start = f;
    (*march).chord_vector = e;
#endif
    (*march).chord_z = (*march).z;
    (*march).chord_mm = exit - (*march).z;
    (*march).u = 0.0;
    (*march).value = (*march).c.x;
    (*march).borders = label_borders(f, e);
    (*march).shift = UNKNOWN_SHIFT;
    // Limit on the pieces of a cell: each stretch passes each interval and is shortened where opacity nears 1. Short
    // pieces, and pieces with a fraction of the ray's optical depth, come in addition.
    let short_pieces = u32(min((*march).chord_mm / (SHORT_PIECE * field.min_spacing_mm), 1e6));
    (*march).pieces_left = MAX_STRETCHES * field.intervals * u32(SHORTENINGS) + short_pieces + MAX_THICK_PIECES;
}

// Advances the ray by one cell, or skips to the exit of the cube of empty bricks. A cell with extinction starts a
// chord.
fn step_cell(march: ptr<function, CellMarch>, ray: AscendingRay) {
    count_step();
    let cell = (*march).cell;
    let grid_cell = ray.first_cell + ray.sense * cell;
    let distance = brick_distance_at(grid_cell >> BRICK_SHIFT);
#ifdef EARLY_LOADS
    // These loads do not wait for the distance; in empty bricks nothing uses them.
    let values = next_cell_values((*march).values, grid_cell, ray.mirrored, (*march).along, (*march).known);
#endif
#ifdef RAY_STATES
    if distance == 0 {
        (*march).missing = missing_page(grid_cell, READ_FLAGS);
        if (*march).missing >= 0 { return; }
    }
#endif
    let past = select(cell + 1, ((cell >> BRICK_SHIFT) + distance) * BRICK_CELLS, distance > 0);
    let exits = select(vec3<f32>(FAR), (vec3<f32>(past) - ray.ascending_o) * ray.inv_ascending_d, ray.moves);
    let exit = max(min(min(exits.x, exits.y), min(exits.z, ray.end)), (*march).z);
    let p = ray.ascending_o + exit * ray.ascending_d;
    if distance == 0 {
#ifdef EARLY_LOADS
        (*march).values = values;
#else
        (*march).values = next_cell_values((*march).values, grid_cell, ray.mirrored, (*march).along, (*march).known);
#endif
        count_work(LOADS, 4u);
        count_work(CELLS, select(0u, 1u, (*march).known));
        let lo4 = min((*march).values.lo, (*march).values.hi);
        let hi4 = max((*march).values.lo, (*march).values.hi);
        let least = min(min(lo4.x, lo4.y), min(lo4.z, lo4.w));
        let greatest = max(max(hi4.x, hi4.y), max(hi4.z, hi4.w));
        let visible = greatest > field.first_value && least < field.last_value;
        if (*march).known && exit > (*march).z && visible { start_chord(march, ray, p, exit); }
    }
    if distance > 0 || (*march).known {
        (*march).z = exit;
        // The ray leaves by a known face; rounding must not move it back, on this or another axis.
        let inner = clamp(vec3<i32>(floor(p)), cell, past - 1);
        let leaves = exits <= vec3<f32>(exit);
        (*march).cell = select(select(cell, inner, ray.moves), past, leaves);
        // Past an edge, a corner or empty bricks no value of the next cell is known.
        (*march).known = distance == 0 && !(leaves.x && leaves.y) && !(leaves.z && (leaves.x || leaves.y));
        (*march).along = select(vec3<bool>(false, false, true), leaves, (*march).known);
        (*march).cells_left -= 1;
        (*march).marching = exit < ray.end && all((*march).cell <= ray.last_cell) && (*march).cells_left >= 0;
    } else {
        // The near face is known now: the next step reads the rest of the cell.
        (*march).known = true;
    }
}

// Returns the first value from `value` to `end_value` at which a new interval of the transfer function starts, or
// `end_value`.
fn next_breakpoint(value: f32, end_value: f32) -> f32 {
    let nodes = nodes_between(value, end_value);
    var node = end_value;
    for (var k = 3; k >= 0; k--) {
        let v = interval_start(nodes[k]);
        if nodes[k] < MORE_NODES && (v - value) * (v - end_value) < 0.0 { node = v; }
    }
#ifdef MANY_BREAKPOINTS
    // The table cannot store all breakpoints here: the next one ahead ends the interval of the value.
    if nodes.w == MORE_NODES {
        let here = interval_at(value);
        let falling = select(here, here - 1u, interval_start(here) >= value && here > 0u);
        let v = select(interval_start(falling), interval_start(here + 1u), end_value > value);
        node = select(end_value, v, (v - value) * (v - end_value) < 0.0);
    }
#endif
    return node;
}

// Returns the next stretch of the chord, with one transfer-function interval and one label.
fn next_stretch(march: ptr<function, CellMarch>, ray: AscendingRay) -> Stretch {
    let u = (*march).u;
    let chord_mm = (*march).chord_mm;
    // The stretch ahead is monotone and has one label; it ends at the first breakpoint.
    let cuts = extrema((*march).c);
    let extremum = select(select(1.0, cuts.y, cuts.y > u && cuts.y < 1.0), cuts.x, cuts.x > u && cuts.x < 1.0);
    let turn = next_label_border((*march).borders, u, extremum);
    let shift = label_shift(ray.o + ((*march).chord_z + 0.5 * (u + turn) * chord_mm) * ray.d);
    let shown = shifted_cubic((*march).c, shift);
    if shift != (*march).shift {
        (*march).shift = shift;
        (*march).value = cubic(shown, u);
    }
    let value = (*march).value;
    let turn_value = cubic(shown, turn);
    var end = turn;
    var end_value = next_breakpoint(value, turn_value);
    if end_value != turn_value { end = crossing(shown, u, turn, value, turn_value, end_value); }
    let j = interval_at(0.5 * (value + end_value));
    var ends = ordinates_in(j, vec4<f32>(value, end_value, value, value));
    // Where opacity nears 1, its logarithm is too steep for the quadrature.
    for (var k = 0; k < SHORTENINGS; k++) {
        if !uneven(ends, (end - u) * chord_mm) { break; }
        // For a linear value this fraction changes the transmitted light by nearly the factor of 2. Where the value
        // begins flat the fraction is far too small, hence the lower limit; halving at least ends the loop.
        let twice = select(0.5, 1.0, ends.transmitted.y > ends.transmitted.x);
        let share = clamp(0.98 * twice * ends.transmitted.x / abs(ends.transmitted.y - ends.transmitted.x), 0.0625, 0.5);
        end = max(u + share * (end - u), min(u + LEAST_PIECE, end));
        end_value = cubic(shown, end);
        ends = ordinates_in(j, vec4<f32>(value, end_value, value, value));
    }

    // A chord of length h differs from T exp(-depth) by at most T h^2 (sigma^2 + dsigma/dz) / 8. The slope of a
    // stretch of the cubic is a parabola, which lies between its Bernstein coefficients.
    let sigmas = extinction_of(ends);
    let sigma = max(sigmas.x, sigmas.y);
    let slope_a = cubic_slope(shown, u);
    let steepness = max(
        max(abs(slope_a), abs(slope_a + (end - u) * (shown.z + 3.0 * u * shown.w))),
        abs(cubic_slope(shown, end)),
    );
    let rise = extinction_slope(j, min(ends.transmitted.x, ends.transmitted.y)) * steepness / chord_mm;
    return Stretch(shown, end, end_value, j, sqrt(sigma * sigma + rise) * chord_mm);
}

// Passes the next piece of a stretch to the sink; returns whether the ray ends.
fn take_piece(sink: ptr<function, Sink>, march: ptr<function, CellMarch>, stretch: Stretch) -> bool {
    let u = (*march).u;
    let chord_z = (*march).chord_z;
    let chord_mm = (*march).chord_mm;
    let reach = longest_depth(sink, chord_z + u * chord_mm, chord_z + stretch.end * chord_mm);
    let short_mm = SHORT_PIECE * field.min_spacing_mm;
    let parts = ceil((stretch.end - u) * min(stretch.bend / reach, chord_mm / short_mm));
    let piece_end = select(stretch.end, u + (stretch.end - u) / parts, parts > 1.0);
    let h = piece_end - u;
    let at = u + h * GAUSS_POINTS;
    let c = stretch.shown;
    let extinctions = extinction_in(stretch.j, c.x + at * (c.y + at * (c.z + at * c.w)));
#ifdef GRADIENT_OPACITY
    let f = (*march).chord_start;
    let e = (*march).chord_vector;
    let factors = gradient_factors((*march).values, f.x + at * e.x, f.y + at * e.y, f.z + at * e.z, (*march).sense);
    let mean = dot(GAUSS_WEIGHTS, extinctions * factors);
#else
    let mean = dot(GAUSS_WEIGHTS, extinctions);
#endif
    (*march).u = piece_end;
    (*march).pieces_left -= 1u;
    count_work(PIECES, 1u);
    return sink_piece(sink, chord_z + u * chord_mm, chord_z + piece_end * chord_mm, mean * h * chord_mm);
}

// Marches the ray o + z d (grid space, d per mm) over the depths [z_from, z_to].
fn march(sink: ptr<function, Sink>, o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) {
    let ray = ascending_ray(o, d, z_from, z_to);
    var state = start_cells(ray);
    // Number of pieces of the whole ray.
    var pieces = 0u;
#ifdef RAY_STATES
    state.missing = -1;
    if has_state() { pieces = resume_cells(&state); }
#endif
    var done = false;
    // Whether a cell or the ray exceeds its limit of pieces.
    var too_many = false;
#ifdef RAY_STATES
    too_many = (pieces & TOO_MANY) != 0u;
    pieces &= ~TOO_MANY;
#endif
    loop {
        var steps = 0u;
        loop {
            steps += 1u;
            if state.u >= 1.0 && state.marching { step_cell(&state, ray); }
#ifdef RAY_STATES
            if state.missing >= 0 { break; }
#endif
            if state.u < 1.0 || !state.marching || steps >= LIGHT_STEPS_TOGETHER { break; }
        }
        if state.u >= 1.0 {
#ifdef RAY_STATES
            if state.missing >= 0 { break; }
#endif
            if !state.marching {
                done = true;
                break;
            }
            continue;
        }
        let stretch = next_stretch(&state, ray);
        loop {
            done = take_piece(sink, &state, stretch);
            pieces += 1u;
            if done || state.u >= stretch.end || state.pieces_left == 0u { break; }
        }
        if done { break; }
        state.value = stretch.end_value;
        state.u = select(state.u, 1.0, state.u > 1.0 - LEAST_PIECE);
        if state.pieces_left == 0u || pieces > MAX_PIECES {
            too_many = true;
            state.u = 1.0;
        }
    }
#ifdef RAY_STATES
    if state.missing >= 0 {
        suspend_cells(state, pieces, too_many);
        return;
    }
    finish_ray();
#endif
    if !done || too_many || state.cells_left < 0 { report_iteration_limit(); }
}
