// Builds a shadow map that stores several vectors in each texel: one thread for each texel. The sink of the shadow
// method computes the vectors along the ray of the texel.

#import umbravox::light::{light, light_ray, depth_end_mm, OCTAHEDRAL}
#import umbravox::work::{add_divergence, add_work}
#import umbravox::tiles::tile_texel
#import umbravox::tile_table::{TILE, NO_TILE}
#import umbravox::vectors::{VECTORS, TILE_MARGIN, TILE_SIDE, tile_corner, first_record}
#import umbravox::march::march
#import umbravox::sink::{start_sink, finish, met_extinction, stored_vector}
#ifdef RAY_STATES
#import umbravox::tile_table::record_of
#import umbravox::ray_state::{select_ray, has_state, go_to_word, put_word, take_word, MARCH_WORDS}
#import umbravox::sink::{Sink, save_sink, load_sink}
#endif

// Number of texels whose ray meets extinction.
@group(2) @binding(2) var<storage, read_write> texels_hit: atomic<u32>;

// Stores the vectors of a texel in every tile that contains it or has it in its margin. The texel may lie outside the
// map.
fn store_at(texel: vec2<i32>) {
    let side = i32(TILE);
    let margin = i32(TILE_MARGIN);
    let home = texel >> vec2<u32>(#{TILE_SHIFT});
    for (var i = 0; i < 9; i++) {
        let tile = home + vec2<i32>(i % 3, i / 3) - 1;
        let inside = texel - tile * side;
        let stored = all(inside >= vec2<i32>(-margin)) && all(inside < vec2<i32>(side + margin));
        if stored && all(tile >= vec2<i32>(0)) && all(tile < vec2<i32>(i32(light.tiles_across))) {
            let first = first_record(vec2<u32>(tile));
            if first != NO_TILE {
                let corner = tile_corner(first) + vec2<u32>(inside + margin);
                for (var v = 0u; v < VECTORS; v++) {
                    textureStore(atlas, corner + vec2<u32>(0u, v * TILE_SIDE), stored_vector(v));
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

#ifdef RAY_STATES
// Stores the number of a march that waits, behind the state of the march, and the state of its sink.
fn save_march_sink(number: u32, sink: ptr<function, Sink>) {
    put_word(number);
    save_sink(sink);
    add_work();
}

fn load_march_sink(sink: ptr<function, Sink>) {
    go_to_word(MARCH_WORDS + 1u);
    load_sink(sink);
    go_to_word(0u);
}
#endif

@compute @workgroup_size(#{WORKGROUP_SIDE}, #{WORKGROUP_SIDE})
fn build(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let here = tile_texel(group, groups, local);
    if !here.inside { return; }
    let ray = light_ray(vec2<f32>(here.texel));
    let z_end = depth_end_mm();
    var first_march = 0u;
#ifdef RAY_STATES
    if !select_ray(record_of(here.texel)) { return; }
    if has_state() {
        go_to_word(MARCH_WORDS);
        first_march = take_word();
    }
#endif
#ifdef MARCHES
    // A loop, so that the code of the march stands in the program once.
    for (var number = first_march; number < #{MARCHES}; number++) {
#ifdef FROM_BEHIND
        // The first march goes towards the light.
        let behind = number == 0u;
#else
        let behind = false;
#endif
        var sink = start_sink(number);
#ifdef RAY_STATES
        if has_state() { load_march_sink(&sink); }
#endif
        march(&sink, ray.o, select(ray.d, -ray.d, behind), select(light.depth_start_mm, -z_end, behind),
            select(z_end, -light.depth_start_mm, behind));
#ifdef RAY_STATES
        if has_state() {
            save_march_sink(number, &sink);
            return;
        }
#endif
        if !met_extinction() { break; }
    }
#else
    var sink = start_sink(0u);
#ifdef RAY_STATES
    if has_state() { load_march_sink(&sink); }
#endif
    march(&sink, ray.o, ray.d, light.depth_start_mm, z_end);
#ifdef RAY_STATES
    if has_state() {
        save_march_sink(0u, &sink);
        return;
    }
#endif
#endif
    finish();
    if met_extinction() {
        atomicAdd(&texels_hit, 1u);
        // Texels outside the map repeat its edge; an octahedral map continues at the mirrored position behind the same
        // edge.
        let texel = vec2<i32>(here.texel);
        let last = i32(light.map_size) - 1;
        let octahedral = light.projection == OCTAHEDRAL;
        let across = 2 * i32(TILE_MARGIN) + 1;
        for (var i = 0; i < across * across; i++) {
            let step = vec2<i32>(i % across, i / across) - i32(TILE_MARGIN);
            let leaves = step != vec2<i32>(0);
            let edge = select(vec2<i32>(0), vec2<i32>(last), step > vec2<i32>(0));
            let repeated = edge + select(vec2<i32>(0), sign(step) - step, octahedral);
            if all(!leaves | (texel == repeated)) {
                let neighbour = select(texel, edge + step, leaves);
                let mirrored = vec2<bool>(octahedral && leaves.y, octahedral && leaves.x);
                store_at(select(neighbour, last - neighbour, mirrored));
            }
        }
    }
    add_divergence(here.texel, light.map_size);
    add_work();
}
