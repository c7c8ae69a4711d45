// Transmittance from the light in a scene with opaque triangles: that of the shadow method, and 0 behind a triangle.
#define_import_path umbravox::mesh_light

#import umbravox::field::{field, safe_inverse, box_span}
#import umbravox::light::toward_light
#import umbravox::mesh::{mesh_hit, NO_TRIANGLE}
#import umbravox::shadow::transmittance

// Distance towards the light, in smallest voxel spacings, within which a triangle counts as the surface on which the
// point lies.
const SURFACE_GAP: f32 = #{SURFACE_GAP};
// Relative rounding error of positions in float32.
const POSITION_ROUNDING: f32 = 1e-6;

// Returns the transmittance from the light to a grid-space point, which may lie outside the domain.
fn light_at(g: vec3<f32>) -> f32 {
    let to_light = toward_light(g);
    let d = to_light.d;
    let far = to_light.mm;
    let gap = SURFACE_GAP + POSITION_ROUNDING * max(abs(g.x), max(abs(g.y), abs(g.z)));
    let hidden = mesh_hit(g, d, gap * field.min_spacing_mm, far, true).triangle != NO_TRIANGLE;
    // Outside the box of the active bricks, the transmittance equals that at the first point of the box towards the
    // light.
    let span = box_span(g, safe_inverse(d), d, field.active_lo, field.active_hi);
    let enters = max(span.x, 0.0);
    let meets = enters <= min(span.y, far);
    let left = transmittance(g + select(0.0, enters, meets) * d);
    return select(select(1.0, left, meets), 0.0, hidden);
}
