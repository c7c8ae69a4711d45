//! Transfer function of a volume on the graphics device: its lookup tables, the active bricks (blocks of cells with
//! extinction), and the distance of every brick to them.

use super::device_volume::VolumeTextures;
use super::field_bindings::FieldBindings;
use super::gradient_uniform::gradient_uniform;
use super::merged_function::MergedFunction;
use super::transfer_textures::{color_integrals, distance_texture, interval_table, no_pairs, row_texture};
use super::{
    ActiveBricks, DisabledOptimizations, LoadedVolume, Optimization, PageStream, PageUsage, SharedBuffers,
    grid_from_world, marches_cells,
};
use crate::error::Result;
use crate::gpu::{Gpu, Group, ShaderVariant, StorageBuffer, clamp_sampler, table_texture, uniform_buffer};
use crate::transfer::{
    ClipPlane, ExtinctionRanges, MOST_CLIP_PLANES, PAIR_BINS, PairTable, TexelMapping, TransferFunction,
};
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Uniform of a volume and its transfer function: `Field` of `shaders/field/field.wgsl`.
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
    // Read by variants for pages alone.
    pub page_counts: [i32; 3],
    pub word_sign: f32,
    pub word_offset: f32,
    pub padding_of_pages: [f32; 3],
}

/// Device data that depend on the transfer function. Each edit of the transfer function replaces them; the volume
/// texture stays.
pub struct DeviceTransfer {
    /// Active bricks of the volume: blocks of cells with extinction under the transfer function.
    pub active: ActiveBricks,
    /// Host time to compute the lookup tables of the transfer function, ms.
    pub table_ms: f64,
    /// Host time to classify the volume's bricks (blocks of voxel cells) as active or empty, ms.
    pub classify_ms: f64,
    /// Size on the device of the transfer function's lookup tables and the brick distances, bytes. The breakpoint
    /// table for the light march is not included; see [`MarchTable`].
    pub bytes: u64,
    /// Whether the volume has no extinction at all under the transfer function.
    pub empty: bool,
    /// Whether the transfer function has one colour wherever it has extinction. Its lookup tables then store no
    /// colour.
    pub one_color: bool,
    /// Whether the transfer function has clip planes.
    pub clips: bool,
    /// Whether segmentation labels of the volume use different transfer functions.
    pub has_labels: bool,
    /// Whether the extinction depends on the gradient magnitude of the value, too. Shadow maps then have no error bound.
    pub has_gradient_opacity: bool,
    /// Renderer optimizations, such as skipping empty bricks, that the user disables with `--no-skip`.
    pub disabled: DisabledOptimizations,
    uniform: FieldUniform,
    /// Memory of the volume's pages on the device; `None` if the volume is one texture.
    pub pages: Option<PageUsage>,
    /// Stream of the volume's pages; `None` if all needed pages are resident.
    stream: Option<Arc<PageStream>>,
    /// Whether texels of the volume are whole numbers.
    has_words: bool,
    bindings: FieldBindings,
    /// Bind group 0 of the shaders that do not read the lookup table of transfer-function breakpoints.
    plain_group: Group,
    march: OnceLock<MarchTable>,
    /// Number and positions of the outer active bricks on the device.
    outer_bricks: OnceLock<(u32, wgpu::Buffer)>,
    /// Buffers of shadow methods that do not depend on a light.
    shared: SharedBuffers,
    /// Transfer function from which the lookup tables on the device were computed.
    tf: TransferFunction,
    mapping: TexelMapping,
    largest_texel: f64,
    /// Offsets of the values of labels (`MergedFunction::value_shifts`).
    pub label_shifts: Vec<Option<f64>>,
}

/// Breakpoint table on the device: for each two voxel values, the control points of the transfer function between
/// them (the pre-compressed table of Hadwiger et al. 2006, 3.2).
pub struct MarchTable {
    /// Bind group 0 of the shaders that read the lookup table of transfer-function breakpoints.
    group: Group,
    view: wgpu::TextureView,
    /// Whether some entries of the breakpoint table cannot hold all breakpoints of the transfer function, so that the
    /// light march has to search for them.
    pub many_breakpoints: bool,
    /// Host time to compute the lookup table of transfer-function breakpoints between two voxel values, ms.
    pub table_ms: f64,
    /// Size on the device of the lookup table of transfer-function breakpoints between two voxel values, bytes.
    pub bytes: u64,
}

