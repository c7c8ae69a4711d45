// Directory of a deep shadow map: it leads from a texel to its head, the quad with its first curve nodes.
//
// A block of 8 x 4 texels has one entry: a mask of the texels with nodes, and the index of the first of their heads,
// which are consecutive in the order of the mask's bits.
#define_import_path umbravox::dsm_directory

#import umbravox::work::{count_work, LOADS}
#import umbravox::tile_table::texels_around

const NO_HEAD: u32 = 0xffffffffu;
// Binary logarithms of the sides of a block.
const BLOCK_SHIFT: vec2<u32> = vec2<u32>(3u, 2u);

@group(1) @binding(4) var directory: texture_2d<u32>;

fn block_entry(block: vec2<u32>) -> vec2<u32> {
    count_work(LOADS, 1u);
    return textureLoad(directory, block, 0).xy;
}

// Returns the indices of the heads of the texel at `base` and of those at (1, 0), (0, 1) and (1, 1) from it; NO_HEAD
// for texels without nodes. Texels of one block, as most are, share one read of the directory.
fn heads_around(base: vec2<i32>) -> vec4<u32> {
    let texels = texels_around(base);
    let blocks_x = texels.x >> BLOCK_SHIFT.xxxx;
    let blocks_y = texels.y >> BLOCK_SHIFT.yyyy;
    let entry = block_entry(vec2<u32>(blocks_x.x, blocks_y.x));
    var masks = entry.xxxx;
    var first = entry.yyyy;
    if any((blocks_x != blocks_x.xxxx) | (blocks_y != blocks_y.xxxx)) {
        let of_b = block_entry(vec2<u32>(blocks_x.y, blocks_y.y));
        let of_c = block_entry(vec2<u32>(blocks_x.z, blocks_y.z));
        let of_d = block_entry(vec2<u32>(blocks_x.w, blocks_y.w));
        masks = vec4<u32>(masks.x, of_b.x, of_c.x, of_d.x);
        first = vec4<u32>(first.x, of_b.y, of_c.y, of_d.y);
    }
    let bits = vec4<u32>(1u) << (((texels.y & vec4<u32>(3u)) << vec4<u32>(3u)) | (texels.x & vec4<u32>(7u)));
    let heads = first + countOneBits(masks & (bits - 1u));
    return select(vec4<u32>(NO_HEAD), heads, (masks & bits) != vec4<u32>(0u));
}

// Returns the index of the head of a texel, or NO_HEAD.
fn head_of(texel: vec2<u32>) -> u32 {
    let entry = block_entry(texel >> BLOCK_SHIFT);
    let bit = 1u << (((texel.y & 3u) << 3u) | (texel.x & 7u));
    return select(NO_HEAD, entry.y + countOneBits(entry.x & (bit - 1u)), (entry.x & bit) != 0u);
}
