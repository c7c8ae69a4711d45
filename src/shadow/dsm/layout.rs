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
/// Number of curve nodes in one row, the unit of storage of a deep shadow map. Each row ends with a link to the next
/// row of the same texel.
pub const ROW_NODES: u32 = 7;
/// Size of a row of curve nodes with its link, bytes.
pub const ROW_BYTES: u64 = (ROW_NODES as u64 + 1) * 4;
/// Width in texels of the texture that stores the curve nodes of a deep shadow map; a row of nodes takes two texels.
pub const NODE_TEXTURE_WIDTH: u32 = 4096;
pub const NODE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

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
    Constant::unsigned("NODE_TEXTURE_WIDTH", NODE_TEXTURE_WIDTH),
    Constant::float("DEPTH_STEPS", DEPTH_STEPS as f32),
    Constant::unsigned("MAX_ROWS", 2 * (DEPTH_STEPS + 1) / ROW_NODES + 2),
    Constant::unsigned("MAX_LATTICE_STEPS", MAX_LATTICE_STEPS),
    Constant::unsigned("FILLER", DEPTH_STEPS + 1),
    Constant::unsigned("TILE_TEXELS", TILE_TEXELS),
    Constant::float("OPAQUE_DEPTH", OPAQUE_DEPTH),
];

/// Returns the shader with the given entry file, together with the code for the memory layout of deep shadow map
/// nodes.
pub fn shader(entry: &'static str) -> ShaderVariant {
    field_shader(entry).with_tile_table().modules(&["shadow/dsm/layout.wgsl"]).constants(CONSTANTS)
}
