//! A transfer function on the device, for one volume: tables, active bricks and their distances.

use super::device_volume::DeviceVolume;
use super::layouts::Layouts;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, table_texture, uniform_buffer};
use crate::transfer::{MAX_INTERVALS, PAIR_BINS, TransferFunction, TransferTables, VALUE_BINS};
use crate::volume::{ActiveBricks, BRICK_CELLS, Bricks, Volume};
use bytemuck::{Pod, Zeroable};
use std::time::Instant;

/// `Field` of `shaders/common/field.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct FieldUniform {
    pub size: [u32; 3],
    pub min_spacing_mm: f32,
    pub inv_size: [f32; 3],
    pub intervals: u32,
    pub active_lo: [f32; 3],
    pub first_value: f32,
    pub active_hi: [f32; 3],
    pub last_value: f32,
    pub bin_origin: f32,
    pub bins_per_value: f32,
    pub table_origin: f32,
    pub table_per_value: f32,
    pub inv_reference_length: f32,
    pub padding: [f32; 3],
}

/// `IntervalTable` of `shaders/common/transfer.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct IntervalTable {
    pub intervals: [[f32; 4]; MAX_INTERVALS],
    pub of_bin: [[u32; 4]; VALUE_BINS / 4],
}

fn interval_table(tables: &TransferTables) -> Result<Box<IntervalTable>> {
    let n = tables.intervals.len();
    if n > MAX_INTERVALS {
        let why = format!("{n} pieces between its points, at most {MAX_INTERVALS} are drawn");
        return Err(Error::input("cannot use transfer function", "its points", why));
    }
    let mut table = Box::new(IntervalTable::zeroed());
    table.intervals[..n].copy_from_slice(&tables.intervals);
    for (bins, four) in table.of_bin.iter_mut().zip(tables.interval_of_bin.chunks_exact(4)) {
        bins.copy_from_slice(four);
    }
    Ok(table)
}

/// What a transfer function edit makes anew; the volume stays where it is.
pub struct DeviceTransfer {
    pub(crate) bind_group: wgpu::BindGroup,
    pub active: ActiveBricks,
    /// Milliseconds on the host to make the tables and to classify the bricks.
    pub table_ms: f64,
    pub classify_ms: f64,
    pub bytes: u64,
    /// The light march needs the integrals over the value besides the pre-compressed table.
    pub many_breakpoints: bool,
    /// No value of the volume has extinction.
    pub empty: bool,
}

impl DeviceTransfer {
    /// Tables and brick classes of `tf` on `volume`.
    pub fn new(
        gpu: &Gpu,
        layouts: &Layouts,
        volume: &Volume,
        on_device: &DeviceVolume,
        bricks: &Bricks,
        tf: &TransferFunction,
    ) -> Result<Self> {
        let start = Instant::now();
        // The longest stretch inside a cell is its diagonal.
        let segment_mm = volume.spacing_mm().iter().map(|s| s * s).sum::<f64>().sqrt();
        let tables = TransferTables::build(tf, on_device.mapping, on_device.texel_range, segment_mm);
        let table_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        // Integrals are linear inside a table's bin, and so a bin at the edge of a peak has some extinction all over.
        let bin = on_device.mapping.scale / f64::from(tables.table_per_value);
        let active = bricks.classify_blurred(tf, bin);
        let classify_ms = start.elapsed().as_secs_f64() * 1e3;

        let (active_lo, active_hi) = grid_box(&active, on_device.dims);
        let uniform = FieldUniform {
            size: on_device.dims.map(|n| n as u32),
            min_spacing_mm: volume.min_spacing_mm() as f32,
            inv_size: on_device.dims.map(|n| 1.0 / n as f32),
            intervals: tables.intervals.len() as u32,
            active_lo,
            first_value: tables.first_value,
            active_hi,
            last_value: tables.last_value,
            bin_origin: tables.bin_origin,
            bins_per_value: tables.bins_per_value,
            table_origin: tables.table_origin,
            table_per_value: tables.table_per_value,
            inv_reference_length: tables.inv_reference_length,
            padding: [0.0; 3],
        };
        let distances = distance_texture(gpu, &active);
        let field = uniform_buffer(gpu, "field", &uniform);
        let intervals = uniform_buffer(gpu, "transfer intervals", &*interval_table(&tables)?);
        let (edges, pairs) = (tables.integrals.len() as u32, PAIR_BINS as u32);
        let float = wgpu::TextureFormat::Rgba32Float;
        let integrals = table_texture(gpu, "transfer integrals", float, [edges, 1], &tables.integrals)?;
        let words = wgpu::TextureFormat::Rg32Uint;
        let pair_nodes =
            table_texture(gpu, "pre-compressed table", words, [pairs, pairs], &tables.pair_nodes)?;
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("field"),
            layout: &layouts.field,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: field.as_entire_binding() },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::TextureView(&on_device.view),
                },
                wgpu::BindGroupEntry {
                    binding: 2,
                    resource: wgpu::BindingResource::Sampler(&layouts.linear_clamp),
                },
                wgpu::BindGroupEntry { binding: 3, resource: wgpu::BindingResource::TextureView(&distances) },
                wgpu::BindGroupEntry { binding: 4, resource: intervals.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 5, resource: wgpu::BindingResource::TextureView(&integrals) },
                wgpu::BindGroupEntry {
                    binding: 6,
                    resource: wgpu::BindingResource::TextureView(&pair_nodes),
                },
            ],
        });
        Ok(Self {
            bind_group,
            empty: active.active == 0,
            many_breakpoints: tables.many_breakpoints,
            bytes: tables.bytes() + active.distance.len() as u64,
            active,
            table_ms,
            classify_ms,
        })
    }
}

impl DeviceTransfer {
    /// Definitions that `common/march.wgsl` needs for this transfer function.
    pub fn march_defs(&self) -> Option<&'static str> {
        self.many_breakpoints.then_some("MANY_BREAKPOINTS")
    }
}

/// Grid-space box (index + 1) of the active bricks, clipped to the domain; empty at the origin where there is none.
fn grid_box(active: &ActiveBricks, dims: [usize; 3]) -> ([f32; 3], [f32; 3]) {
    let Some([lo, hi]) = active.bounds else { return ([0.0; 3], [0.0; 3]) };
    let low = std::array::from_fn(|a| ((lo[a] * BRICK_CELLS) as f32).max(0.5));
    let high = std::array::from_fn(|a| (((hi[a] + 1) * BRICK_CELLS) as f32).min(dims[a] as f32 + 0.5));
    (low, high)
}

fn distance_texture(gpu: &Gpu, active: &ActiveBricks) -> wgpu::TextureView {
    use wgpu::util::DeviceExt;
    let [width, height, depth_or_array_layers] = active.counts.map(|n| n as u32);
    gpu.device
        .create_texture_with_data(
            &gpu.queue,
            &wgpu::TextureDescriptor {
                label: Some("brick distances"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D3,
                format: wgpu::TextureFormat::R8Uint,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            },
            wgpu::util::TextureDataOrder::LayerMajor,
            &active.distance,
        )
        .create_view(&Default::default())
}
