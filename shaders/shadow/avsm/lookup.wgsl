// `avsm`: query of the transmittance in a fixed number of curve nodes (Salvi et al. 2010), linear between the
// two nodes around a depth.
#define_import_path umbravox::texel_curve

#import umbravox::align::NO_DEPTH
#import umbravox::light::light
#import umbravox::vectors::VECTORS
#import umbravox::vectors_read::vector_at

// Returns the depth (mm) where the matter of a texel begins.
fn first_depth(texel: vec2<u32>) -> f32 {
    let pair = vector_at(texel, 0u);
    let is_empty = pair.x == 0.0 && pair.y == 0.0;
    return select(light.depth_start_mm + pair.x * light.depth_range_mm, NO_DEPTH, is_empty);
}

fn texel_transmittance(place: vec2<f32>, z: f32) -> f32 {
    let texel = vec2<u32>(place);
    let share = (z - light.depth_start_mm) / light.depth_range_mm;
    // Before the first node the transmittance is 1. A texel without nodes holds zeros.
    var before = vec2<f32>(-1.0, 1.0);
    var after = vec2<f32>(2.0, 1.0);
    var searching = true;
    for (var v = 0u; v < VECTORS; v++) {
        if !searching { break; }
        let pair = vector_at(texel, v);
        let empty = pair.y == 0.0 && pair.x == 0.0;
        let first_passed = pair.x <= share && !empty;
        let second_passed = pair.z <= share && !empty;
        after = select(select(pair.zw, pair.xy, !first_passed), vec2<f32>(2.0, 1.0), empty);
        before = select(select(before, pair.xy, first_passed), pair.zw, second_passed);
        searching = second_passed;
    }
    // The curve is constant behind the last node.
    after = select(after, vec2<f32>(before.x + 1.0, before.y), searching);
    after.y = select(after.y, before.y, after.x >= 2.0);
    let w = clamp((share - before.x) / max(after.x - before.x, 1e-12), 0.0, 1.0);
    return mix(before.y, select(after.y, before.y, before.x < 0.0), w);
}
