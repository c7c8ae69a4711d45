//! A transfer function on the device, for one volume: tables, active bricks and their distances.

use super::fold::FoldUniform;
use super::seen_function::SeenFunction;
use super::{ActiveBricks, Forced, LoadedVolume, Omittable, grid_from_world, marches_cells};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Group, ShaderVariant, Slot, clamp_sampler, table_texture, uniform_buffer};
use crate::transfer::{
    ClipPlane, MAX_INTERVALS, MOST_CLIP_PLANES, PAIR_BINS, PairTable, TexelMapping, TransferFunction,
    TransferTables, VALUE_BINS,
};
use crate::volume::{BRICK_CELLS, Volume};
use bytemuck::{Pod, Zeroable};
use std::sync::OnceLock;
use std::time::Instant;

/// `Field` of `shaders/field/field.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct FieldUniform {
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
    pub color_r: f32,
    pub color_g: f32,
    pub color_b: f32,
    pub hidden_value: f32,
    pub padding: [f32; 3],
    pub clip: [[f32; 4]; MOST_CLIP_PLANES],
    // Read by variants for a folded texture alone.
    pub fold: FoldUniform,
}

/// `IntervalTable` of `shaders/field/transfer.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct IntervalTable {
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
    /// Which bricks have extinction.
    pub active: ActiveBricks,
    /// Milliseconds on the host to make the tables.
    pub table_ms: f64,
    /// Milliseconds on the host to classify the bricks.
    pub classify_ms: f64,
    /// Bytes of tables (without the pre-compressed one, see [`MarchTable`]) and of the bricks' distances.
    pub bytes: u64,
    /// No value of the volume has extinction.
    pub empty: bool,
    /// Everything with extinction has one colour, and the integrals hold none.
    pub one_color: bool,
    /// The function has clip planes.
    pub clips: bool,
    /// The volume has labels, and some of them are seen otherwise than others.
    labelled: bool,
    /// What is forced back on in everything that is made from this.
    pub forced: Forced,
    uniform: FieldUniform,
    /// The volume's texture is folded.
    folded: bool,
    bindings: Bindings,
    /// Group 0 without a pre-compressed table.
    plain_group: Group,
    march: OnceLock<MarchTable>,
    /// What the intervals are of, and the pre-compressed table is made of when it is first needed.
    tf: TransferFunction,
    mapping: TexelMapping,
    largest_texel: f64,
}

/// The pre-compressed table on the device.
pub struct MarchTable {
    /// Group 0 with the table.
    group: Group,
    view: wgpu::TextureView,
    /// The light march must search for breakpoints besides those that the table holds.
    pub many_breakpoints: bool,
    /// Milliseconds on the host to make it.
    pub table_ms: f64,
    /// Bytes of the table.
    pub bytes: u64,
}

/// What group 0 binds besides the pre-compressed table.
#[derive(Clone)]
struct Bindings {
    field: wgpu::Buffer,
    volume: wgpu::TextureView,
    sampler: wgpu::Sampler,
    distances: wgpu::TextureView,
    intervals: wgpu::Buffer,
    integrals: wgpu::TextureView,
    extinction: wgpu::TextureView,
    /// The labels of voxels, and the shifts of values by label.
    labels: Option<(wgpu::TextureView, wgpu::Buffer)>,
}

impl Bindings {
    fn group(&self, gpu: &Gpu, pair_nodes: &wgpu::TextureView) -> Group {
        let solid = wgpu::TextureViewDimension::D3;
        // Pipelines do not depend on the volume: all of its formats are bound as the least capable one can be.
        let filterable = gpu.filters_float32;
        let values = wgpu::TextureSampleType::Float { filterable };
        let mut slots = vec![
            Slot::uniform(&self.field),
            Slot::texture(&self.volume, values, solid),
            Slot::sampler(&self.sampler, filterable),
            Slot::texture(&self.distances, wgpu::TextureSampleType::Uint, solid),
            Slot::uniform(&self.intervals),
            Slot::floats(&self.integrals),
            Slot::words(pair_nodes),
            Slot::read_write(gpu.watch.binding()),
            Slot::floats(&self.extinction),
        ];
        if let Some((ranks, shifts)) = &self.labels {
            slots.extend([Slot::texture(ranks, wgpu::TextureSampleType::Uint, solid), Slot::uniform(shifts)]);
        }
        Group::new(gpu, "field", &(0..).zip(slots).collect::<Vec<_>>())
    }
}

