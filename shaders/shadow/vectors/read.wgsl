// Reads a shadow map that stores several vectors in each texel.
#define_import_path umbravox::vectors_read

#import umbravox::light::{light, LightPoint}
#import umbravox::work::{count_work, LOADS}
#import umbravox::tile_table::{TILE, NO_TILE}
#import umbravox::vectors::{vector_map, TILE_MARGIN, TILE_SIDE, tile_corner, first_record}
#import umbravox::taps::{TAPS, taps_around, tap_at}

#ifdef WORDS
@group(1) @binding(3) var atlas: texture_2d<u32>;
#else
@group(1) @binding(3) var atlas: texture_2d<f32>;
#endif
#ifdef HARDWARE_FILTER
@group(1) @binding(4) var linear: sampler;
#endif

// Position in the first plane of the atlas, in texel coordinates with centres at integers.
struct AtlasPoint {
    texel: vec2<f32>,
    // Whether the transmittance is 1 because nothing is stored there.
    lit: bool,
}

// Returns the atlas position of a point in light space.
fn atlas_point(p: LightPoint) -> AtlasPoint {
    let last = f32(light.map_size) - 0.5;
    // Nothing with extinction lies outside the map, or in front of its range of depths.
    var lit = p.z <= light.depth_start_mm;
    lit = lit || !(all(p.texel >= vec2<f32>(-0.5)) && all(p.texel <= vec2<f32>(last)));
    let inside = clamp(p.texel, vec2<f32>(0.0), vec2<f32>(last - 0.5));
    let tile = vec2<u32>(round(inside)) / TILE;
    let first = first_record(tile);
    lit = lit || first == NO_TILE;
    let corner = tile_corner(select(first, 0u, first == NO_TILE));
    return AtlasPoint(vec2<f32>(corner) + f32(TILE_MARGIN) + (p.texel - vec2<f32>(tile * TILE)), lit);
}

#ifdef WORDS
// Returns vector v of a texel as raw 32-bit words.
fn words_at(texel: vec2<u32>, v: u32) -> vec4<u32> {
    count_work(LOADS, 1u);
    return textureLoad(atlas, texel + vec2<u32>(0u, v * TILE_SIDE), 0);
}
#else
// Returns vector v of a texel.
fn vector_at(texel: vec2<u32>, v: u32) -> vec4<f32> {
    count_work(LOADS, 1u);
    return textureLoad(atlas, texel + vec2<u32>(0u, v * TILE_SIDE), 0);
}

// Returns vector v at an atlas position: filtered over the neighbouring texels, or that of the texel.
fn filtered_vector(place: vec2<f32>, v: u32) -> vec4<f32> {
#ifdef HARDWARE_FILTER
    count_work(LOADS, 1u);
    let down = vec2<f32>(0.0, f32(v * TILE_SIDE));
    return textureSampleLevel(atlas, linear, (place + down + 0.5) * vector_map.inv_size, 0.0);
#else
#ifdef AVERAGE_VECTORS
#ifdef FILTER_BILINEAR
    let base = floor(place);
    let w = place - base;
    let at = vec2<u32>(base);
    let near = mix(vector_at(at, v), vector_at(at + vec2<u32>(1u, 0u), v), w.x);
    let far = mix(vector_at(at + vec2<u32>(0u, 1u), v), vector_at(at + vec2<u32>(1u, 1u), v), w.x);
    return mix(near, far, w.y);
#else
    let taps = taps_around(place);
    var sum = vec4<f32>(0.0);
    for (var i = 0u; i < TAPS; i++) {
        let tap = tap_at(taps, i);
        sum += tap.weight * vector_at(vec2<u32>(tap.texel), v);
    }
    return sum;
#endif
#else
    return vector_at(vec2<u32>(place), v);
#endif
#endif
}
#endif