/// Largest float32 error of an interpolated voxel value along a ray, relative to the largest texel value: 2^-19. It
/// covers about 16 roundings in trilinear interpolation, and rounding and root tolerance of a breakpoint.
const VALUE_ROUNDING: f64 = 1.0 / 524_288.0;

impl DeviceTransfer {
    /// Computes the lookup tables of a transfer function on the device, and classifies the volume's bricks (blocks of
    /// voxel cells) as active or empty.
    ///
    /// # Errors
    /// The transfer function has more intervals between control points than the device tables hold, or the device is
    /// out of memory.
    pub fn new(
        gpu: &Gpu,
        loaded: &LoadedVolume,
        tf: &TransferFunction,
        disabled: DisabledOptimizations,
    ) -> Result<Self> {
        let on_device = &loaded.on_device;
        let start = Instant::now();
        let merged = MergedFunction::of(loaded, tf)?;
        let tables = &merged.tables;
        let table_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        // Integrals are linear within a bin of the table, and so a bin at the edge of a peak has extinction
        // everywhere.
        let bin = on_device.mapping.scale / f64::from(tables.table_per_value);
        let active = ActiveBricks::blurred(loaded.volume.bricks(), tf, bin);
        let classify_ms = start.elapsed().as_secs_f64() * 1e3;
        let filter = if gpu.filters_float32 { wgpu::FilterMode::Linear } else { wgpu::FilterMode::Nearest };
        let one_color = one_color(&merged.function, disabled);
        let textures = on_device.textures(gpu, &loaded.volume, &active, (tf, bin))?;
        let has_words = textures.pages.as_ref().is_some_and(|pages| pages.of_words.is_some());
        let stream = textures.pages.as_ref().and_then(|pages| pages.residency.stream().cloned());
        let uniform = field_uniform((loaded, &textures), &merged, one_color, &active, disabled);
        let bindings = FieldBindings {
            field: uniform_buffer(gpu, "field", &uniform),
            volume: textures.values.clone(),
            page_table: textures.pages.as_ref().map(|pages| pages.residency.table()),
            waiting_pages: stream.as_ref().map(|stream| stream.waiting().clone()),
            has_words,
            sampler: clamp_sampler(gpu, filter),
            distances: distance_texture(gpu, &active, disabled),
            intervals: uniform_buffer(gpu, "transfer intervals", &*interval_table(tables)?),
            integrals: color_integrals(gpu, tables, one_color)?,
            labels: merged.labels(gpu, textures.labels.as_ref()),
            gradient: gradient_uniform(gpu, &loaded.volume, tf, on_device.mapping),
            extinction: row_texture(gpu, "extinction integrals", &tables.extinction_bins)?,
        };
        let made = Self {
            empty: active.active == 0,
            bytes: tables.bytes(one_color.is_some()) + active.distance.len() as u64,
            active,
            table_ms,
            classify_ms,
            one_color: one_color.is_some(),
            clips: !tf.clip.is_empty(),
            disabled,
            pages: textures.pages.as_ref().map(|pages| pages.usage),
            stream,
            has_words,
            plain_group: bindings.group(gpu, &no_pairs(gpu)?),
            uniform,
            bindings,
            march: OnceLock::new(),
            outer_bricks: OnceLock::new(),
            shared: SharedBuffers::default(),
            mapping: on_device.mapping,
            largest_texel: merged.largest_texel,
            has_labels: !merged.shifts.is_empty(),
            has_gradient_opacity: tf.gradient_opacity.is_some(),
            label_shifts: merged.value_shifts(on_device.mapping),
            tf: merged.function,
        };
        if disabled.has(Optimization::MarchTable) {
            made.make_march_table(gpu)?;
        }
        Ok(made)
    }

    /// Returns the transfer function from which the lookup tables on the device were computed. For a volume with
    /// segmentation labels, it holds the functions of all labels side by side.
    pub fn function(&self) -> &TransferFunction {
        &self.tf
    }

