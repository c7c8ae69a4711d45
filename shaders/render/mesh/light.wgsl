// Light at a point among opaque triangles: what the method says of the volume, and none behind a triangle.
#define_import_path umbravox::mesh_light

#import umbravox::field::{field, safe_inverse, box_span}
#import umbravox::light::toward_light
#import umbravox::mesh::{mesh_hit, NO_TRIANGLE}
#import umbravox::method::transmittance

// Nearer than this towards the light, in smallest voxel spacings, is the surface that a point lies on.
const SURFACE_GAP: f32 = #{SURFACE_GAP};
// What float32 makes of positions, as a share of a coordinate.
const POSITION_ROUNDING: f32 = 1e-6;

// Transmittance from the light to a grid-space point, which may lie outside of the domain.
fn light_at(g: vec3<f32>) -> f32 {
    let way = toward_light(g);
    let d = way.d;
    let far = way.mm;
    let gap = SURFACE_GAP + POSITION_ROUNDING * max(abs(g.x), max(abs(g.y), abs(g.z)));
    let hidden = mesh_hit(g, d, gap * field.min_spacing_mm, far, true).triangle != NO_TRIANGLE;
    // Outside of all that has extinction as much arrives as where the way to the light first meets its box.
    let span = box_span(g, safe_inverse(d), d, field.active_lo, field.active_hi);
    let enters = max(span.x, 0.0);
    let meets = enters <= min(span.y, far);
    let left = transmittance(g + select(0.0, enters, meets) * d);
    return select(select(1.0, left, meets), 0.0, hidden);
}
