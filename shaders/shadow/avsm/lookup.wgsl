// `avsm`: lookup in a fixed number of nodes (Salvi et al. 2010, 3.3): linear between the two around a depth.
#define_import_path umbravox::texel_curve

#import umbravox::light::light
#import umbravox::vectors::VECTORS
#import umbravox::vectors_read::vector_at

fn texel_transmittance(texel: vec2<u32>, z: f32) -> f32 {
    let share = (z - light.depth_start_mm) / light.depth_range_mm;
    // Before the first node all light arrives. A texel without any is 0 throughout.
    var before = vec2<f32>(-1.0, 1.0);
    var after = vec2<f32>(2.0, 1.0);
    var searching = true;
    for (var v = 0u; v < VECTORS; v++) {
        if !searching { break; }
        let two = vector_at(texel, v);
        let empty = two.y == 0.0 && two.x == 0.0;
        let first_passed = two.x <= share && !empty;
        let second_passed = two.z <= share && !empty;
        after = select(select(two.zw, two.xy, !first_passed), vec2<f32>(2.0, 1.0), empty);
        before = select(select(before, two.xy, first_passed), two.zw, second_passed);
        searching = second_passed;
    }
    // All are passed: nothing changes behind the last.
    after = select(after, vec2<f32>(before.x + 1.0, before.y), searching);
    after.y = select(after.y, before.y, after.x >= 2.0);
    let w = clamp((share - before.x) / max(after.x - before.x, 1e-12), 0.0, 1.0);
    return mix(before.y, select(after.y, before.y, before.x < 0.0), w);
}