/// Share of the largest texel value: 2^-19, some 16 roundings of the cubic's terms, the root that a breakpoint is found
/// to, and the breakpoint's own.
const VALUE_ROUNDING: f64 = 1.0 / 524_288.0;

impl DeviceTransfer {
    /// Tables and brick classes of `tf` on `volume`.
    ///
    /// # Errors
    /// A function of too many pieces, or a device out of memory.
    pub fn new(gpu: &Gpu, loaded: &LoadedVolume, tf: &TransferFunction, forced: Forced) -> Result<Self> {
        let LoadedVolume { bricks, on_device, .. } = loaded;
        let start = Instant::now();
        let seen = SeenFunction::of(loaded, tf)?;
        let tables = seen.tables(on_device.mapping);
        let table_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        // Integrals are linear inside a table's bin, and so a bin at the edge of a peak has some extinction all over.
        let bin = on_device.mapping.scale / f64::from(tables.table_per_value);
        let active = ActiveBricks::blurred(bricks, tf, bin);
        let classify_ms = start.elapsed().as_secs_f64() * 1e3;
        let filter = if gpu.filters_float32 { wgpu::FilterMode::Linear } else { wgpu::FilterMode::Nearest };
        let uniform = field_uniform(loaded, &tables, &seen, &active, forced);
        let bindings = Bindings {
            field: uniform_buffer(gpu, "field", &uniform),
            volume: on_device.view.clone(),
            sampler: clamp_sampler(gpu, filter),
            distances: distance_texture(gpu, &active, forced),
            intervals: uniform_buffer(gpu, "transfer intervals", &*interval_table(&tables)?),
            integrals: integral_texture(gpu, &tables, one_color(&seen.function, forced).is_some())?,
            labels: seen.labels(gpu, loaded),
            extinction: extinction_texture(gpu, &tables)?,
        };
        Self {
            empty: active.active == 0,
            bytes: 0,
            active,
            table_ms,
            classify_ms,
            one_color: false,
            clips: !tf.clip.is_empty(),
            forced,
            folded: on_device.fold.is_folded(),
            plain_group: bindings.group(gpu, &no_pairs(gpu)?),
            uniform,
            bindings,
            march: OnceLock::new(),
            mapping: on_device.mapping,
            largest_texel: seen.texel_range.iter().fold(0.0, |most, t| t.abs().max(most)),
            labelled: !seen.shifts.is_empty(),
            tf: seen.function.clone(),
        }
        .with_colors(&tables, &seen.function)
        .forced_tables(gpu)
    }

    /// The function that the tables are of: of a volume with labels, all of its functions side by side.
    pub fn function(&self) -> &TransferFunction {
        &self.tf
    }

    /// The same with other colours, for a function whose extinction is the same at all values that occur: integrals are
    /// made anew; intervals, bricks and the pre-compressed table stay.
    ///
    /// # Errors
    /// A device out of memory.
    pub fn recolored(&self, gpu: &Gpu, loaded: &LoadedVolume, tf: &TransferFunction) -> Result<Self> {
        let start = Instant::now();
        let seen = SeenFunction::of(loaded, tf)?;
        let tables = seen.tables(self.mapping);
        let table_ms = start.elapsed().as_secs_f64() * 1e3;
        let one = one_color(&seen.function, self.forced);
        let [color_r, color_g, color_b] = one.unwrap_or_default().map(|c| c as f32);
        let uniform = FieldUniform { color_r, color_g, color_b, ..self.uniform };
        let bindings = Bindings {
            field: uniform_buffer(gpu, "field", &uniform),
            integrals: integral_texture(gpu, &tables, one.is_some())?,
            ..self.bindings.clone()
        };
        let march = OnceLock::new();
        if let Some(table) = self.march.get() {
            let group = bindings.group(gpu, &table.view);
            let _ = march.set(MarchTable { group, view: table.view.clone(), table_ms: 0.0, ..*table });
        }
        let recolored = Self {
            active: self.active.clone(),
            table_ms,
            classify_ms: 0.0,
            plain_group: bindings.group(gpu, &no_pairs(gpu)?),
            uniform,
            bindings,
            march,
            tf: self.tf.clone(),
            ..*self
        };
        Ok(recolored.with_colors(&tables, &seen.function))
    }

