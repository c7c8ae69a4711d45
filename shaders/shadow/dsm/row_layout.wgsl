// Rows of nodes during the build of a deep shadow map: seven nodes and a link to the next row of the same texel. A row
// takes two texels of a texture; each texel of a built tile has a first row.
#define_import_path umbravox::dsm_row_layout

const NO_ROW: u32 = #{NO_ROW};
const ROW_NODES: u32 = #{ROW_NODES};
const ROWS_WIDTH: u32 = #{ROWS_WIDTH};

fn row_texel(row: u32) -> vec2<u32> {
    return vec2<u32>((2u * row) % ROWS_WIDTH, (2u * row) / ROWS_WIDTH);
}
