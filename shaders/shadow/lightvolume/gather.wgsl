// Marches from every lattice node of some blocks to the light: one workgroup for each block.

#import umbravox::tuning::workgroup_item
#import umbravox::lattice::{lattice, node_position, stored_light}
#import umbravox::light::toward_light
#import umbravox::march::march
#import umbravox::sink::start_sink
#import umbravox::work::add_work

// Blocks of lattice nodes that this dispatch builds: coordinates along x, y and z in ten bits each.
@group(2) @binding(0) var<storage, read> blocks: array<u32>;
@group(2) @binding(1) var light_volume: texture_storage_3d<r32float, write>;

@compute @workgroup_size(#{BLOCK}, #{BLOCK}, #{BLOCK})
fn gather(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let item = workgroup_item(group.y * groups.x + group.x, groups.x * groups.y);
    let block = blocks[min(item, arrayLength(&blocks) - 1u)];
    let node = vec3<u32>(block & 1023u, (block >> 10u) & 1023u, block >> 20u) * #{BLOCK} + local;
    if item >= arrayLength(&blocks) || any(node >= lattice.counts) { return; }
    let g = node_position(node);
    let to_light = toward_light(g);
    var sink = start_sink();
    march(&sink, g, to_light.d, 0.0, to_light.mm);
    textureStore(light_volume, node, vec4<f32>(stored_light(sink.optical_depth.total)));
    add_work();
}
