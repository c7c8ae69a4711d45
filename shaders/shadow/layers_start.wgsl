// The depth pass of the papers, which finds where each light ray first meets extinction. The build's march meets that
// place before it needs it, and so this runs only where it is forced.

#import umbravox::light::{LightSpace, light_ray, TILE}
#import umbravox::march::march
#import umbravox::sink::Sink

#ifdef LIVE
@group(1) @binding(0) var<storage, read> light: LightSpace;
#else
@group(1) @binding(0) var<uniform> light: LightSpace;
#endif
// Depth of the first extinction, mm, tile by tile.
@group(2) @binding(1) var<storage, read_write> starts_mm: array<f32>;
// Tiles that hold active bricks.
@group(2) @binding(2) var<storage, read> tile_list: array<u32>;

@compute @workgroup_size(16, 16)
fn find_starts(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let index = group.y * groups.x + group.x;
    if index >= arrayLength(&tile_list) { return; }
    let tile = tile_list[index];
    let texel = vec2<u32>(tile % light.tiles_across, tile / light.tiles_across) * TILE + local.xy;
    let ray = light_ray(light, vec2<f32>(texel));
    let end = light.depth_start_mm + light.depth_range_mm;
    var sink = Sink(end, light.longest_depth);
    march(&sink, ray.o, ray.d, light.depth_start_mm, end);
    starts_mm[(index * TILE + local.y) * TILE + local.x] = sink.start_mm;
}
