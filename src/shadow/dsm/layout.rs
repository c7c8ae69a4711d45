//! Memory layout of the curve nodes in a deep shadow map, as in `shaders/shadow/dsm/layout.wgsl`.

use crate::field::{TILE_TEXELS, field_shader};
use crate::gpu::tuning::MAX_LATTICE_STEPS;
use crate::gpu::{Constant, ShaderVariant};
use crate::shadow::tolerances::OPAQUE_DEPTH;

/// Name of the deep shadow map method on the command line and in tables.
pub const NAME: &str = "dsm";
/// Largest stored depth of a curve node, an integer that stands for the far end of a deep shadow map. The next
/// integer marks unused entries behind a texel's last node.
pub const DEPTH_STEPS: u32 = 65534;
/// Number of curve nodes in one row, the unit of storage during the build. Each row ends with a link to the next row of
/// the same texel.
pub const ROW_NODES: u32 = 7;
/// Number of quads (four words) in a row of curve nodes with its link.
pub const ROW_QUADS: u32 = (ROW_NODES + 1) / 4;
/// Binary logarithm of the width, in texels, of the texture that stores rows of curve nodes.
pub const ROWS_WIDTH_SHIFT: u32 = 12;
/// Format of textures of curve nodes. A texel is a quad: four words.
pub const NODE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;
/// Size of a quad, bytes.
pub const QUAD_BYTES: u64 = 16;
/// Format of the directory of a finished map, with one texel for each block of texels.
pub const DIRECTORY_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
/// Size of a block of shadow map texels on each axis, texels.
pub const BLOCK: [u32; 2] = [8, 4];
/// Number of blocks in a tile of the shadow map.
pub const TILE_BLOCKS: u32 = TILE_TEXELS / (BLOCK[0] * BLOCK[1]);

/// Largest number of corners of each convex hull in Imai and Iri's simplification of a transmittance curve
/// (`compress=optimal`); a power of two. One hull bounds the error band from above, the other from below.
pub const HULL_CORNERS: u32 = 16;
/// Largest difference of two depths, in quantization steps, that `compress=optimal` of a deep shadow map treats as
/// zero: 8 units in the last place of the largest float32 depth.
pub const UPRIGHT_STEPS: f64 = 1.0 / 32.0;

const CONSTANTS: &[Constant] = &[
    Constant::unsigned("HULL_CORNERS", HULL_CORNERS),
    Constant::float("UPRIGHT_STEPS", UPRIGHT_STEPS as f32),
    Constant::unsigned("NO_ROW", u32::MAX),
    Constant::unsigned("ROW_NODES", ROW_NODES),
    Constant::unsigned("ROWS_WIDTH", 1 << ROWS_WIDTH_SHIFT),
    Constant::float("DEPTH_STEPS", DEPTH_STEPS as f32),
    Constant::unsigned("MAX_NODES", 2 * (DEPTH_STEPS + 1)),
    Constant::unsigned("MAX_LATTICE_STEPS", MAX_LATTICE_STEPS),
    Constant::unsigned("FILLER", DEPTH_STEPS + 1),
    Constant::unsigned("TILE_TEXELS", TILE_TEXELS),
    Constant::float("OPAQUE_DEPTH", OPAQUE_DEPTH),
];

/// WGSL modules of the rows that a build writes, and of its counters.
const ROW_MODULES: [&str; 2] = ["shadow/dsm/row_layout.wgsl", "shadow/dsm/counters.wgsl"];

/// Side on which a curve bounds the exact transmittance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    Lower,
    Upper,
}

impl Side {
    pub const BOTH: [Self; 2] = [Self::Lower, Self::Upper];

    /// Returns the preprocessor definition of a shader for this side.
    pub fn def(self) -> &'static str {
        match self {
            Self::Lower => "LOWER",
            Self::Upper => "UPPER",
        }
    }
}

fn shader(entry: &'static str) -> ShaderVariant {
    field_shader(entry)
        .with_tile_table()
        .modules(&["shadow/segments.wgsl", "shadow/dsm/layout.wgsl"])
        .constants(CONSTANTS)
}

/// Returns a shader that reads the curve nodes of a finished map, through its directory.
pub fn map_shader(entry: &'static str) -> ShaderVariant {
    shader(entry).modules(&["shadow/dsm/directory.wgsl"])
}

/// Returns a shader of the build: it writes rows of curve nodes.
pub fn rows_shader(entry: &'static str) -> ShaderVariant {
    shader(entry).modules(&ROW_MODULES)
}

/// Returns the shader that writes the directory of a map.
pub fn allocate_shader() -> ShaderVariant {
    map_shader("shadow/dsm/allocate.wgsl").modules(&ROW_MODULES)
}

/// Returns the shader that copies curve nodes from rows to the finished map.
pub fn compact_shader() -> ShaderVariant {
    rows_shader("shadow/dsm/compact.wgsl")
}
