// Computes one slice of a light volume in a sweep away from the light, from the filtered slice before it and a march
// between the two.

#import umbravox::field::field
#import umbravox::lattice::{lattice, lattice_coordinates, node_position, stored_light}
#import umbravox::light::toward_light
#import umbravox::march::march
#import umbravox::sink::start_sink
#import umbravox::work::add_work

struct SweepStep {
    // Axis perpendicular to the slices, and index of the present slice.
    axis: u32,
    slice: u32,
    // 1 if the light lies on the side of slices with higher indices, else 0.
    down: u32,
    // 1 for the first slice of a sweep, which has no slice before it, else 0.
    opening: u32,
    // 1 if the sweep stores all nodes, 0 if it stores nodes whose direction to the light is mainly along its axis.
    whole: u32,
}

@group(2) @binding(0) var<storage, read> sweep_step: SweepStep;
@group(2) @binding(1) var light_volume: texture_storage_3d<r32float, write>;
// Transmittance or optical depth at the nodes of two slices, the even and the odd one.
@group(2) @binding(2) var<storage, read_write> slices: array<f32>;

// Returns the number of nodes along the axes of a slice.
fn slice_counts() -> vec2<u32> {
    let n = lattice.counts;
    return select(select(n.xy, n.zx, sweep_step.axis == 1u), n.yz, sweep_step.axis == 0u);
}

// Permutes the axes of a vector: first the axes of a slice, then the one perpendicular to it.
fn turned(v: vec3<f32>) -> vec3<f32> {
    return select(select(v.xyz, v.zxy, sweep_step.axis == 1u), v.yzx, sweep_step.axis == 0u);
}

fn slice_start(slice: u32, size: u32) -> u32 {
    return (slice & 1u) * size;
}

@compute @workgroup_size(8, 8)
fn sweep(@builtin(global_invocation_id) id: vec3<u32>) {
    let counts = slice_counts();
    if any(id.xy >= counts) { return; }
    let turned_node = vec3<u32>(id.xy, sweep_step.slice);
    let node = select(select(turned_node.xyz, turned_node.yzx, sweep_step.axis == 1u), turned_node.zxy, sweep_step.axis == 0u);
    let g = node_position(node);
    let to_light = toward_light(g);
    let along = turned(to_light.d).z;
    // The march ends at the slice before, or at the light.
    let slice_before = u32(i32(sweep_step.slice) + select(-1, 1, sweep_step.down == 1u));
    let gap = abs(turned(node_position(vec3<u32>(slice_before)) - g).z);
    let step_mm = gap / max(abs(along), 1e-20);
    let from_g = g + to_light.d * min(step_mm, to_light.mm);
    let at = turned(lattice_coordinates(from_g)).xy;
    // Nothing lies outside the box of the active bricks.
    let beside = any(from_g < field.active_lo - 1e-3) || any(from_g > field.active_hi + 1e-3);
    let known = sweep_step.opening == 0u && step_mm < to_light.mm && !beside;
    var sink = start_sink();
    march(&sink, g, to_light.d, 0.0, select(to_light.mm, step_mm, known));

    let low = min(vec2<u32>(at), counts - 2u);
    let w = clamp(at - vec2<f32>(low), vec2<f32>(0.0), vec2<f32>(1.0));
    let size = counts.x * counts.y;
    let before = slice_start(slice_before, size) + low.y * counts.x + low.x;
    let near = mix(slices[before], slices[before + 1u], w.x);
    let far = mix(slices[before + counts.x], slices[before + counts.x + 1u], w.x);
    let arriving = mix(near, far, w.y);
#ifdef STORES_DEPTH
    let depth = sink.optical_depth.total + select(0.0, arriving, known);
    slices[slice_start(sweep_step.slice, size) + id.y * counts.x + id.x] = min(depth, 2.0 * lattice.max_depth);
    let stored = stored_light(depth);
#else
    let stored = stored_light(sink.optical_depth.total) * select(1.0, arriving, known);
    slices[slice_start(sweep_step.slice, size) + id.y * counts.x + id.x] = stored;
#endif
    let size_along = abs(turned(to_light.d));
    let most = max(size_along.x, size_along.y);
    let stores = size_along.z >= most && (along > 0.0) == (sweep_step.down == 1u);
    if sweep_step.whole == 1u || stores { textureStore(light_volume, node, vec4<f32>(stored)); }
    add_work();
}
