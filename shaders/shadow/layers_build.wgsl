// Builds a layered map: a workgroup a tile that holds active bricks, a thread a texel.

#import umbravox::light::{light_ray, TILE}
#import umbravox::layers::{record_of, NO_TILE}
#import umbravox::march::march
#import umbravox::sink::{Sink, light, start_writer, seek_end, met_something, finish}

struct Stage {
    // Texels whose ray meets extinction.
    texels_hit: atomic<u32>,
    // Side of a region in texels, regions a side, and the split that each region has chosen.
    region_texels: u32,
    regions_across: u32,
    rows: array<u32>,
}

@group(2) @binding(1) var<storage, read_write> stage: Stage;
// Tiles that hold active bricks.
@group(2) @binding(2) var<storage, read> tile_list: array<u32>;

@compute @workgroup_size(16, 16)
fn build(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let index = group.y * groups.x + group.x;
    if index >= arrayLength(&tile_list) { return; }
    let tile = tile_list[index];
    let texel = vec2<u32>(tile % light.tiles_across, tile / light.tiles_across) * TILE + local.xy;
    if any(texel >= vec2<u32>(light.map_size)) { return; }
    let record = record_of(light, texel);
    var row = light.split_choice;
#ifdef SPLIT_ROWS
    let region = min(texel / stage.region_texels, vec2<u32>(stage.regions_across - 1u));
    row = stage.rows[region.y * stage.regions_across + region.x];
#endif
    if record == NO_TILE { return; }
    start_writer(record, row);
    let ray = light_ray(light, vec2<f32>(texel));
    let z_end = light.depth_start_mm + light.depth_range_mm;
    var sink = Sink(0.0, light.longest_depth, light.longest_depth);
#ifdef ENDS
    // Once from behind for the end, once from the light for the layers: a loop, so that the march stands here once.
    var behind = true;
    loop {
        seek_end(behind);
        let first = select(light.depth_start_mm, -z_end, behind);
        let to = select(z_end, -light.depth_start_mm, behind);
        march(&sink, ray.o, select(ray.d, -ray.d, behind), first, to);
        if !behind || !met_something() { break; }
        behind = false;
    }
#else
    march(&sink, ray.o, ray.d, light.depth_start_mm, z_end);
#endif
    finish(sink.optical_depth);
    if met_something() { atomicAdd(&stage.texels_hit, 1u); }
}
