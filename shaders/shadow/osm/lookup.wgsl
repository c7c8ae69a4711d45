// `osm`: query of the transmittance in an opacity shadow map (Kim & Neumann 2001, 2).
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::tile_table::{record_of, wrapped_texel}
#import umbravox::taps::{TAPS, TAPS_ACROSS, taps_around, tap_at}
#import umbravox::layers::params
#import umbravox::layers_read::layer_point
#ifdef CUBIC
#import umbravox::cubic_layers::{cubic_point, cubic_depth_at as optical_depth_at}
#else
#import umbravox::layers_read::optical_depth_at
#endif

// Distance from the centres of the outermost texels up to which a query reads them, in texels: half an odd number of
// texels.
const MARGIN: f32 = f32((TAPS_ACROSS + 1u) / 2u) - 0.5;

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    // Nothing with extinction lies outside the map.
    let last = f32(light.map_size) - 1.0 + MARGIN;
    // Nothing with extinction lies in front of the map's depth range, where the position of a point light has no
    // texel.
    if p.z <= light.depth_start_mm { return 1.0; }
    if !(all(p.texel >= vec2<f32>(-MARGIN)) && all(p.texel <= vec2<f32>(last))) { return 1.0; }
    // All texels share the same planes.
    let layer = layer_point(0u, light.depth_start_mm, light.depth_start_mm + params.reach_mm, p.z);
#ifdef CUBIC
    let point = cubic_point(layer);
#else
    let point = layer;
#endif
    let taps = taps_around(p.texel);
    var sum = 0.0;
    var i = 0u;
    loop {
        let tap = tap_at(taps, i);
        let depth = optical_depth_at(record_of(wrapped_texel(tap.texel)), point);
#ifdef AVERAGE_TRANSMITTANCE
        sum += tap.weight * exp(-depth);
#else
        sum += tap.weight * depth;
#endif
        i += 1u;
        if i >= TAPS { break; }
    }
#ifdef AVERAGE_TRANSMITTANCE
    return sum;
#else
    return exp(-sum);
#endif
}
