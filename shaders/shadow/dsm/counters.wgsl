// Counters of the build of a deep shadow map, and the blocks of texels that have nodes.
#define_import_path umbravox::dsm_counters

struct Counters {
    // Number of rows requested beyond the first rows of texels, including those that the pool could not provide.
    overflow_rows: atomic<u32>,
    nodes_total: atomic<u32>,
    nodes_max: atomic<u32>,
    // Number of quads that the finished map needs: a head for each texel with nodes, and tail quads.
    quads_needed: atomic<u32>,
    // Number of texels whose ray was not marched to its end, since software adapters end long loops.
    texels_cut: atomic<u32>,
    // Number of texels whose error tunnel was narrowed because a hull was full.
    texels_narrowed: atomic<u32>,
    // Number of texels whose ray meets extinction, and of quads of the finished map that are in use: counted when the
    // nodes are copied to it.
    texels_hit: atomic<u32>,
    quads: atomic<u32>,
    // Number of rows that the pool could not provide.
    missing_rows: u32,
}

// Block of 8 x 4 texels: mask of the texels with nodes, and the index of the first of their heads.
struct Block {
    mask: atomic<u32>,
    first_head: u32,
}

@group(2) @binding(2) var<storage, read_write> counters: Counters;
// Blocks of the built tiles, eight for each, in the order of records.
@group(2) @binding(4) var<storage, read_write> blocks: array<Block>;

// Returns the index of the block of a record.
fn block_of_record(record: u32) -> u32 {
    return (record >> 8u) * 8u + ((record >> 6u) & 3u) * 2u + ((record >> 3u) & 1u);
}

// Returns the bit of a record in its block's mask.
fn bit_of_record(record: u32) -> u32 {
    return ((record >> 4u) & 3u) * 8u + (record & 7u);
}
