// Builds a map of vectors: a workgroup a tile, a thread a texel. The method's sink gathers them along the texel's ray.

#import umbravox::light::{light, light_ray, depth_end_mm, OCTAHEDRAL}
#import umbravox::work::add_work
#import umbravox::tiles::tile_texel
#import umbravox::tile_table::{TILE, NO_TILE}
#import umbravox::vectors::{VECTORS, TILE_SIDE, tile_corner, first_record}
#import umbravox::march::march
#import umbravox::sink::{start_sink, finish, met_something, vector_of}

// Texels whose ray meets extinction.
@group(2) @binding(2) var<storage, read_write> texels_hit: atomic<u32>;

// Stores the vectors at a place of the map, which may lie one texel outside of it, in every tile that holds it or has it
// in its margin.
fn store_at(place: vec2<i32>) {
    let side = i32(TILE);
    let home = place >> vec2<u32>(#{TILE_SHIFT});
    for (var i = 0; i < 9; i++) {
        let tile = home + vec2<i32>(i % 3, i / 3) - 1;
        let inside = place - tile * side;
        let held = all(inside >= vec2<i32>(-1)) && all(inside <= vec2<i32>(side));
        if held && all(tile >= vec2<i32>(0)) && all(tile < vec2<i32>(i32(light.tiles_across))) {
            let first = first_record(vec2<u32>(tile));
            if first != NO_TILE {
                let corner = tile_corner(first) + vec2<u32>(inside + 1);
                for (var v = 0u; v < VECTORS; v++) {
                    textureStore(atlas, corner + vec2<u32>(0u, v * TILE_SIDE), vector_of(v));
                }
            }
        }
    }
}

#ifdef WORDS
@group(2) @binding(1) var atlas: texture_storage_2d<rgba32uint, write>;
#else
#ifdef BITS_16
@group(2) @binding(1) var atlas: texture_storage_2d<rgba16float, write>;
#else
@group(2) @binding(1) var atlas: texture_storage_2d<rgba32float, write>;
#endif
#endif

@compute @workgroup_size(#{TILE}, #{TILE})
fn build(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let here = tile_texel(group, groups, local);
    if !here.inside { return; }
    let ray = light_ray(vec2<f32>(here.texel));
    let z_end = depth_end_mm();
#ifdef TURNS
    // More than one march a ray, in a loop, so that the march stands here once.
    for (var turn = 0u; turn < #{TURNS}; turn++) {
#ifdef FROM_BEHIND
        // The first is from behind.
        let behind = turn == 0u;
#else
        let behind = false;
#endif
        var sink = start_sink(turn);
        march(&sink, ray.o, select(ray.d, -ray.d, behind), select(light.depth_start_mm, -z_end, behind),
            select(z_end, -light.depth_start_mm, behind));
        if !met_something() { break; }
    }
#else
    var sink = start_sink(0u);
    march(&sink, ray.o, ray.d, light.depth_start_mm, z_end);
#endif
    finish();
    if met_something() {
        atomicAdd(&texels_hit, 1u);
        // Beyond an edge of the map the edge goes on; an octahedral map goes on at the mirrored place of the same edge.
        let texel = vec2<i32>(here.texel);
        let last = i32(light.map_size) - 1;
        let octahedral = light.projection == OCTAHEDRAL;
        for (var i = 0; i < 9; i++) {
            let step = vec2<i32>(i % 3, i / 3) - 1;
            let leaves = (step != vec2<i32>(0)) & (texel == select(vec2<i32>(0), vec2<i32>(last), step > vec2<i32>(0)));
            if all(leaves | (step == vec2<i32>(0))) {
                let place = texel + step;
                let mirrored = vec2<bool>(octahedral && leaves.y, octahedral && leaves.x);
                store_at(select(place, last - place, mirrored));
            }
        }
    }
    add_work();
}
