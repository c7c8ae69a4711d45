//! Textures and uniforms with the lookup tables of a transfer function, and textures with the distances of bricks (blocks
//! of voxel cells).

use super::{ActiveBricks, DisabledOptimizations, Optimization};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, solid_texture, table_texture, write_texels};
use crate::transfer::{MAX_INTERVALS, TransferTables, VALUE_BINS};
use bytemuck::{Pod, Zeroable};

/// Uniform with the intervals between the control points of a transfer function: `IntervalTable` of
/// `shaders/field/transfer.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct IntervalTable {
    pub intervals: [[f32; 4]; MAX_INTERVALS],
    pub of_bin: [[u32; 4]; VALUE_BINS / 4],
}

/// Returns the uniform with the intervals of a transfer function.
///
/// # Errors
/// The transfer function has more intervals than the uniform holds.
pub(super) fn interval_table(tables: &TransferTables) -> Result<Box<IntervalTable>> {
    let n = tables.intervals.len();
    if n > MAX_INTERVALS {
        let why = format!("{n} pieces between its points, at most {MAX_INTERVALS} are drawn");
        return Err(Error::input("cannot use transfer function", "its points", why));
    }
    let mut table = Box::new(IntervalTable::zeroed());
    table.intervals[..n].copy_from_slice(&tables.intervals);
    bytemuck::cast_slice_mut(&mut table.of_bin).copy_from_slice(&tables.interval_of_bin);
    Ok(table)
}

/// Creates the lookup table of the transfer function's colour integrals over the voxel value. With only one colour,
/// it is a single texel.
pub(super) fn color_integrals(
    gpu: &Gpu,
    tables: &TransferTables,
    one_color: Option<[f32; 3]>,
) -> Result<wgpu::TextureView> {
    let texels = if one_color.is_some() { &[[0.0; 4]][..] } else { &tables.integrals };
    row_texture(gpu, "transfer integrals", texels)
}

/// Creates a texture of one row of four-vectors.
///
/// # Errors
/// The row is longer than the adapter's textures may be.
pub(super) fn row_texture(gpu: &Gpu, label: &str, texels: &[[f32; 4]]) -> Result<wgpu::TextureView> {
    table_texture(gpu, label, wgpu::TextureFormat::Rgba32Float, [texels.len() as u32, 1], texels)
}

/// Creates the texture of the distance of every brick (block of voxel cells) to the nearest active brick.
pub(super) fn distance_texture(
    gpu: &Gpu,
    active: &ActiveBricks,
    disabled: DisabledOptimizations,
) -> wgpu::TextureView {
    let none_empty = disabled.has(Optimization::Bricks).then(|| vec![0; active.distance.len()]);
    let counts = active.counts.map(|n| n as u32);
    let texture = solid_texture(gpu, "brick distances", wgpu::TextureFormat::R8Uint, counts);
    write_texels(gpu, &texture, [0; 3], counts, none_empty.as_ref().unwrap_or(&active.distance));
    texture.create_view(&Default::default())
}

/// Returns a texture of one texel in place of the lookup table of transfer-function breakpoints, for pipelines that
/// do not read the table.
pub(super) fn no_pairs(gpu: &Gpu) -> Result<wgpu::TextureView> {
    table_texture(gpu, "no pre-compressed table", wgpu::TextureFormat::Rg32Uint, [1, 1], &[[0u32; 2]])
}
