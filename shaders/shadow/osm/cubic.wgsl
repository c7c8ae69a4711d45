// Optical depth between the planes of an opacity shadow map as a monotone cubic (`between=cubic`). Kim and Neumann (2001,
// 2) name a cubic spline, which may overshoot. Slopes at planes are the weighted harmonic means of Fritsch and Butland
// (1984), which keep the cubic within the values of its two planes.
#define_import_path umbravox::cubic_layers

#import umbravox::tile_table::NO_TILE
#import umbravox::layers::{params, plane_at}
#import umbravox::layers_read::{LayerPoint, plane_depth}

// Position of a depth in a layer, with the widths of the layers before, at and behind it (0 where there is none).
struct CubicPoint {
    k: u32,
    weight: f32,
    widths: vec3<f32>,
}

fn cubic_point(point: LayerPoint) -> CubicPoint {
    let k = point.k;
    let planes = vec4<f32>(plane_at(0u, max(k, 1u) - 1u), plane_at(0u, k), plane_at(0u, k + 1u),
        plane_at(0u, min(k + 2u, params.layers)));
    return CubicPoint(k, point.weight, planes.yzw - planes.xyz);
}

// Returns the slope at a plane between two layers with the given slopes and widths; that of the layer at the first and
// the last plane.
fn plane_slope(slopes: vec2<f32>, widths: vec2<f32>, layer: f32) -> f32 {
    let weights = 2.0 * widths.yx + widths;
    let mean = (weights.x + weights.y) * slopes.x * slopes.y / max(dot(weights, slopes.yx), 1e-30);
    return select(layer, mean, all(widths > vec2<f32>(0.0)));
}

// Returns the optical depth of a texel's record, a cubic between the planes.
fn cubic_depth_at(record: u32, point: CubicPoint) -> f32 {
    if record == NO_TILE { return 0.0; }
    let k = point.k;
    let depths = vec4<f32>(plane_depth(record, max(k, 1u) - 1u), plane_depth(record, k), plane_depth(record, k + 1u),
        plane_depth(record, min(k + 2u, params.layers)));
    let rises = depths.yzw - depths.xyz;
    let slopes = max(rises, vec3<f32>(0.0)) / max(point.widths, vec3<f32>(1e-12));
    let start = point.widths.y * plane_slope(slopes.xy, point.widths.xy, slopes.y);
    let end = point.widths.y * plane_slope(slopes.yz, point.widths.yz, slopes.y);
    let t = point.weight;
    let u = 1.0 - t;
    let depth = depths.y + rises.y * t * t * (3.0 - 2.0 * t) + t * u * (start * u - end * t);
    return clamp(depth, depths.y, max(depths.y, depths.z));
}
