// A walk along a line by regular samples, with leaps over bricks without extinction: eye rays, and light rays marched by
// samples.
//
// Samples sit on the lattice k step, whatever is skipped, and on the ends of the domain. Between two of them lies a
// stretch; only those that have extinction are found.
//
// Loops here and in what walks end at their last line: software adapters take the body of a loop once more for an exit at
// its start.
#define_import_path umbravox::walk

#ifdef LABELS
#import umbravox::labels::{shift_at, is_hidden, seen_with}
#endif
#import umbravox::field::{field, value_at, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}

struct Line {
    // Grid space: the point of depth 0 and the way per mm.
    o: vec3<f32>,
    d: vec3<f32>,
    inv_d: vec3<f32>,
    // Depths at which samples end the lattice, mm, and between which they are taken.
    t_in: f32,
    t_out: f32,
    start: f32,
    end: f32,
    step_mm: f32,
}

struct Walk {
    // The sample behind, and its value where there is one (`valid`).
    k: f32,
    value: f32,
    valid: bool,
    // It may lie in a brick with extinction.
    occupied: bool,
    walking: bool,
    // A stretch with extinction has been found: what is not taken yet of it goes from `from_t` to the sample behind.
    found: bool,
    from_t: f32,
    from_value: f32,
    // Turns that all loops of the line may still take.
    turns_left: u32,
#ifdef LABELS
    // The volume's own value at the sample behind: `value` and `from_value` are as they are seen in the stretch.
    raw: f32,
#endif
}

// Float32 counts no further one by one.
const MOST_SAMPLES: f32 = 16777216.0;

// The line o + t d from `first` to `last` (mm) through the domain.
fn line_through(o: vec3<f32>, d: vec3<f32>, first: f32, last: f32, step_mm: f32) -> Line {
    let inv_d = safe_inverse(d);
    let domain = clipped_span(o, d, box_span(o, inv_d, d, vec3<f32>(0.5), vec3<f32>(field.size) + 0.5));
    let t_in = max(domain.x, first);
    let t_out = min(domain.y, last);
#ifdef SKIP_BRICKS
    let occupied = box_span(o, inv_d, d, field.active_lo, field.active_hi);
    return Line(o, d, inv_d, t_in, t_out, max(occupied.x, t_in), min(occupied.y, t_out), step_mm);
#else
    return Line(o, d, inv_d, t_in, t_out, t_in, t_out, step_mm);
#endif
}

// A walk whose loops take so many turns a sample at most.
fn start_walk(line: Line, turns_a_sample: u32) -> Walk {
    let samples = u32(clamp((line.end - line.start) / line.step_mm, 0.0, MOST_SAMPLES)) + 2u;
    // A leap takes a turn, and one more to sample where it ends.
    let leaps = 3u * (field.size.x + field.size.y + field.size.z);
    let k = floor(line.start / line.step_mm);
#ifdef LABELS
    // Where labels meet, the line is cut as often as it passes half-way between voxels, which is up to three times a voxel.
    let cuts = 3u * u32(ceil(clamp(line.step_mm / field.min_spacing_mm, 1.0, 64.0))) + 3u;
    let turns = (1u + cuts) * samples * turns_a_sample + leaps;
    return Walk(k, 0.0, false, true, line.start < line.end, false, 0.0, 0.0, turns, 0.0);
#else
    let turns = samples * turns_a_sample + leaps;
    return Walk(k, 0.0, false, true, line.start < line.end, false, 0.0, 0.0, turns);
#endif
}

// Depth of a sample, mm.
fn sample_depth(line: Line, k: f32) -> f32 {
    return clamp(k * line.step_mm, line.t_in, line.t_out);
}

// Counts a turn of a loop; the walk ends where there have been more than it can need (`exhausted`).
fn count_turn(walk: ptr<function, Walk>) {
    (*walk).turns_left -= min((*walk).turns_left, 1u);
    let more = (*walk).turns_left > 0u;
    (*walk).walking = (*walk).walking && more;
    (*walk).found = (*walk).found && more;
}

fn exhausted(walk: Walk) -> bool {
    return walk.turns_left == 0u;
}

#ifdef SKIP_BRICKS
fn brick_at(line: Line, t: f32) -> vec3<i32> {
    return clamp(vec3<i32>(floor(line.o + t * line.d)), vec3<i32>(0), vec3<i32>(field.size)) >> BRICK_SHIFT;
}
#endif

#ifdef LABELS
// Planes half-way between voxels that a step may pass.
const MOST_PLANES: u32 = 64u;
// A hair past a plane between two labels, in voxels.
const PAST_PLANE: f32 = 1e-3;

