//! Build of a deep shadow map: parameters and counters of its passes, and the rows of curve nodes.

use super::layout::{DEPTH_STEPS, NODE_FORMAT, QUAD_BYTES, ROW_QUADS, ROWS_WIDTH_SHIFT, TILE_BLOCKS};
use super::{Compress, DeepShadowMap, least_weight};
use crate::error::{Error, Result};
use crate::field::{
    BuildContext, BuildLimit, BuildRecorder, NodePool, NodePoolSizes, NodePools, TILE_TEXELS, TileMarch,
};
use crate::gpu::{
    Read, ShaderVariant, Slot, Span, StorageBuffer, copy_rows, read_back, store_texture, uniform_buffer,
};
use crate::shadow::keys::MarchBy;
use crate::shadow::method::{BuildReport, Method, ShadowMap};
use crate::shadow::tolerances::longest_depth;
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;
use std::sync::Arc;

/// Hint for builds that exceed a software adapter's limit on loop iterations.
const LOOP_LIMIT_HINT: &str =
    "software adapters limit loops: use fewer pre-filter taps, a longer step, or march=samples";

/// Uniform buffer of the deep shadow map shaders; mirrors struct `Params` in `shaders/shadow/dsm/layout.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct DsmParams {
    epsilon: f32,
    longest_depth: f32,
    step_mm: f32,
    pub(super) tile_rows: u32,
    pool_rows: u32,
    taps: u32,
    depth_offset_mm: f32,
    depth_steps_per_mm: f32,
    least_weight: f32,
    pub(super) quads: u32,
    pub(super) quads_width_shift: u32,
    transmittance_error: f32,
}

impl DsmParams {
    /// Sets the offset in depth of queries, and the error bound by which they widen a transmittance.
    pub(super) fn set_widening(&mut self, depth_offset_mm: f64, transmittance_error: f64) {
        self.depth_offset_mm = depth_offset_mm as f32;
        self.transmittance_error = transmittance_error as f32;
    }
}

/// Counts of curve nodes, rows and texels that the GPU adds up while it builds a deep shadow map; mirrors struct
/// `Counters` in `shaders/shadow/dsm/counters.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Counters {
    overflow_rows: u32,
    nodes_total: u32,
    nodes_max: u32,
    pub(super) quads_needed: u32,
    texels_cut: u32,
    texels_narrowed: u32,
    texels_hit: u32,
    quads: u32,
    missing_rows: u32,
}

/// Buffers that the march of light rays fills: rows of curve nodes, counters, the rows requested by each tile, and the
/// mask of texels with nodes for each block.
pub(super) struct RowOutputs {
    pub(super) rows: Arc<NodePool>,
    pub(super) counters: wgpu::Buffer,
    requested: wgpu::Buffer,
    pub(super) blocks: wgpu::Buffer,
}

impl RowOutputs {
    /// Creates the outputs for a number of tiles. `overflow_rows` rows of the pool are in use.
    fn new(context: &BuildContext<'_>, rows: &Arc<NodePool>, tiles: u32, overflow_rows: u32) -> Result<Self> {
        let (gpu, tiles) = (context.gpu(), u64::from(tiles));
        let counters = Counters { overflow_rows, ..Zeroable::zeroed() };
        Ok(Self {
            rows: Arc::clone(rows),
            counters: StorageBuffer::from_slice(gpu, "deep shadow map counters", &[counters])?,
            requested: StorageBuffer::zeroed(gpu, "requested rows", 8 * tiles)?,
            blocks: StorageBuffer::zeroed(gpu, "blocks with nodes", 8 * u64::from(TILE_BLOCKS) * tiles)?,
        })
    }

    /// Returns the limit of a recorded build to a pool with `most` quads.
    pub(super) fn limit(&self, most: u32) -> BuildLimit {
        let missing = [offset_of!(Counters, missing_rows), offset_of!(Counters, texels_cut)].map(|at| at / 4);
        let needed = offset_of!(Counters, quads_needed) / 4;
        BuildLimit { counters: self.counters.clone(), missing, needed, most }
    }

    /// Returns the request for the counters of the build.
    pub(super) fn counts(&self) -> Read<'_> {
        Read { buffer: &self.counters, words: size_of::<Counters>() / 4 }
    }
}

