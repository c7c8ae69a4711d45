// Filters of shadow maps: the square of texels (taps) that a query averages, and their weights. A weight is the product
// of one for the column and one for the row. All weights add up to 1.
#define_import_path umbravox::taps

// Number of texels on a side of the square, and in it.
const TAPS_ACROSS: u32 = #{TAPS_ACROSS};
const TAPS: u32 = TAPS_ACROSS * TAPS_ACROSS;
#ifdef FILTER_GAUSS
// Standard deviation of the Gaussian, in texels.
const GAUSS_SIGMA: f32 = #{GAUSS_SIGMA};
// Distance at which its weights end, in texels.
const GAUSS_END: f32 = 2.0;
#endif

// Taps around a position on the map.
struct Taps {
    // First column and row of the square.
    corner: vec2<i32>,
    // Weights of its columns and rows.
    columns: vec4<f32>,
    rows: vec4<f32>,
}

// Texel of the square with its weight.
struct Tap {
    texel: vec2<i32>,
    weight: f32,
}

#ifdef FILTER_GAUSS
// Returns a Gaussian of a distance, lowered so that it is 0 where the weights end.
fn gauss(distance: vec4<f32>) -> vec4<f32> {
    let scale = -0.5 / (GAUSS_SIGMA * GAUSS_SIGMA);
    return max(exp(scale * distance * distance) - exp(scale * GAUSS_END * GAUSS_END), vec4<f32>(0.0));
}
#endif

// Returns the weights of columns (or rows) around a coordinate that lies `w` past a texel centre.
fn axis_weights(w: f32) -> vec4<f32> {
#ifdef FILTER_GAUSS
    let weights = gauss(vec4<f32>(1.0 + w, w, 1.0 - w, 2.0 - w));
    return weights / dot(weights, vec4<f32>(1.0));
#else
    // An odd number of texels has a plain mean. Of an even number, the means of all but the last and of all but the
    // first are interpolated.
    let even = select(vec4<f32>(1.0 - w, w, 0.0, 0.0), vec4<f32>(1.0 - w, 1.0, 1.0, w) / 3.0, TAPS_ACROSS == 4u);
    return select(even, vec4<f32>(1.0 / f32(TAPS_ACROSS)), TAPS_ACROSS % 2u == 1u);
#endif
}

// Returns the taps around a position on the map.
fn taps_around(texel: vec2<f32>) -> Taps {
    let base = select(floor(texel), round(texel), TAPS_ACROSS % 2u == 1u);
    let w = texel - base;
    let corner = vec2<i32>(base) - i32((TAPS_ACROSS - 1u) / 2u);
    return Taps(corner, axis_weights(w.x), axis_weights(w.y));
}

// Returns tap i, row by row.
fn tap_at(taps: Taps, i: u32) -> Tap {
    let at = vec2<u32>(i % TAPS_ACROSS, i / TAPS_ACROSS);
    return Tap(taps.corner + vec2<i32>(at), taps.columns[at.x] * taps.rows[at.y]);
}

// Returns the weights of the first four texels of two rows, those of `filter=bilinear`.
fn four_weights(taps: Taps) -> vec4<f32> {
    return taps.columns.xyxy * taps.rows.xxyy;
}
