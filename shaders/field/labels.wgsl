// Segmentation labels: shifts of volume values, so that each label has its own transfer function. Without LABELS
// every function here is the identity.
//
// A point has the label of its nearest voxel. The transfer functions of labels lie side by side on one axis of
// values. The shift of a label moves a value of the volume to the function of that label, or behind all functions if
// the label is hidden.
#define_import_path umbravox::labels

#import umbravox::field::{field, value_at, voxel_texel, FAR}
#import umbravox::work::{count_work, LOADS}

// Section of a ray whose nearest voxels all have the same label.
struct LabelStretch {
    // Depth at which the section ends, mm.
    end: f32,
    // Whether another label follows before the depth at which the search ended.
    cut: bool,
    shift: f32,
}

#ifdef LABELS
// Index of each voxel's label among all labels that occur.
@group(0) @binding(9) var label_ranks: texture_3d<u32>;
// Shift added to the volume's values for each label, by the label's index, four in a vector; HIDDEN_SHIFT for hidden
// labels.
@group(0) @binding(10) var<uniform> label_shifts: array<vec4<f32>, #{LABEL_VECTORS}>;
const HIDDEN_SHIFT: f32 = #{HIDDEN_SHIFT};
// Marks a shift that is not yet known; it differs from the shift of every label.
const UNKNOWN_SHIFT: f32 = -FAR;
// Factor on the largest number of stretches of a cell's chord: with labels the chord is also cut where the label
// changes.
const CUTS_BY_LABEL: u32 = 2u;
// Largest number of planes half-way between voxels that one step may pass.
const MAX_PLANES: u32 = 64u;
// Distance past a plane between two labels at which the next plane is searched, in voxels.
const PAST_PLANE: f32 = 1e-3;

// Returns the shift of values for the label at a grid-space point.
fn label_shift(g: vec3<f32>) -> f32 {
    count_work(LOADS, 1u);
    let voxel = clamp(vec3<i32>(floor(g - 0.5)), vec3<i32>(0), vec3<i32>(field.size) - 1);
    let rank = textureLoad(label_ranks, voxel_texel(voxel), 0).x;
    return label_shifts[rank >> 2u][rank & 3u];
}

fn is_hidden(shift: f32) -> bool {
    return shift >= HIDDEN_SHIFT;
}

fn shifted_value(value: f32, shift: f32) -> f32 {
    return select(value + shift, field.hidden_value, is_hidden(shift));
}

// Adds a label's shift to a cubic of values, given by its coefficients.
fn shifted_cubic(c: vec4<f32>, shift: f32) -> vec4<f32> {
    return select(vec4<f32>(c.x + shift, c.yzw), vec4<f32>(field.hidden_value, 0.0, 0.0, 0.0), is_hidden(shift));
}

// Returns the value unchanged: with labels, the values with extinction do not form a single range.
fn clamped_value(value: f32) -> f32 {
    return value;
}

// Parameters in (0, 1) at which the chord of a cell from f to f + e (cell coordinates in [0, 1]) crosses the plane
// half-way between two voxels, for each axis; 2 if it does not cross.
fn label_borders(f: vec3<f32>, e: vec3<f32>) -> vec3<f32> {
    let halves = (0.5 - f) / select(e, vec3<f32>(1.0), e == vec3<f32>(0.0));
    let inside = (e != vec3<f32>(0.0)) & (halves > vec3<f32>(0.0)) & (halves < vec3<f32>(1.0));
    return select(vec3<f32>(2.0), halves, inside);
}

// Returns the first label border after u, at most `end`.
fn next_label_border(borders: vec3<f32>, u: f32, end: f32) -> f32 {
    let ahead = select(vec3<f32>(1.0), borders, borders > vec3<f32>(u));
    return min(end, min(ahead.x, min(ahead.y, ahead.z)));
}

// Returns the lattice coordinate of the sample after k. Samples where a label ends do not lie on the lattice.
fn next_sample(k: f32) -> f32 {
    return floor(k) + 1.0;
}

// Returns the largest number of parts into which label borders may cut a step of `step_mm`, plus one: up to three for
// each voxel.
fn parts_of_step(step_mm: f32) -> u32 {
    return 4u + 3u * u32(ceil(clamp(step_mm / field.min_spacing_mm, 1.0, 64.0)));
}

// Returns the first depth past `t` at which the ray o + t d crosses a plane half-way between two voxels.
fn next_plane(o: vec3<f32>, d: vec3<f32>, inv_d: vec3<f32>, t: f32) -> f32 {
    let forward = d > vec3<f32>(0.0);
    let h = o + t * d - 0.5;
    let planes = select(ceil(h - PAST_PLANE) - 1.0, floor(h + PAST_PLANE) + 1.0, forward);
    let exits = select(vec3<f32>(FAR), t + (planes - h) * inv_d, abs(d) >= vec3<f32>(1e-20));
    return min(exits.x, min(exits.y, exits.z));
}

// Returns the section of the ray o + t d with one label that begins at depth `start` and ends at `end` at the latest.
fn label_stretch(o: vec3<f32>, d: vec3<f32>, inv_d: vec3<f32>, start: f32, end: f32) -> LabelStretch {
    var plane = next_plane(o, d, inv_d, start);
    let shift = label_shift(o + 0.5 * (start + min(plane, end)) * d);
    var cut = false;
    var planes_left = MAX_PLANES;
    loop {
        let beyond = next_plane(o, d, inv_d, plane);
        cut = plane < end && shift != label_shift(o + 0.5 * (plane + min(beyond, end)) * d);
        planes_left -= 1u;
        if cut || plane >= end || planes_left == 0u { break; }
        plane = beyond;
    }
    return LabelStretch(select(end, plane, cut), cut, shift);
}
#else
const UNKNOWN_SHIFT: f32 = 0.0;
const CUTS_BY_LABEL: u32 = 1u;

fn label_shift(g: vec3<f32>) -> f32 {
    return 0.0;
}

fn is_hidden(shift: f32) -> bool {
    return false;
}

fn shifted_value(value: f32, shift: f32) -> f32 {
    return value;
}

fn shifted_cubic(c: vec4<f32>, shift: f32) -> vec4<f32> {
    return c;
}

fn clamped_value(value: f32) -> f32 {
    return clamp(value, field.first_value, field.last_value);
}

fn label_borders(f: vec3<f32>, e: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(2.0);
}

fn next_label_border(borders: vec3<f32>, u: f32, end: f32) -> f32 {
    return end;
}

// Samples at surfaces do not lie on the lattice.
fn next_sample(k: f32) -> f32 {
    return floor(k) + 1.0;
}

fn parts_of_step(step_mm: f32) -> u32 {
    return 1u;
}

fn label_stretch(o: vec3<f32>, d: vec3<f32>, inv_d: vec3<f32>, start: f32, end: f32) -> LabelStretch {
    return LabelStretch(end, false, 0.0);
}
#endif

// Returns the volume value at a grid-space point inside the domain, shifted for the point's label.
fn labeled_value_at(g: vec3<f32>) -> f32 {
    return shifted_value(value_at(g), label_shift(g));
}
