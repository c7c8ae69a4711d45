// Alignment of the four texels around a point at the depths where their matter begins (`align=on`). On a slanted
// surface these depths differ between texels; averaged as they are, the surface would shadow itself.
#define_import_path umbravox::align

#import umbravox::light::light

// Largest difference of first depths for which neighbouring texels show one surface, in widths of a texel.
const STEEPEST_SURFACE: f32 = #{STEEPEST_SURFACE};

// Depth in place of the first one where a texel has no matter, mm.
const NO_DEPTH: f32 = 1e30;

// Shifts of depth that align four texels.
struct Alignment {
    // Depth (mm) that is added to the depth of a point in each texel.
    shift: vec4<f32>,
    // Largest shift (mm) for any weights of the texels.
    most: f32,
}

// Aligns four texels at a point of depth z (mm). `first` are the depths (mm) where their matter begins; texels that
// are not `filled` have none.
fn alignment(first: vec4<f32>, filled: vec4<bool>, weights: vec4<f32>, z: f32) -> Alignment {
    let same_surface = STEEPEST_SURFACE * light.texel_mm;
    let nearest = select(vec4<f32>(1e30), first, filled);
    let farthest = select(vec4<f32>(-1e30), first, filled);
    let spread = max(max(farthest.x, farthest.y), max(farthest.z, farthest.w))
        - min(min(nearest.x, nearest.y), min(nearest.z, nearest.w));
    let share = select(vec4<f32>(0.0), weights, filled);
    let known = select(vec4<f32>(0.0), first, filled);
    let here = dot(share, known) / max(dot(share, vec4<f32>(1.0)), 1e-6);
    // The alignment fades with depth, so slowly that depths keep their order.
    let fade = clamp(1.0 - (z - here) / (4.0 * same_surface), 0.0, 1.0);
    // Without a filled texel the spread is negative.
    let is_surface = spread >= 0.0 && spread < same_surface;
    let shift = select(vec4<f32>(0.0), (known - here) * fade, filled & vec4<bool>(is_surface));
    return Alignment(shift, select(0.0, spread * fade, is_surface));
}
