// `clusters`: query of the transmittance from density clusters, each spread evenly around its mean (Mertens et al.
// 2004).
#define_import_path umbravox::texel_curve

#import umbravox::align::NO_DEPTH
#import umbravox::light::light
#import umbravox::vectors::VECTORS
#import umbravox::vectors_read::vector_at

const CLUSTERS: u32 = #{CLUSTERS};
// Half width of a uniform distribution in standard deviations: the square root of 3.
const REACH: f32 = 1.73205080756888;
// Half width of the thinnest cluster, as a fraction of the map's range of depths.
const THINNEST: f32 = 1e-6;

// Returns the numbers of a texel, three for each cluster.
fn numbers_of(texel: vec2<u32>) -> array<f32, 4 * VECTORS> {
    var numbers: array<f32, 4 * VECTORS>;
    for (var v = 0u; v < VECTORS; v++) {
        let four = vector_at(texel, v);
        numbers[4u * v] = four.x;
        numbers[4u * v + 1u] = four.y;
        numbers[4u * v + 2u] = four.z;
        numbers[4u * v + 3u] = four.w;
    }
    return numbers;
}

// Returns the depth (mm) where the matter of a texel begins.
fn first_depth(texel: vec2<u32>) -> f32 {
    var numbers = numbers_of(texel);
    var first = NO_DEPTH;
    for (var c = 0u; c < CLUSTERS; c++) {
        let start = numbers[3u * c] - max(REACH * numbers[3u * c + 1u], THINNEST);
        let start_mm = light.depth_start_mm + start * light.depth_range_mm;
        first = select(first, min(first, start_mm), numbers[3u * c + 2u] > 0.0);
    }
    return first;
}

fn texel_transmittance(place: vec2<f32>, z: f32) -> f32 {
    let share = (z - light.depth_start_mm) / light.depth_range_mm;
    var numbers = numbers_of(vec2<u32>(place));
    var depth = 0.0;
    for (var c = 0u; c < CLUSTERS; c++) {
        let half = max(REACH * numbers[3u * c + 1u], THINNEST);
        depth += numbers[3u * c + 2u] * clamp(0.5 + 0.5 * (share - numbers[3u * c]) / half, 0.0, 1.0);
    }
    return exp(-depth);
}