    /// Returns a copy of these device data with the colours of another transfer function, whose extinction must be
    /// the same at all values of the volume. Only the lookup table of colour integrals is replaced.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn recolored(&self, gpu: &Gpu, loaded: &LoadedVolume, tf: &TransferFunction) -> Result<Self> {
        let start = Instant::now();
        let MergedFunction { function, tables, .. } = MergedFunction::of(loaded, tf)?;
        let table_ms = start.elapsed().as_secs_f64() * 1e3;
        let one_color = one_color(&function, self.disabled);
        let [color_r, color_g, color_b] = one_color.unwrap_or_default();
        let uniform = FieldUniform { color_r, color_g, color_b, ..self.uniform };
        let bindings = FieldBindings {
            field: uniform_buffer(gpu, "field", &uniform),
            integrals: color_integrals(gpu, &tables, one_color)?,
            ..self.bindings.clone()
        };
        let march = self.march.get().map_or_else(OnceLock::new, |table| {
            let group = bindings.group(gpu, &table.view);
            MarchTable { group, view: table.view.clone(), table_ms: 0.0, ..*table }.into()
        });
        Ok(Self {
            label_shifts: self.label_shifts.clone(),
            active: self.active.clone(),
            bytes: tables.bytes(one_color.is_some()) + self.active.distance.len() as u64,
            one_color: one_color.is_some(),
            table_ms,
            classify_ms: 0.0,
            plain_group: bindings.group(gpu, &no_pairs(gpu)?),
            uniform,
            bindings,
            march,
            outer_bricks: self.outer_bricks.clone(),
            shared: self.shared.clone(),
            tf: self.tf.clone(),
            stream: self.stream.clone(),
            ..*self
        })
    }

    /// Returns the stream of the volume's pages; `None` if all pages that are needed are resident.
    pub fn stream(&self) -> Option<&Arc<PageStream>> {
        self.stream.as_ref()
    }

    /// Returns the bin width in the lookup table of extinction integrals, in units of the volume's values.
    pub fn value_bin(&self) -> f64 {
        self.mapping.scale / f64::from(self.uniform.table_per_value)
    }

    /// Returns the largest float32 error of an interpolated voxel value along a ray, in units of the volume's values.
    /// It also covers the rounding of transfer-function breakpoints; see `docs/bound.md`, "Values".
    pub fn value_rounding(&self) -> f64 {
        self.value_rounding_texels() * self.mapping.scale
    }

    /// Returns [`Self::value_rounding`] in units of the values that the volume texture stores.
    pub fn value_rounding_texels(&self) -> f64 {
        VALUE_ROUNDING * self.largest_texel
    }

    /// Returns the table of the extremes of extinction over ranges of the transfer function's intervals.
    pub fn extinction_ranges(&self) -> ExtinctionRanges {
        ExtinctionRanges::build(&self.tf, self.mapping)
    }

    /// Returns the lookup table of transfer-function breakpoints; `None` if no compute pass has needed it.
    pub fn march_table(&self) -> Option<&MarchTable> {
        self.march.get()
    }

    /// Returns the lookup table of transfer-function breakpoints; the first call computes it.
    ///
    /// # Errors
    /// The device is out of memory.
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

    /// Returns the number and the positions of the outer active bricks (blocks of cells with extinction) on the device;
    /// the first call uploads them. A position has two words: x and y in 16 bits each, then z.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn outer_bricks(&self, gpu: &Gpu) -> Result<(u32, &wgpu::Buffer)> {
        let (count, positions) = match self.outer_bricks.get() {
            Some(made) => made,
            None => {
                let outer = self.active.outer();
                let words = outer.iter().map(|at| [at.x as u32 | (at.y as u32) << 16, at.z as u32]);
                let words: Vec<[u32; 2]> = words.collect();
                let made = (outer.len() as u32, StorageBuffer::from_slice(gpu, "outer bricks", &words)?);
                self.outer_bricks.get_or_init(|| made)
            }
        };
        Ok((*count, positions))
    }

    /// Returns the buffers of shadow methods that depend on the extinction alone, and not on a light.
    pub fn shared(&self) -> &SharedBuffers {
        &self.shared
    }

    /// Returns bind group 0, which holds the volume, the transfer function, and the distance of every brick to the
    /// nearest active brick (block of cells with extinction).
    pub fn group(&self) -> &Group {
        self.march.get().map_or(&self.plain_group, |table| &table.group)
    }

    /// Adds the shader definitions (`#ifdef`) that a transfer function and its volume need: for clip planes,
    /// segmentation labels, a volume that is stored as pages, a gradient opacity, and the search for breakpoints. For a
    /// shader that marches light rays cell by cell, it also computes the lookup table of transfer-function breakpoints.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn prepared(&self, gpu: &Gpu, variant: ShaderVariant) -> Result<ShaderVariant> {
        let needs = [
            (self.clips, "CLIP"),
            (self.has_labels, "LABELS"),
            (self.pages.is_some(), "PAGED"),
            (self.stream.is_some(), "STREAMED"),
            (self.has_words, "WHOLE_TEXELS"),
            (self.has_gradient_opacity, "GRADIENT_OPACITY"),
        ];
        let variant = variant.defs(needs.into_iter().filter_map(|(needed, name)| needed.then_some(name)));
        if !marches_cells(&variant) {
            return Ok(variant);
        }
        let many = self.make_march_table(gpu)?.many_breakpoints;
        let search = many || self.disabled.has(Optimization::BreakpointSearch);
        Ok(variant.defs(search.then_some("MANY_BREAKPOINTS")))
    }
}