/// Compute pass that marches light rays and stores their curves in rows.
pub(super) struct RowPass<'a> {
    /// Name of the pass, under which its pace is known.
    pub(super) label: &'static str,
    pub(super) shader: ShaderVariant,
    /// Bindings of bind group 2 that this pass needs beside those of all such passes.
    pub(super) own: &'a [(u32, Slot<'a>)],
    /// Hint for the error that the adapter ended rays early.
    pub(super) hint: Option<&'static str>,
}

/// Rows of curve nodes of all light rays, as the march stored them.
pub(super) struct BuiltRows {
    pub(super) outputs: RowOutputs,
    pub(super) params: DsmParams,
    device: Span,
    /// Counts of the build; `None` if it is deferred.
    pub(super) counted: Option<Counters>,
    pool_growths: u32,
}

impl BuiltRows {
    fn bytes(&self) -> u64 {
        let RowOutputs { rows, counters, requested, blocks } = &self.outputs;
        u64::from(rows.quads) * QUAD_BYTES + counters.size() + requested.size() + blocks.size()
    }

    /// Returns the report on the build of these rows, without counts.
    pub(super) fn report(&self, tiles: &TileMarch<'_>) -> BuildReport {
        let left_out = tiles.tiles - tiles.built;
        BuildReport {
            device: Some(self.device),
            build_bytes: self.bytes(),
            tiles: tiles.tiles,
            tiles_left_out: left_out,
            bytes_left_out: u64::from(left_out * TILE_TEXELS * ROW_QUADS) * QUAD_BYTES,
            pool_growths: self.pool_growths,
            ..Default::default()
        }
    }
}

/// Returns the size of a pool for a map with `texels` texels, from the size that the last build needed for each texel.
pub(super) fn with_reserve(share: f64, texels: u32) -> u32 {
    (share * 1.125 * f64::from(texels)) as u32 + texels / 64
}

impl DeepShadowMap {
    pub(super) fn params_on_device(&self, context: &BuildContext<'_>, tiles: &TileMarch<'_>) -> DsmParams {
        let spacing = context.volume.min_spacing_mm();
        let steps_per_mm = f64::from(DEPTH_STEPS) / tiles.light_space.depth_range_mm();
        DsmParams {
            epsilon: self.epsilon as f32,
            longest_depth: longest_depth(),
            step_mm: self.lattice_mm(context, &tiles.light_space) as f32,
            tile_rows: tiles.records(),
            pool_rows: 0,
            taps: self.taps_a_texel(),
            depth_offset_mm: (self.offset * spacing) as f32,
            depth_steps_per_mm: steps_per_mm as f32,
            least_weight: least_weight(&tiles.light_space.rounding(context.volume, context.transfer.clips))
                as f32,
            quads: 0,
            quads_width_shift: 0,
            transmittance_error: 0.0,
        }
    }

    /// Builds a deep shadow map.
    ///
    /// # Errors
    /// The adapter cannot hold the map, or it ended light rays early.
    pub(super) fn build_map(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let key = self.spec().to_string();
        let reserve = context.passes.recorder.map_or(1.0, |_| BuildRecorder::RESERVE);
        let known = context.node_pools.last_sizes(&key).map(|sizes| sizes.scaled(reserve));
        // The pools of the first build are often too small.
        let context = &if known.is_none() { context.at_once() } else { *context };
        let tiles = TileMarch::fit(context, self.map_shape())?;
        let many = self.taps_a_texel() > 1 && self.march == MarchBy::Cells;
        let hint = many.then_some(LOOP_LIMIT_HINT);
        let (label, shader) = ("deep shadow map build", self.build_shader());
        let pass = RowPass { label, shader, own: &[], hint };
        let rows = self.build_rows(context, &tiles, &pass, known)?;
        let mut report = rows.report(&tiles);
        let nodes = self.compact(context, &tiles, rows, known)?;
        nodes.add_to(&mut report);
        report.bytes += tiles.table_bytes();
        if let Some(words) = &nodes.counted {
            self.add_counts(&mut report, &self.counters(words)?, key, context.node_pools);
        }
        let enclosure = self.build_enclosure(context, &tiles)?;
        enclosure.iter().for_each(|enclosure| report.add_enclosure(enclosure));
        Ok(ShadowMap { enclosure, ..self.finished(context, tiles, nodes, report) })
    }