    fn with_colors(self, tables: &TransferTables, tf: &TransferFunction) -> Self {
        let one_color = one_color(tf, self.forced).is_some();
        let bytes = tables.bytes(one_color) + self.active.distance.len() as u64;
        Self { one_color, bytes, ..self }
    }

    fn forced_tables(self, gpu: &Gpu) -> Result<Self> {
        if self.forced.has(Omittable::MarchTable) {
            self.make_march_table(gpu)?;
        }
        Ok(self)
    }

    /// Width of a bin of the integrals in the volume's values.
    pub fn value_bin(&self) -> f64 {
        self.mapping.scale / f64::from(self.uniform.table_per_value)
    }

    /// How far float32 may put a value along a ray from what it is, in the volume's values: a cubic of eight texel values
    /// and the breakpoints that it is compared with; see `docs/bound.md`, "Values".
    pub fn value_rounding(&self) -> f64 {
        VALUE_ROUNDING * self.largest_texel * self.mapping.scale
    }

    /// The pre-compressed table, where something has needed it.
    pub fn march_table(&self) -> Option<&MarchTable> {
        self.march.get()
    }

    /// The pre-compressed table, made when it is first asked for.
    ///
    /// # Errors
    /// A device out of memory.
    pub fn make_march_table(&self, gpu: &Gpu) -> Result<&MarchTable> {
        if let Some(made) = self.march.get() {
            return Ok(made);
        }
        let start = Instant::now();
        let pairs = PairTable::build(&self.tf, self.mapping);
        let table_ms = start.elapsed().as_secs_f64() * 1e3;
        let side = PAIR_BINS as u32;
        let format = wgpu::TextureFormat::Rg32Uint;
        let view = table_texture(gpu, "pre-compressed table", format, [side, side], &pairs.nodes)?;
        Ok(self.march.get_or_init(|| MarchTable {
            group: self.bindings.group(gpu, &view),
            many_breakpoints: pairs.many_breakpoints,
            bytes: pairs.bytes(),
            table_ms,
            view,
        }))
    }

    /// Group 0.
    pub fn group(&self) -> &Group {
        self.march.get().map_or(&self.plain_group, |table| &table.group)
    }

    /// A variant as this function and its volume need it: lines end at clip planes where there are some, values are shifted by
    /// label, texels found in a folded texture; where it marches cell by cell, the pre-compressed table is made now if it has
    /// not been, and breakpoints that it cannot hold are searched for.
    ///
    /// # Errors
    /// A device out of memory.
    pub fn prepared(&self, gpu: &Gpu, variant: ShaderVariant) -> Result<ShaderVariant> {
        let needs = [(self.clips, "CLIP"), (self.labelled, "LABELS"), (self.folded, "FOLDED")];
        let variant = variant.defs(needs.into_iter().filter_map(|(needed, name)| needed.then_some(name)));
        if !marches_cells(&variant) {
            return Ok(variant);
        }
        let many = self.make_march_table(gpu)?.many_breakpoints;
        let search = many || self.forced.has(Omittable::BreakpointSearch);
        Ok(variant.defs(search.then_some("MANY_BREAKPOINTS")))
    }
}

/// The linear RGB colour of everything with extinction, where there is just one.
fn one_color(tf: &TransferFunction, forced: Forced) -> Option<[f64; 3]> {
    tf.one_color().filter(|_| !forced.has(Omittable::Colors))
}

/// Stands for the pre-compressed table in pipelines that do not read it.
fn no_pairs(gpu: &Gpu) -> Result<wgpu::TextureView> {
    table_texture(gpu, "no pre-compressed table", wgpu::TextureFormat::Rg32Uint, [1, 1], &[[0u32; 2]])
}

