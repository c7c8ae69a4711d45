// Computes the transmittance from the light at a list of points, with the same code as pictures.

#import umbravox::shadow::transmittance
#ifdef STREAMED
#import umbravox::field::{missing_page, wait_for_page, NEAR_MISSING}
#endif
#ifdef SECTIONS
#import umbravox::section::section_contains
#endif

@group(2) @binding(0) var<storage, read> points: array<vec4<f32>>;
@group(2) @binding(1) var<storage, read_write> results: array<f32>;

@compute @workgroup_size(#{LINE_THREADS})
fn query(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * #{LINE_THREADS} + id.x;
    if i >= arrayLength(&results) { return; }
#ifdef SECTIONS
    // Another dispatch answers for points in other sections.
    if !section_contains(points[i].xyz) { return; }
#endif
#ifdef STREAMED
    // A negative result is not known yet; one that is not a number is known.
    if !(results[i] < 0.0) { return; }
    let missing = missing_page(vec3<i32>(floor(points[i].xyz)), NEAR_MISSING);
    if missing >= 0 {
        wait_for_page(missing);
        return;
    }
#endif
    results[i] = transmittance(points[i].xyz);
}
