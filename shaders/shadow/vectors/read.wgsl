// Reading a map of vectors.
#define_import_path umbravox::vectors_read

#import umbravox::light::{light, LightPoint}
#import umbravox::work::{count_work, LOADS}
#import umbravox::tile_table::{TILE, NO_TILE}
#import umbravox::vectors::{own, VECTORS, TILE_SIDE, tile_corner, first_record}

#ifdef WORDS
@group(1) @binding(3) var atlas: texture_2d<u32>;
#else
@group(1) @binding(3) var atlas: texture_2d<f32>;
#endif
#ifdef HARDWARE_FILTER
@group(1) @binding(4) var linear: sampler;
#endif

// A place of the atlas: texel coordinates of the first plane, centres at whole numbers.
struct Place {
    texel: vec2<f32>,
    // False where nothing is stored: all light arrives.
    lit: bool,
}

// Where the texels around a point of light space lie.
fn place_of(p: LightPoint) -> Place {
    let last = f32(light.map_size) - 0.5;
    // Nothing with extinction lies between the light and what its map does not cover, nor in front of its range.
    var lit = p.z <= light.depth_start_mm;
    lit = lit || !(all(p.texel >= vec2<f32>(-0.5)) && all(p.texel <= vec2<f32>(last)));
    let inside = clamp(p.texel, vec2<f32>(0.0), vec2<f32>(last - 0.5));
    let tile = vec2<u32>(round(inside)) / TILE;
    let first = first_record(tile);
    lit = lit || first == NO_TILE;
    let corner = tile_corner(select(first, 0u, first == NO_TILE));
    return Place(vec2<f32>(corner) + 1.0 + (p.texel - vec2<f32>(tile * TILE)), lit);
}

#ifdef WORDS
// A vector of words at one texel.
fn words_at(texel: vec2<u32>, v: u32) -> vec4<u32> {
    count_work(LOADS, 1u);
    return textureLoad(atlas, texel + vec2<u32>(0u, v * TILE_SIDE), 0);
}
#else
// A vector at one texel.
fn vector_at(texel: vec2<u32>, v: u32) -> vec4<f32> {
    count_work(LOADS, 1u);
    return textureLoad(atlas, texel + vec2<u32>(0u, v * TILE_SIDE), 0);
}

// A vector at a place, as the filter has it.
fn vector_of(place: Place, v: u32) -> vec4<f32> {
#ifdef HARDWARE_FILTER
    count_work(LOADS, 1u);
    let down = vec2<f32>(0.0, f32(v * TILE_SIDE));
    return textureSampleLevel(atlas, linear, (place.texel + down + 0.5) * own.inv_size, 0.0);
#else
#ifdef FILTER_BILINEAR
    let base = floor(place.texel);
    let w = place.texel - base;
    let at = vec2<u32>(base);
    let near = mix(vector_at(at, v), vector_at(at + vec2<u32>(1u, 0u), v), w.x);
    let far = mix(vector_at(at + vec2<u32>(0u, 1u), v), vector_at(at + vec2<u32>(1u, 1u), v), w.x);
    return mix(near, far, w.y);
#else
    return vector_at(vec2<u32>(round(place.texel)), v);
#endif
#endif
}
#endif
