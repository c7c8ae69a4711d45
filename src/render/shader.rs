//! Numeric constants that the host shares with the rendering shaders.

use crate::field::LINE_THREADS;
use crate::gpu::{Constant, ShaderVariant, tuning};

/// Number of threads per side of a square workgroup that processes pixels of a picture.
pub const PICTURE_SIDE: u32 = 8;

pub const CONSTANTS: &[Constant] = &[
    Constant::unsigned("PICTURE_SIDE", PICTURE_SIDE),
    Constant::unsigned("LINE_THREADS", LINE_THREADS),
    Constant::unsigned("BLOCK_SIDE", tuning::BLOCK_SIDE),
    // Strength and exponent of the highlight of every shading that has one.
    Constant::float("HIGHLIGHT", 0.3),
    Constant::float("GLOSS", 32.0),
];

/// Returns the number of workgroups along each axis that cover a part of a picture of `width x height` pixels.
pub fn picture_workgroups(width: u32, height: u32) -> [u32; 3] {
    [width.div_ceil(PICTURE_SIDE), height.div_ceil(PICTURE_SIDE), 1]
}

/// Shader definition (`#ifdef`) for tiles of the picture that a pass on the device has found.
pub const DEVICE_TILES: &str = "DEVICE_TILES";

/// Returns the shader that fills tiles of a picture with the background. With `device_tiles`, a pass on the device has
/// found these tiles.
pub fn background_shader(device_tiles: bool) -> ShaderVariant {
    let modules = ["render/tile_depths.wgsl", "render/frame.wgsl"];
    ShaderVariant::of("render/background.wgsl")
        .modules(&modules)
        .constants(CONSTANTS)
        .defs(device_tiles.then_some(DEVICE_TILES))
}
