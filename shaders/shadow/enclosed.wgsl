// Bound on the transmittance of a scene's shadows: the last voxels towards the light are marched cell by cell, and the
// enclosing curve of a texel answers beyond them. LOWER gives the lower bound, UPPER the upper one.
//
// The march and the query are displaced by the depth offset of the map, and both transmittances are widened by their
// error bounds.
#define_import_path umbravox::shadow

#import umbravox::method::bounding_transmittance
#import umbravox::light::{light, toward_light}
#import umbravox::dsm_layout::params
#import umbravox::march::march
#import umbravox::sink::start_sink

// Error bound of the transmittance of a march.
const MARCH_ERROR: f32 = #{MARCH_ERROR};

// Returns the bound on the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let to_light = toward_light(g);
    let near_mm = min(light.near_mm, to_light.mm);
    var sink = start_sink();
    march(&sink, g, to_light.d, -params.depth_offset_mm, near_mm + params.depth_offset_mm);
    let total = sink.optical_depth.total;
    // A march that meets no matter has no error.
    let error = select(MARCH_ERROR, 0.0, total == 0.0);
#ifdef LOWER
    let marched = max(exp(-total) - error, 0.0);
#else
    let marched = min(exp(-total) + error, 1.0);
#endif
    // The map is not needed if the march reaches the light.
    if near_mm >= to_light.mm { return marched; }
    return marched * bounding_transmittance(g + near_mm * to_light.d);
}
