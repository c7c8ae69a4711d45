// Depth range of a series along one light ray: that of the map or, with TEXEL_RANGE, that of the matter of the texel,
// which a first march finds.
#define_import_path umbravox::series_range

#import umbravox::light::light
#ifdef RAY_STATES
#import umbravox::ray_state::{put_word, put_float, take_word, take_float}
#endif

// Start and length of the range, mm.
var<private> range_start: f32;
var<private> range_mm: f32;
#ifdef TEXEL_RANGE
var<private> finding_range: bool;
var<private> range_end: f32;
// Shortest depth range of a texel's series, mm, as for a ray that meets a single face.
const LEAST_RANGE: f32 = 1e-3;
#endif

// Prepares the range for a march. Returns whether the march finds the range.
fn start_range(march: u32) -> bool {
#ifdef TEXEL_RANGE
    finding_range = march == 0u;
    range_mm = max(range_end - range_start, LEAST_RANGE);
    return finding_range;
#else
    range_start = light.depth_start_mm;
    range_mm = light.depth_range_mm;
    return false;
#endif
}

// Extends the range by a piece of matter if this march finds it. Returns whether it does.
fn extend_range(z_from: f32, z_end: f32, is_first: bool) -> bool {
#ifdef TEXEL_RANGE
    range_start = select(range_start, z_from, finding_range && is_first);
    range_end = select(range_end, z_end, finding_range);
    return finding_range;
#else
    return false;
#endif
}

// Returns start and length of the range, as fractions of the map's range.
fn stored_range() -> vec2<f32> {
    return vec2<f32>(range_start - light.depth_start_mm, range_mm) / light.depth_range_mm;
}

#ifdef RAY_STATES
// Stores the range of a ray that waits: four words.
fn save_range() {
    put_float(range_start);
    put_float(range_mm);
#ifdef TEXEL_RANGE
    put_float(range_end);
    put_word(select(0u, 1u, finding_range));
#endif
}

fn load_range() {
    range_start = take_float();
    range_mm = take_float();
#ifdef TEXEL_RANGE
    range_end = take_float();
    finding_range = take_word() == 1u;
#endif
}
#endif
