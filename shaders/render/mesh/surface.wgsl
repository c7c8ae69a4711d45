// Opaque surface at which an eye ray ends.
#define_import_path umbravox::surface

#import umbravox::frame::frame
#import umbravox::light::toward_light
#import umbravox::mesh::{mesh_hit, mesh_normal, mesh_color, NO_TRIANGLE}
#import umbravox::field::FAR

struct Surface {
    // Depth of the surface on the eye ray, mm; FAR if there is none.
    z: f32,
    // Cosine between the light and the normal of the visible side; 0 if the light is on the other side.
    cosine: f32,
    // Colour of the surface, linear RGB.
    color: vec3<f32>,
    met: bool,
}

// Returns the first surface on the ray o + z d (grid space) behind the depth of the eye.
fn surface_along(o: vec3<f32>, d: vec3<f32>, eye_mm: f32) -> Surface {
    let hit = mesh_hit(o, d, eye_mm, FAR, false);
    let met = hit.triangle != NO_TRIANGLE;
    let triangle = select(0u, hit.triangle, met);
    let to_world = mat3x3<f32>(frame.world_x, frame.world_y, frame.world_z);
    let normal = mesh_normal(triangle);
    let visible = select(normal, -normal, dot(normal, to_world * d) > 0.0);
    let toward = normalize(to_world * toward_light(o + hit.z * d).d);
    return Surface(hit.z, max(dot(visible, toward), 0.0), mesh_color(triangle), met);
}