    /// Marches all light rays, and stores the nodes of their compressed curves in rows.
    pub(super) fn build_rows(
        &self,
        context: &BuildContext<'_>,
        tiles: &TileMarch<'_>,
        pass: &RowPass<'_>,
        known: Option<NodePoolSizes>,
    ) -> Result<BuiltRows> {
        let gpu = context.gpu();
        let mut params = self.params_on_device(context, tiles);
        // Starts with the rows of the last build and a reserve, since the light may have moved. In the first build, a
        // quarter more rows than texels suffices for most scenes.
        let extra =
            known.map_or(params.tile_rows / 4, |sizes| with_reserve(sizes.overflow_rows, params.tile_rows));
        let mut pool = row_pool(context, params.tile_rows + extra)?;
        params.pool_rows = pool.quads / ROW_QUADS;
        let outputs = |pool, used: u32| RowOutputs::new(context, pool, tiles.built, used);
        let mut first = outputs(&pool, 0)?;
        let (mut device, counted) = self.fill(context, tiles, pass, None, &params, &first)?;
        let mut pool_growths = 0;
        let overflow_rows = counted.map_or(0, |counters| counters.overflow_rows);
        if params.tile_rows + overflow_rows > params.pool_rows {
            // Complete tiles stay; tiles that lack rows are built again into rows appended to the pool.
            let requested = read_back::<[u32; 2]>(gpu, &first.requested, tiles.built as usize)?;
            let short: Vec<usize> = (0..requested.len()).filter(|place| requested[*place][1] > 0).collect();
            let missing: u32 = short.iter().map(|place| requested[*place][0]).sum();
            let before = params.pool_rows;
            let context = &context.at_once();
            let larger = row_pool(context, before + missing)?;
            params.pool_rows = larger.quads / ROW_QUADS;
            copy_rows(gpu, &pool.view, &larger.view, (before * ROW_QUADS) >> ROWS_WIDTH_SHIFT)?;
            let again = outputs(&larger, before - params.tile_rows)?;
            let (took, counted) = self.fill(context, tiles, pass, Some(&short), &params, &again)?;
            device = device.plus(took);
            pool_growths = 1;
            let overflow_rows = counted.map_or(0, |counters| counters.overflow_rows);
            if params.tile_rows + overflow_rows > params.pool_rows {
                let why = "tiles that were built again requested more rows than at first";
                return Err(Error::runtime("cannot build the deep shadow map", self.params(), why));
            }
            pool = larger;
        }
        first.rows = pool;
        Ok(BuiltRows { outputs: first, params, device, counted, pool_growths })
    }

    /// Builds the given tiles of a deep shadow map (`None` for all), and stores their curve nodes as rows. Returns the
    /// counts of the build, unless it is deferred.
    fn fill(
        &self,
        context: &BuildContext<'_>,
        tiles: &TileMarch<'_>,
        pass: &RowPass<'_>,
        some: Option<&[usize]>,
        params: &DsmParams,
        outputs: &RowOutputs,
    ) -> Result<(Span, Option<Counters>)> {
        let params = uniform_buffer(context.gpu(), "deep shadow map", params);
        let rows = [
            (1, Slot::store(&outputs.rows.view, NODE_FORMAT)),
            (2, Slot::read_write(outputs.counters.as_entire_binding())),
            (3, Slot::read_write(outputs.requested.as_entire_binding())),
            (4, Slot::read_write(outputs.blocks.as_entire_binding())),
        ];
        let params = [(1, context.kernels.uniform(&params))];
        let stage = [&rows, pass.own].concat();
        let (label, shader) = (pass.label, &pass.shader);
        let read = outputs.counts();
        let ran = match some {
            None => tiles.run(label, shader, &params, &stage, Some(read)),
            Some(places) => tiles.run_again(places, label, shader, &params, &stage, Some(read)),
        };
        let with_hint = |e: Error| match pass.hint {
            Some(hint) => e.hint(hint),
            None => e,
        };
        let (span, words) = ran.map_err(with_hint)?;
        Ok((span, words.map(|words| self.counters(&words)).transpose()?))
    }

