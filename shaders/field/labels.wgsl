// Labels of a segmentation: what voxels of some of them are seen through. Without LABELS every value is seen as it is.
//
// A place has the label of the nearest voxel. Functions of labels lie side by side on one axis of values: a value as it is
// seen is one that has been shifted to its label's function, or one behind all of them where the label is hidden.
#define_import_path umbravox::labels

#import umbravox::field::{field, value_at}
#ifdef FOLDED
#import umbravox::field::tile_offset
#endif
#import umbravox::work::{count_work, LOADS}

#ifdef LABELS
// The place of a voxel's label among all that occur.
@group(0) @binding(9) var label_ranks: texture_3d<u32>;
// What is added to a texel value for each of them, four in a vector; HIDDEN_SHIFT where it has no extinction.
@group(0) @binding(10) var<uniform> label_shifts: array<vec4<f32>, #{LABEL_VECTORS}>;
const HIDDEN_SHIFT: f32 = #{HIDDEN_SHIFT};

// The shift of values at a grid-space point.
fn shift_at(g: vec3<f32>) -> f32 {
    count_work(LOADS, 1u);
    let voxel = clamp(vec3<i32>(floor(g - 0.5)), vec3<i32>(0), vec3<i32>(field.size) - 1);
#ifdef FOLDED
    let rank = textureLoad(label_ranks, voxel + tile_offset(voxel), 0).x;
#else
    let rank = textureLoad(label_ranks, voxel, 0).x;
#endif
    return label_shifts[rank >> 2u][rank & 3u];
}

fn is_hidden(shift: f32) -> bool {
    return shift >= HIDDEN_SHIFT;
}

// A value as it is seen with a shift.
fn seen_with(value: f32, shift: f32) -> f32 {
    return select(value + shift, field.hidden_value, is_hidden(shift));
}
#endif

// The value at a grid-space point inside the domain, as it is seen.
fn seen_value_at(g: vec3<f32>) -> f32 {
#ifdef LABELS
    return seen_with(value_at(g), shift_at(g));
#else
    return value_at(g);
#endif
}
