// Replaces each number of a summed-area table by the sum of the numbers up to it along one axis: one thread for each
// line. Sums are modulo 2^32.

#import umbravox::sat_table::{turned_counts, turned_strides}
#import umbravox::work::add_work

// Axis of the lines.
@group(2) @binding(0) var<storage, read> axis: u32;
@group(2) @binding(1) var<storage, read_write> sums: array<u32>;

@compute @workgroup_size(#{LINE_THREADS})
fn scan(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let line = id.y * groups.x * #{LINE_THREADS} + id.x;
    let counts = turned_counts(axis);
    if line >= counts.x * counts.y { return; }
    let strides = turned_strides(axis);
    var at = (line % counts.x) * strides.x + (line / counts.x) * strides.y;
    let last = arrayLength(&sums) - 1u;
    var sum = 0u;
    var left = counts.z;
    loop {
        sum += sums[min(at, last)];
        sums[min(at, last)] = sum;
        at += strides.z;
        left -= 1u;
        if left == 0u { break; }
    }
    add_work();
}