    /// Completes the report of a map whose build was deferred. Returns `false` if a pool of nodes was too small.
    ///
    /// # Errors
    /// The adapter ended light rays early.
    pub(super) fn complete_report(
        &self,
        report: &mut BuildReport,
        words: &[u32],
        pools: &NodePools,
    ) -> Result<bool> {
        let counters = self.counters(words)?;
        self.add_counts(report, &counters, self.spec().to_string(), pools);
        Ok(counters.missing_rows == 0 && report.bytes_used <= report.bytes)
    }

    /// Decodes the counters of a build.
    ///
    /// # Errors
    /// The adapter ended light rays early.
    pub(super) fn counters(&self, words: &[u32]) -> Result<Counters> {
        let counters: Counters = bytemuck::pod_read_unaligned(bytemuck::cast_slice(words));
        if counters.texels_cut > 0 {
            let why = format!("the adapter ended {} light rays early", counters.texels_cut);
            return Err(
                Error::runtime("cannot build the deep shadow map", self.params(), why).hint(LOOP_LIMIT_HINT)
            );
        }
        Ok(counters)
    }

    /// Adds the counts of a build to its report, and records the sizes of the pools that it needed under a key.
    pub(super) fn add_counts(
        &self,
        report: &mut BuildReport,
        counters: &Counters,
        key: String,
        pools: &NodePools,
    ) {
        let texels = report.texels_built().max(1) as f64;
        let used = NodePoolSizes {
            overflow_rows: f64::from(counters.overflow_rows) / texels,
            quads: f64::from(counters.quads_needed) / texels,
        };
        pools.learn_sizes(key, used);
        report.bytes_used += u64::from(counters.quads_needed) * QUAD_BYTES;
        report.nodes_total = Some(u64::from(counters.nodes_total));
        report.nodes_max = Some(u64::from(counters.nodes_max));
        report.texels_hit = Some(u64::from(counters.texels_hit));
        report.texels_narrowed =
            (self.compress == Compress::Optimal).then_some(u64::from(counters.texels_narrowed));
    }
}

/// Creates or reuses the texture of the rows of curve nodes, with space for at least `rows` rows.
fn row_pool(context: &BuildContext<'_>, rows: u32) -> Result<Arc<NodePool>> {
    node_pool(context, rows * ROW_QUADS, ROWS_WIDTH_SHIFT)
}

/// Largest factor by which a reused pool may be too large while a light moves in a window.
const POOL_SLACK: f64 = 1.25;

/// Creates or reuses a texture of curve nodes with at least `quads` quads, in whole lines of texels. Only a window
/// reuses pools: measured builds allocate their memory, like those of the other methods.
pub(super) fn node_pool(context: &BuildContext<'_>, quads: u32, width_shift: u32) -> Result<Arc<NodePool>> {
    let width = 1 << width_shift;
    let quads = quads.max(1).next_multiple_of(width);
    let reuses = context.pace.is_limited();
    let most = (POOL_SLACK * f64::from(quads)) as u32;
    if let Some(pool) = reuses.then(|| context.node_pools.reuse([quads, most], width_shift)).flatten() {
        return Ok(pool);
    }
    let view = store_texture(context.gpu(), "deep shadow map nodes", NODE_FORMAT, [width, quads / width])?;
    let pool = Arc::new(NodePool { view, quads, width_shift });
    if reuses {
        context.node_pools.keep(&pool);
    }
    Ok(pool)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;

    #[test]
    fn uniforms_match_their_shaders() {
        let build = DeepShadowMap::default().build_shader();
        assert_layout!(&build, "Counters", Counters: overflow_rows, nodes_total, nodes_max, quads_needed, texels_cut,
            texels_narrowed, texels_hit, quads, missing_rows);
        assert_layout!(&build, "Params", DsmParams: epsilon, longest_depth, step_mm, tile_rows, pool_rows, taps,
            depth_offset_mm, depth_steps_per_mm, least_weight, quads, quads_width_shift, transmittance_error);
    }
}
