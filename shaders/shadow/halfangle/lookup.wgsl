// `halfangle`: transmittance between the two slices that the light buffers hold.
#define_import_path umbravox::method

#import umbravox::light::{light, light_point}
#import umbravox::tile_table::{record_of, wrapped_texel, NO_TILE}
#import umbravox::taps::{TAPS, TAPS_ACROSS, taps_around, tap_at}
#import umbravox::section::{section, section_coordinate}

// Optical depths at the slice in front of the section and at the one behind it.
@group(1) @binding(3) var<storage, read> in_front: array<f32>;
@group(1) @binding(4) var<storage, read> behind: array<f32>;

// Distance from the centres of the outermost texels up to which a query reads them, in texels.
const EDGE_TEXELS: f32 = f32((TAPS_ACROSS + 1u) / 2u) - 0.5;

// Returns the optical depth of a texel at a share of the distance between the two slices.
fn optical_depth_at(record: u32, share: f32) -> f32 {
    let at = min(record, arrayLength(&in_front) - 1u);
    // The buffer is undefined in front of the first slice.
    let first = select(in_front[at], 0.0, section.is_first == 1u);
#ifdef CONSTANT
    let depth = first;
#else
    let depth = max(mix(first, behind[at], share), 0.0);
#endif
    return select(depth, 0.0, record == NO_TILE);
}

// Returns the transmittance from the light to a grid-space point of the section.
fn transmittance(g: vec3<f32>) -> f32 {
    let p = light_point(g);
    let last = f32(light.map_size) - 1.0 + EDGE_TEXELS;
    // Nothing with extinction lies in front of the map's depth range, or outside the map.
    if p.z <= light.depth_start_mm { return 1.0; }
    if !(all(p.texel >= vec2<f32>(-EDGE_TEXELS)) && all(p.texel <= vec2<f32>(last))) { return 1.0; }
    // A segment of an eye ray may end outside the section: its optical depth goes on with the same slope.
    let share = (section_coordinate(g) - section.start) / (section.end - section.start);
    let taps = taps_around(p.texel);
    var sum = 0.0;
    var i = 0u;
    loop {
        let tap = tap_at(taps, i);
        sum += tap.weight * exp(-optical_depth_at(record_of(wrapped_texel(tap.texel)), share));
        i += 1u;
        if i >= TAPS { break; }
    }
    return sum;
}
