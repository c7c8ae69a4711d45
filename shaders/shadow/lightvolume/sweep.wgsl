// One slice of a sweep away from the light: what arrives at the slice before, filtered, and the march between the two.

#import umbravox::field::field
#import umbravox::lattice::{lattice, lattice_coordinates, node_place, kept}
#import umbravox::light::toward_light
#import umbravox::march::march
#import umbravox::sink::start_sink
#import umbravox::work::add_work

struct Step {
    // Axis across the slices, and the slice.
    axis: u32,
    slice: u32,
    // 1 where the light lies on the side of higher slices.
    down: u32,
    // 1 for the first slice of a sweep: nothing is known yet.
    opening: u32,
    // 1 where all nodes are this sweep's; else those whose way to the light goes along its axis more than along others.
    whole: u32,
}

@group(2) @binding(0) var<storage, read> step: Step;
@group(2) @binding(1) var light_volume: texture_storage_3d<r32float, write>;
// What arrives at the nodes of two slices, the even and the odd.
@group(2) @binding(2) var<storage, read_write> slices: array<f32>;

// Nodes along the axes of a slice.
fn slice_counts() -> vec2<u32> {
    let n = lattice.counts;
    return select(select(n.xy, n.zx, step.axis == 1u), n.yz, step.axis == 0u);
}

// The axes of a slice, and the one across, of a vector.
fn turned(v: vec3<f32>) -> vec3<f32> {
    return select(select(v.xyz, v.zxy, step.axis == 1u), v.yzx, step.axis == 0u);
}

fn slice_start(slice: u32, size: u32) -> u32 {
    return (slice & 1u) * size;
}

@compute @workgroup_size(8, 8)
fn sweep(@builtin(global_invocation_id) id: vec3<u32>) {
    let counts = slice_counts();
    if any(id.xy >= counts) { return; }
    let place = vec3<u32>(id.xy, step.slice);
    let node = select(select(place.xyz, place.yzx, step.axis == 1u), place.zxy, step.axis == 0u);
    let g = node_place(node);
    let way = toward_light(g);
    let along = turned(way.d).z;
    // To the slice before, and no farther than to the light.
    let slice_before = u32(i32(step.slice) + select(-1, 1, step.down == 1u));
    let gap = abs(turned(node_place(vec3<u32>(slice_before)) - g).z);
    let step_mm = gap / max(abs(along), 1e-20);
    let from_g = g + way.d * min(step_mm, way.mm);
    let at = turned(lattice_coordinates(from_g)).xy;
    // Beside the box of the active bricks there is nothing on the way to the light.
    let beside = any(from_g < field.active_lo - 1e-3) || any(from_g > field.active_hi + 1e-3);
    let known = step.opening == 0u && step_mm < way.mm && !beside;
    var sink = start_sink();
    march(&sink, g, way.d, 0.0, select(way.mm, step_mm, known));

    let low = min(vec2<u32>(at), counts - 2u);
    let w = clamp(at - vec2<f32>(low), vec2<f32>(0.0), vec2<f32>(1.0));
    let size = counts.x * counts.y;
    let before = slice_start(slice_before, size) + low.y * counts.x + low.x;
    let near = mix(slices[before], slices[before + 1u], w.x);
    let far = mix(slices[before + counts.x], slices[before + counts.x + 1u], w.x);
    let arriving = mix(near, far, w.y);
    // Transmittances are filtered as transmittances.
#ifdef KEEPS_DEPTH
    let depth = sink.optical_depth.total + select(0.0, arriving, known);
    slices[slice_start(step.slice, size) + id.y * counts.x + id.x] = min(depth, 2.0 * lattice.most_depth);
    let keeps = kept(depth);
#else
    let keeps = kept(sink.optical_depth.total) * select(1.0, arriving, known);
    slices[slice_start(step.slice, size) + id.y * counts.x + id.x] = keeps;
#endif
    let size_along = abs(turned(way.d));
    let most = max(size_along.x, size_along.y);
    let own = size_along.z >= most && (along > 0.0) == (step.down == 1u);
    if step.whole == 1u || own { textureStore(light_volume, node, vec4<f32>(keeps)); }
    add_work();
}
