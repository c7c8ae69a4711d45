//! Memory layout of the curve nodes of a deep shadow map, as in `shaders/shadow/dsm/layout.wgsl`.

use crate::field::{TILE_TEXELS, field_shader};
use crate::gpu::quirks::MAX_LATTICE_STEPS;
use crate::gpu::{Constant, ShaderVariant};
use crate::shadow::tolerances::OPAQUE_DEPTH;

/// Name of the deep shadow map method on the command line and in tables.
pub const NAME: &str = "dsm";
/// Number of quantization steps of a curve node's depth over the depth range of a deep shadow map. The next step
/// marks unused entries behind the last node.
pub const DEPTH_STEPS: u32 = 65534;
/// Number of curve nodes in one row, the unit of storage of a deep shadow map, and its size in bytes. Each row ends
/// with a link to the next row of the texel.
pub const ROW_NODES: u32 = 7;
pub const ROW_BYTES: u64 = (ROW_NODES as u64 + 1) * 4;
/// Width in texels of the texture that stores the curve nodes of a deep shadow map; a row of nodes takes two texels.
pub const NODE_TEXTURE_WIDTH: u32 = 4096;
pub const NODE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// Capacity in corners of each of the two convex hulls of the tunnel in Imai and Iri's algorithm
/// (`compress=optimal`); a power of two.
pub const HULL_CORNERS: u32 = 16;
/// Difference of two depths, in quantization steps, that the optimal compression of a deep shadow map treats as zero:
/// 8 units in the last place of the largest float32 depth.
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

/// Returns a shader variant with the memory layout of deep shadow map nodes.
pub fn shader(entry: &'static str) -> ShaderVariant {
    field_shader(entry).with_tile_table().modules(&["shadow/dsm/layout.wgsl"]).constants(CONSTANTS)
}
