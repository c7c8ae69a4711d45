// Bound on the transmittance of a scene's shadows: the last voxels towards the light are marched cell by cell, and the
// enclosing curve of a texel answers beyond them. UPPER gives the upper bound, otherwise it is the lower one.
//
// Both widen the answer by the errors of the march and of the stored curve: the query by the depth offset of the map,
// the march by the same length at its ends, and the transmittances by their error bounds.
#define_import_path umbravox::shadow

#import umbravox::method::transmittance as method_transmittance
#import umbravox::light::{light, toward_light}
#import umbravox::dsm_layout::params
#import umbravox::march::march
#import umbravox::sink::start_sink

// Error bound of the transmittance of a march.
const MARCH_ERROR: f32 = #{MARCH_ERROR};

fn widened(t: f32, error: f32) -> f32 {
#ifdef UPPER
    return min(t + error, 1.0);
#else
    return max(t - error, 0.0);
#endif
}

// Returns the bound on the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let to_light = toward_light(g);
    let near_mm = min(light.near_mm, to_light.mm);
    var sink = start_sink();
    march(&sink, g, to_light.d, -params.depth_offset_mm, near_mm + params.depth_offset_mm);
    let marched = widened(exp(-sink.optical_depth.total), MARCH_ERROR);
    // The map is not needed if the march reaches the light.
    if near_mm >= to_light.mm { return marched; }
    return marched * widened(method_transmittance(g + near_mm * to_light.d), params.transmittance_error);
}
