// Builds a tiled deep shadow map: one thread for each texel.

#import umbravox::field::{field, brick_distance_at, safe_inverse, box_span, clipped_span, BRICK_CELLS, BRICK_SHIFT, FAR}
#import umbravox::gradient_opacity::gradient_factor_at
#import umbravox::labels::labeled_value_at
#import umbravox::transfer::extinction_at
#import umbravox::light::{light, light_ray}
#import umbravox::work::{add_divergence, add_work}
#import umbravox::tiles::tile_texel
#import umbravox::tile_table::record_of
#import umbravox::compression::{start_writer, push, finish}
#import umbravox::curve_nodes::report_cut_ray
#ifdef WORKGROUP_SUMS
#import umbravox::curve_nodes::add_counts
#endif
#import umbravox::dsm_layout::{params, DEPTH_STEPS, MAX_LATTICE_STEPS}
#ifdef PRISM
#import umbravox::prism::march_prism
#import umbravox::sink::start_sink
#else ifdef MARCHES
#import umbravox::march::march
#import umbravox::sink::start_sink
#endif

const OPAQUE_DEPTH: f32 = #{OPAQUE_DEPTH};

#ifdef RAY_STATES
#import umbravox::ray_state::{select_ray, has_state, go_to_word, MARCH_WORDS}
#import umbravox::sink::{save_sink, load_sink}
#endif

#ifndef MARCHES
fn extinction_of_point(g: vec3<f32>) -> f32 {
#ifdef GRADIENT_OPACITY
    return extinction_at(labeled_value_at(g)) * gradient_factor_at(g);
#else
    return extinction_at(labeled_value_at(g));
#endif
}

// Returns the optical depth between two depths by the trapezoid rule over point samples of extinction
// (`precompress=off`).
fn sampled_depth(o: vec3<f32>, d: vec3<f32>, z_from: f32, z_to: f32) -> f32 {
    let size = vec3<f32>(field.size);
    let span = clipped_span(o, d, box_span(o, safe_inverse(d), d, vec3<f32>(0.5), size + 0.5));
    let a = max(z_from, span.x);
    let b = min(z_to, span.y);
    if !(a < b) { return 0.0; }
    return 0.5 * (b - a) * (extinction_of_point(o + a * d) + extinction_of_point(o + b * d));
}
#endif

#ifndef WHOLE_CURVE
// Returns the depth up to which the ray from depth z crosses only inactive bricks; z itself inside an active brick.
fn next_active(o: vec3<f32>, d: vec3<f32>, z: f32, z_end: f32) -> f32 {
    let inv_d = safe_inverse(d);
    let span = box_span(o, inv_d, d, field.active_lo, field.active_hi);
    if span.x >= min(span.y, z_end) { return z_end; }
    var at = max(z, span.x);
    let forward = d > vec3<f32>(0.0);
    // Each iteration leaves a brick. If rounding prevents that, marching from z is correct, too.
    let bricks = i32(field.size.x + field.size.y + field.size.z) / BRICK_CELLS + 6;
    for (var i = 0; i < bricks; i++) {
        if at >= min(span.y, z_end) { return z_end; }
        let cell = clamp(vec3<i32>(floor(o + at * d)), vec3<i32>(0), vec3<i32>(field.size));
        let brick = cell >> BRICK_SHIFT;
        let distance = brick_distance_at(brick);
        if distance == 0 { return at; }
        let face = select((brick - (distance - 1)) * BRICK_CELLS, (brick + distance) * BRICK_CELLS, forward);
        let exits = select(vec3<f32>(FAR), (vec3<f32>(face) - o) * inv_d, abs(d) >= vec3<f32>(1e-20));
        // Slightly past the face, so that rounding does not stop the loop; regular sampling is not more precise.
        at = max(min(exits.x, min(exits.y, exits.z)), at) + 1e-3 * field.min_spacing_mm;
    }
    return max(z, span.x);
}

fn tap_offset(tap: u32) -> vec2<f32> {
    if params.taps == 9u { return (vec2<f32>(f32(tap % 3u), f32(tap / 3u)) - 1.0) / 3.0; }
    if params.taps == 5u && tap > 0u {
        return vec2<f32>(f32((tap - 1u) & 1u), f32((tap - 1u) >> 1u)) * 0.5 - 0.25;
    }
    return vec2<f32>(0.0);
}

// Computes the mean of `taps` visibility functions on a regular lattice of depths.
fn regular_curve(texel: vec2<f32>, z_start: f32, z_end: f32) {
    var depths: array<f32, 9>;
    for (var tap = 0u; tap < 9u; tap++) { depths[tap] = 0.0; }
    // Number of lattice steps done; skipping does not change the lattice.
    var k = 0.0;
    var over = false;
    for (var i = 0u; i <= MAX_LATTICE_STEPS; i++) {
        var resume = z_end;
        for (var tap = 0u; tap < params.taps; tap++) {
            let ray = light_ray(texel + tap_offset(tap));
            resume = min(resume, next_active(ray.o, ray.d, z_start + k * params.step_mm, z_end));
        }
        over = resume >= z_end;
        if over { break; }
        k = max(k, floor((resume - z_start) / params.step_mm));
        let z = z_start + k * params.step_mm;
        let z_next = z_start + (k + 1.0) * params.step_mm;
        var mean = 0.0;
        var step_depth = 0.0;
        for (var tap = 0u; tap < params.taps; tap++) {
            let ray = light_ray(texel + tap_offset(tap));
#ifdef MARCHES
            var sink = start_sink();
            march(&sink, ray.o, ray.d, z, z_next);
            let depth = sink.optical_depth.total;
#else
            let depth = sampled_depth(ray.o, ray.d, z, z_next);
#endif
            depths[tap] += depth;
            step_depth += depth;
            mean += exp(-depths[tap]);
        }
        mean /= f32(params.taps);
        if step_depth > 0.0 {
            push(z, z_next, mean);
            over = mean < exp(-OPAQUE_DEPTH);
            if over { break; }
        }
        k += 1.0;
    }
    if !over { report_cut_ray(); }
}
#endif

fn build_texel(here: vec2<u32>, record: u32) {
#ifdef RAY_STATES
    if !select_ray(record) { return; }
#endif
    let texel = vec2<f32>(here);
    let z_end = light.depth_start_mm + DEPTH_STEPS / params.depth_steps_per_mm;
    start_writer(record);
#ifdef WHOLE_CURVE
    var sink = start_sink();
#ifdef PRISM
    march_prism(&sink, texel, light.depth_start_mm, z_end);
#else
    let ray = light_ray(texel);
#ifdef RAY_STATES
    if has_state() {
        go_to_word(MARCH_WORDS);
        load_sink(&sink);
        go_to_word(0u);
    }
#endif
    march(&sink, ray.o, ray.d, light.depth_start_mm, z_end);
#ifdef RAY_STATES
    if has_state() {
        save_sink(&sink);
        add_work();
        return;
    }
#endif
#endif
#else
    regular_curve(texel, light.depth_start_mm, z_end);
#endif
    finish();
    add_divergence(here, light.map_size);
    add_work();
}

@compute @workgroup_size(#{WORKGROUP_SIDE}, #{WORKGROUP_SIDE})
fn build(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let here = tile_texel(group, groups, local);
    let record = record_of(here.texel);
    if here.inside { build_texel(here.texel, record); }
#ifdef WORKGROUP_SUMS
    add_counts(record, thread);
#endif
}