// The first depth past `t` at which the line passes half-way between two voxels on some axis.
fn next_plane(line: Line, t: f32) -> f32 {
    let forward = line.d > vec3<f32>(0.0);
    let h = line.o + t * line.d - 0.5;
    let planes = select(ceil(h - PAST_PLANE) - 1.0, floor(h + PAST_PLANE) + 1.0, forward);
    let exits = select(vec3<f32>(FAR), t + (planes - h) * line.inv_d, abs(line.d) >= vec3<f32>(1e-20));
    return min(exits.x, min(exits.y, exits.z));
}
#endif

// Takes a sample, or a leap.
fn take_turn(walk: ptr<function, Walk>, line: Line) {
    let behind = sample_depth(line, (*walk).k);
#ifdef LABELS
    // A sample may lie off the lattice, where one label ends: from there to the next plane or sample lies what follows.
    let next = floor((*walk).k) + 1.0;
    var plane = next_plane(line, behind);
    let to_next = sample_depth(line, next);
    let shift = shift_at(line.o + 0.5 * (behind + min(plane, to_next)) * line.d);
    // The first plane behind which there is another label.
    var cut = false;
    var planes_left = MOST_PLANES;
    loop {
        let beyond = next_plane(line, plane);
        cut = plane < to_next && shift != shift_at(line.o + 0.5 * (plane + min(beyond, to_next)) * line.d);
        planes_left -= 1u;
        if cut || plane >= to_next || planes_left == 0u { break; }
        plane = beyond;
    }
    let ahead = select(to_next, plane, cut);
#else
    let ahead = sample_depth(line, (*walk).k + 1.0);
#endif
    var leaps = false;
    var occupied = true;
#ifdef LABELS
    var k = select(next, plane / line.step_mm, cut);
#else
    var k = (*walk).k + 1.0;
#endif
#ifdef SKIP_BRICKS
    let brick = brick_at(line, ahead);
    let distance = brick_distance_at(brick);
    occupied = distance == 0;
    // A stretch between two inactive bricks is empty where they touch, and so share a value, and where all is empty between
    // them; a long step may pass an active one.
    let apart = abs(brick - brick_at(line, behind));
    let joined = max(apart.x, max(apart.y, apart.z)) <= max(distance - 1, 1);
    leaps = !occupied && !(*walk).occupied && joined;
    // To the last sample in the cube of empty bricks around this one.
    let forward = line.d > vec3<f32>(0.0);
    let face = select((brick - (distance - 1)) * BRICK_CELLS, (brick + distance) * BRICK_CELLS, forward);
    let moves = abs(line.d) >= vec3<f32>(1e-20);
    let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - line.o) * line.inv_d, moves);
    // Rounding may put the last face before the sample, which has passed it.
    k = select(k, max(floor(min(exits.x, min(exits.y, exits.z)) / line.step_mm), k), leaps);
#endif
    let value = value_at(line.o + select(behind, ahead, (*walk).valid) * line.d);
#ifdef LABELS
    let last = (*walk).raw;
#else
    let last = (*walk).value;
#endif
    let taken = (*walk).valid && !leaps;
    (*walk).found = taken && min(last, value) < field.last_value && max(last, value) > field.first_value;
    (*walk).from_t = behind;
#ifdef LABELS
    (*walk).found = (*walk).found && !is_hidden(shift);
    (*walk).from_value = seen_with(last, shift);
    (*walk).raw = value;
    (*walk).value = seen_with(value, shift);
#else
    (*walk).from_value = last;
    (*walk).value = value;
#endif
    // After a leap the sample behind has no value yet: it takes the next turn.
    let moves_on = taken || leaps;
    (*walk).k = select((*walk).k, k, moves_on);
    (*walk).occupied = select((*walk).occupied, occupied, moves_on);
    (*walk).valid = !leaps;
    (*walk).walking = !moves_on || sample_depth(line, k) < line.end;
}

// Turns after which lanes that have found something do not wait for the others (best of 2, 4 and no limit on llvmpipe).
const WALK_TURNS: u32 = 4u;

// Walks until a stretch with extinction lies behind, or the line ends, or for some turns.
fn walk_on(walk: ptr<function, Walk>, line: Line) {
    var turns = 0u;
    loop {
        turns += 1u;
        if (*walk).walking && !(*walk).found {
            take_turn(walk, line);
            count_turn(walk);
        }
        if (*walk).found || !(*walk).walking || turns >= WALK_TURNS { break; }
    }
}
