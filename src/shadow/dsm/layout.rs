//! How a deep shadow map's nodes are stored, as `shaders/shadow/dsm/layout.wgsl` reads and writes them.

use crate::field::{TILE_TEXELS, field_shader};
use crate::gpu::{Constant, ShaderVariant};
use crate::shadow::tolerances::OPAQUE_DEPTH;

/// The method's name, by which a built structure is known to hold nodes.
pub const NAME: &str = "dsm";
/// Depth steps of the map's range; the step after them fills rows behind their last node.
pub const DEPTH_STEPS: u32 = 65534;
/// Steps of the regular lattices of one texel's rays together, and how many of them may be marched cell by cell: software
/// adapters end the loops of a thread after 65,536 turns in all, of which a step takes about 6, and a march about 12 more.
pub const MOST_LATTICE_STEPS: u32 = 4096;
pub const MOST_MARCHES: u32 = 3000;
/// Nodes of a row, which ends with a link to the next, and its bytes.
pub const ROW_NODES: u32 = 7;
pub const ROW_BYTES: u64 = (ROW_NODES as u64 + 1) * 4;
/// Texels across the texture of nodes, of which a row takes two.
pub const NODE_TEXTURE_WIDTH: u32 = 4096;
pub const NODE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// Corners of each of the two hulls of a tunnel (`compress=optimal`), a power of two.
pub const HULL_CORNERS: u32 = 16;
/// Depths, in steps, that a tunnel takes for one: 8 units in the last place of the largest float32 depth.
pub const UPRIGHT_STEPS: f64 = 1.0 / 32.0;

const CONSTANTS: &[Constant] = &[
    Constant::unsigned("HULL_CORNERS", HULL_CORNERS),
    Constant::float("UPRIGHT_STEPS", UPRIGHT_STEPS as f32),
    Constant::unsigned("NO_ROW", u32::MAX),
    Constant::unsigned("ROW_NODES", ROW_NODES),
    Constant::unsigned("NODE_TEXTURE_WIDTH", NODE_TEXTURE_WIDTH),
    Constant::float("DEPTH_STEPS", DEPTH_STEPS as f32),
    Constant::unsigned("MOST_ROWS", 2 * (DEPTH_STEPS + 1) / ROW_NODES + 2),
    Constant::unsigned("MOST_LATTICE_STEPS", MOST_LATTICE_STEPS),
    Constant::unsigned("FILLER", DEPTH_STEPS + 1),
    Constant::unsigned("TILE_TEXELS", TILE_TEXELS),
    Constant::float("OPAQUE_DEPTH", OPAQUE_DEPTH),
];

/// A variant that knows how nodes are stored.
pub fn shader(entry: &'static str) -> ShaderVariant {
    field_shader(entry).with_tile_table().modules(&["shadow/dsm/layout.wgsl"]).constants(CONSTANTS)
}