/// Returns the linear RGB colour of the transfer function, if it has one colour wherever it has extinction.
fn one_color(tf: &TransferFunction, disabled: DisabledOptimizations) -> Option<[f32; 3]> {
    tf.one_color().filter(|_| !disabled.has(Optimization::Colors)).map(|color| color.map(|c| c as f32))
}

fn field_uniform(
    (loaded, textures): (&LoadedVolume, &VolumeTextures),
    MergedFunction { function, tables, hidden_texel, .. }: &MergedFunction,
    one_color: Option<[f32; 3]>,
    active: &ActiveBricks,
    disabled: DisabledOptimizations,
) -> FieldUniform {
    let dims = loaded.on_device.dims;
    // Grid space is index space plus one.
    let grid_box = active.index_box(dims).map(|ends| ends.map(|p| (p + 1.0).as_vec3().to_array()));
    let [active_lo, active_hi] = match disabled.has(Optimization::Bricks) {
        true => [[0.5; 3], dims.map(|n| n as f32 + 0.5)],
        false => grid_box.unwrap_or_default(),
    };
    let [color_r, color_g, color_b] = one_color.unwrap_or_default();
    let pages = textures.pages.as_ref();
    let [word_sign, word_offset] = pages.and_then(|pages| pages.of_words).unwrap_or_default();
    FieldUniform {
        size: dims.map(|n| n as u32),
        min_spacing_mm: loaded.volume.min_spacing_mm() as f32,
        inv_size: dims.map(|n| 1.0 / n as f32),
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
        color_r,
        color_g,
        color_b,
        hidden_value: *hidden_texel,
        padding: [0.0; 3],
        clip: clip_planes(&loaded.volume, &function.clip),
        page_counts: pages.map_or([1; 3], |pages| pages.counts.map(|n| n as i32)),
        word_sign,
        word_offset,
        padding_of_pages: [0.0; 3],
    }
}

/// Converts the clip planes of a transfer function to a volume's grid space (voxel index plus one). Unused elements
/// of the array are planes that clip nothing.
fn clip_planes(volume: &Volume, clip: &[ClipPlane]) -> [[f32; 4]; MOST_CLIP_PLANES] {
    let mut planes = [[0.0, 0.0, 0.0, -1.0]; MOST_CLIP_PLANES];
    let world_from_grid = grid_from_world(volume).inverse();
    for (plane, given) in planes.iter_mut().zip(clip) {
        let (normal, offset) = given.in_coordinates(world_from_grid);
        // Unit length in grid space, so that float32 rounds it alike for all voxel sizes.
        *plane = (normal.extend(offset) / normal.length()).as_vec4().to_array();
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::field_shader;
    use crate::field::transfer_textures::IntervalTable;
    use crate::gpu::assert_layout;

    #[test]
    fn uniforms_have_one_layout() {
        let shader = field_shader("render/query.wgsl")
            .with_depth_march()
            .modules(&["shadow/rays/lookup.wgsl", "shadow/direct.wgsl"]);
        let shader = shader.defs(["PAGED", "MANUAL_TRILINEAR"]);
        assert_layout!(&shader, "Field", FieldUniform: size, min_spacing_mm, inv_size, intervals, active_lo,
            first_value, active_hi, last_value, bin_origin, bins_per_value, table_origin, table_per_value,
            inv_reference_length, color_r, color_g, color_b, hidden_value, clip, page_counts,
            word_sign, word_offset);
        assert_layout!(&shader, "IntervalTable", IntervalTable: intervals, of_bin);
    }
}