fn field_uniform(
    loaded: &LoadedVolume,
    tables: &TransferTables,
    seen: &SeenFunction,
    active: &ActiveBricks,
    forced: Forced,
) -> FieldUniform {
    let dims = loaded.on_device.dims;
    let (active_lo, active_hi) = if forced.has(Omittable::Bricks) {
        ([0.5; 3], dims.map(|n| n as f32 + 0.5))
    } else {
        grid_box(active, dims)
    };
    let [color_r, color_g, color_b] = one_color(&seen.function, forced).unwrap_or_default().map(|c| c as f32);
    let [first_value, last_value] = seen.extinct.unwrap_or([tables.first_value, tables.last_value]);
    FieldUniform {
        size: dims.map(|n| n as u32),
        min_spacing_mm: loaded.volume.min_spacing_mm() as f32,
        inv_size: dims.map(|n| 1.0 / n as f32),
        intervals: tables.intervals.len() as u32,
        active_lo,
        first_value,
        active_hi,
        last_value,
        bin_origin: tables.bin_origin,
        bins_per_value: tables.bins_per_value,
        table_origin: tables.table_origin,
        table_per_value: tables.table_per_value,
        inv_reference_length: tables.inv_reference_length,
        color_r,
        color_g,
        color_b,
        hidden_value: seen.hidden_texel,
        padding: [0.0; 3],
        clip: clip_planes(&loaded.volume, &seen.function.clip),
        fold: loaded.on_device.fold.uniform(),
    }
}

/// Clip planes in a volume's grid space, and behind them such that keep everything.
fn clip_planes(volume: &Volume, clip: &[ClipPlane]) -> [[f32; 4]; MOST_CLIP_PLANES] {
    let mut planes = [[0.0, 0.0, 0.0, -1.0]; MOST_CLIP_PLANES];
    let world_from_grid = grid_from_world(volume).inverse();
    for (plane, given) in planes.iter_mut().zip(clip) {
        let (normal, offset) = given.in_coordinates(world_from_grid);
        // Of length 1 here too, so that float32 rounds it alike in voxels of all sizes.
        *plane = (normal.extend(offset) / normal.length()).as_vec4().to_array();
    }
    planes
}

/// The integrals of extinction over the value.
fn extinction_texture(gpu: &Gpu, tables: &TransferTables) -> Result<wgpu::TextureView> {
    let size = [tables.extinction_bins.len() as u32, 1];
    table_texture(
        gpu,
        "extinction integrals",
        wgpu::TextureFormat::Rgba32Float,
        size,
        &tables.extinction_bins,
    )
}

/// The integrals of extinction and its colour over the value; nothing where there is one colour.
fn integral_texture(gpu: &Gpu, tables: &TransferTables, one_color: bool) -> Result<wgpu::TextureView> {
    let edges = if one_color { &[[0.0; 4]][..] } else { &tables.integrals };
    let format = wgpu::TextureFormat::Rgba32Float;
    table_texture(gpu, "transfer integrals", format, [edges.len() as u32, 1], edges)
}

/// Grid-space box (index + 1) of the active bricks, clipped to the domain; empty at the origin where there is none.
fn grid_box(active: &ActiveBricks, dims: [usize; 3]) -> ([f32; 3], [f32; 3]) {
    let Some([lo, hi]) = active.bounds else { return ([0.0; 3], [0.0; 3]) };
    let low = std::array::from_fn(|a| ((lo[a] * BRICK_CELLS) as f32).max(0.5));
    let high = std::array::from_fn(|a| (((hi[a] + 1) * BRICK_CELLS) as f32).min(dims[a] as f32 + 0.5));
    (low, high)
}

fn distance_texture(gpu: &Gpu, active: &ActiveBricks, forced: Forced) -> wgpu::TextureView {
    use wgpu::util::DeviceExt;
    let none_empty = forced.has(Omittable::Bricks).then(|| vec![0; active.distance.len()]);
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
            none_empty.as_ref().unwrap_or(&active.distance),
        )
        .create_view(&Default::default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::field_shader;
    use crate::gpu::assert_layout;

    #[test]
    fn uniforms_have_one_layout() {
        let shader =
            field_shader("render/query.wgsl").with_depth_march().modules(&["shadow/rays/lookup.wgsl"]);
        let shader = shader.defs(["FOLDED"]);
        assert_layout!(&shader, "Fold", FoldUniform: period, tiles, placed, stride, margin, inv_sides);
        assert_layout!(&shader, "Field", FieldUniform: size, min_spacing_mm, inv_size, intervals, active_lo,
            first_value, active_hi, last_value, bin_origin, bins_per_value, table_origin, table_per_value,
            inv_reference_length, color_r, color_g, color_b, hidden_value, clip, fold);
        assert_layout!(&shader, "IntervalTable", IntervalTable: intervals, of_bin);
    }
}
