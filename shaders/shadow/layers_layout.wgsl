// Where a layered map keeps what: its records, and the planes between its layers.
//
// A texel's record is a run of bits: start and end depth (as far as the method has them) and the row of its own
// split, then one slot a layer with the optical depth down to the layer's far plane. Records of a tile lie side by
// side; tiles without active bricks have none. A layered map's planes lie at shares of its texel's extent: 0 at the
// start, 1 at the end.
#define_import_path umbravox::layers

#import umbravox::light::{LightSpace, OCTAHEDRAL, TILE}

const NO_TILE: u32 = 0xffffffffu;
// Texels across the texture of records.
const RECORD_TEXTURE_WIDTH: u32 = 8192u;
// Stretches of a tabulated split.
const SPLIT_BINS: u32 = 1024u;

// First the layout table: a texel a tile, the first of its 256 records or NO_TILE. From row `split_row` on, two
// rows a tabulated split: the layer coordinate at the edges of SPLIT_BINS bins, and the place of every plane (float
// bits).
@group(1) @binding(1) var tables: texture_2d<u32>;

// The record of a texel, NO_TILE where it has none.
fn record_of(light: LightSpace, texel: vec2<u32>) -> u32 {
    let first = textureLoad(tables, texel / TILE, 0).x;
    return select(first + (texel.y % TILE) * TILE + texel.x % TILE, NO_TILE, first == NO_TILE);
}

// Where a block (one texel of the texture: 1, 2 or 4 words) of a record lies.
fn block_place(light: LightSpace, record: u32, block: u32) -> vec2<u32> {
    let index = record * light.record_blocks + block;
    return vec2<u32>(index % RECORD_TEXTURE_WIDTH, index / RECORD_TEXTURE_WIDTH);
}

// A texel that may lie outside the map: an octahedral map goes on at the mirrored place of the same edge.
fn wrapped_texel(light: LightSpace, texel: vec2<i32>) -> vec2<u32> {
    let last = i32(light.map_size) - 1;
    var t = texel;
    if light.projection == OCTAHEDRAL {
        if t.x < 0 || t.x > last { t = vec2<i32>(clamp(t.x, 0, last), last - t.y); }
        if t.y < 0 || t.y > last { t = vec2<i32>(last - t.x, clamp(t.y, 0, last)); }
    }
    return vec2<u32>(clamp(t, vec2<i32>(0), vec2<i32>(last)));
}

fn table_value(x: u32, y: u32) -> f32 {
    return bitcast<f32>(textureLoad(tables, vec2<u32>(x, y), 0).x);
}

// The layer coordinate of a share of the extent: 0 at the start, k at plane k. `row` picks one of several splits.
fn layer_at(light: LightSpace, row: u32, share: f32) -> f32 {
    let layers = f32(light.layers);
#ifdef SPLIT_TABLE
    let bin = share * f32(SPLIT_BINS);
    let i = min(u32(bin), SPLIT_BINS - 1u);
    let y = light.split_row + 2u * row;
    return mix(table_value(i, y), table_value(i + 1u, y), bin - f32(i));
#else
#ifdef SPLIT_GROWING
    // The inverse of plane_at: k (k + 1) = share layers (layers + 1).
    return 0.5 * (sqrt(1.0 + 4.0 * share * layers * (layers + 1.0)) - 1.0);
#else
    return layers * pow(max(share, 1e-30), 1.0 / light.split_exponent);
#endif
#endif
}

// The share of the extent at which plane k lies.
fn plane_at(light: LightSpace, row: u32, k: u32) -> f32 {
#ifdef SPLIT_TABLE
    return table_value(k, light.split_row + 2u * row + 1u);
#else
    let layers = f32(light.layers);
#ifdef SPLIT_GROWING
    return f32(k) * f32(k + 1u) / (layers * (layers + 1.0));
#else
    return pow(f32(k) / layers, light.split_exponent);
#endif
#endif
}
