// The layout table of a tiled deep shadow map (Hadwiger et al. 2006, 3.4), and where a row of nodes lies in its texture.
#define_import_path umbravox::deep_layout

const NO_TILE: u32 = 0xffffffffu;
const NO_ROW: u32 = 0xffffffffu;
const ROW_NODES: u32 = 7u;
// Texels across the texture of nodes; a row is two texels of four words.
const NODE_TEXTURE_WIDTH: u32 = 4096u;

// First of each tile's 256 rows of nodes, or NO_TILE where it holds no active brick; a texel a tile.
@group(1) @binding(1) var tiles: texture_2d<u32>;

fn row_texel(row: u32) -> vec2<u32> {
    return vec2<u32>((2u * row) % NODE_TEXTURE_WIDTH, (2u * row) / NODE_TEXTURE_WIDTH);
}
