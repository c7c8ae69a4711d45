// Gives the heads of each block of texels consecutive quads of a deep shadow map, and writes the directory.

#import umbravox::light::light
#import umbravox::tile_table::{record_of, NO_TILE}
#import umbravox::dsm_directory::BLOCK_SHIFT
#import umbravox::dsm_layout::params
#import umbravox::dsm_counters::{counters, blocks, block_of_record}

@group(2) @binding(5) var entries: texture_storage_2d<rg32uint, write>;

@compute @workgroup_size(#{LINE_THREADS})
fn allocate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * #{LINE_THREADS} + id.x;
    let across = (vec2<u32>(light.map_size - 1u) >> BLOCK_SHIFT) + 1u;
    if i == 0u {
        let rows = params.tile_rows + atomicLoad(&counters.overflow_rows);
        counters.missing_rows = max(rows, params.pool_rows) - params.pool_rows;
    }
    if i >= across.x * across.y { return; }
    let block = vec2<u32>(i % across.x, i / across.x);
    let record = record_of(block << BLOCK_SHIFT);
    if record == NO_TILE { return; }
    let own = block_of_record(record);
    let mask = atomicLoad(&blocks[own].mask);
    if mask == 0u { return; }
    let first_head = atomicAdd(&counters.quads, countOneBits(mask));
    atomicAdd(&counters.texels_hit, countOneBits(mask));
    blocks[own].first_head = first_head;
    textureStore(entries, block, vec4<u32>(mask, first_head, 0u, 0u));
}
