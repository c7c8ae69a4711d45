//! Build of a deep shadow map: parameters and counters of its pass, and the pool of rows of curve nodes.

use super::layout::{DEPTH_STEPS, NAME, NODE_FORMAT, NODE_TEXTURE_WIDTH, ROW_BYTES};
use super::{Compress, DeepShadowMap, least_weight};
use crate::error::{Error, Result};
use crate::field::{BuildContext, NodePool, NodePools, TILE_TEXELS, TileMarch};
use crate::gpu::{Read, Slot, Span, StorageBuffer, copy_rows, read_back, store_texture, uniform_buffer};
use crate::shadow::keys::MarchBy;
use crate::shadow::method::{BuildReport, Method, ShadowMap};
use crate::shadow::tolerances::longest_depth;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Hint for builds that exceed a software adapter's limit on loop iterations.
const LOOP_LIMIT_HINT: &str =
    "software adapters limit loops: use fewer pre-filter taps, a longer step, or march=samples";

/// Uniform buffer of the deep shadow map shaders; mirrors struct `Params` in `shaders/shadow/dsm/layout.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct DsmParams {
    epsilon: f32,
    longest_depth: f32,
    step_mm: f32,
    tile_rows: u32,
    pool_rows: u32,
    taps: u32,
    depth_offset_mm: f32,
    depth_steps_per_mm: f32,
    least_weight: f32,
    padding: [f32; 3],
}

/// Counts of curve nodes, rows and texels that the GPU adds up while it builds a deep shadow map; mirrors struct
/// `Counters` in `shaders/shadow/dsm/rows.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Counters {
    overflow_rows: u32,
    nodes_total: u32,
    nodes_max: u32,
    texels_hit: u32,
    texels_cut: u32,
    texels_narrowed: u32,
}

impl DeepShadowMap {
    fn params_on_device(&self, context: &BuildContext<'_>, tiles: &TileMarch<'_>) -> DsmParams {
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
            padding: [0.0; 3],
        }
    }

    /// Builds a deep shadow map.
    ///
    /// # Errors
    /// The adapter cannot hold the map, or it ended light rays early.
    pub(super) fn build_map(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let gpu = context.gpu();
        let settings = self.spec().to_string();
        let known = context.node_pools.last_size(&settings);
        // The pool of the first build is often too small.
        let context = &if known.is_none() { context.at_once() } else { *context };
        let tiles = TileMarch::fit(context, self.fit.shape(self.map, self.march(), self.near()))?;
        let mut params = self.params_on_device(context, &tiles);
        // Starts with the rows of the last build and a reserve, since the light may have moved. In the first build, a
        // quarter more rows than texels suffices for most scenes.
        let more = |share: f64| (share * 1.125 * f64::from(params.tile_rows)) as u32 + params.tile_rows / 64;
        let pool_rows = params.tile_rows + known.map_or(params.tile_rows / 4, more);
        let mut pool = node_pool(context, pool_rows)?;
        params.pool_rows = pool.rows;
        let requested = StorageBuffer::zeroed(gpu, "requested rows", 8 * u64::from(tiles.built))?;
        let (mut device, counters) =
            self.fill(context, &tiles, None, &params, (&pool.view, &requested), Counters::zeroed())?;
        let mut overflow_rows = counters.map_or(0, |counters| counters.overflow_rows);
        let mut pool_growths = 0;
        if params.tile_rows + overflow_rows > params.pool_rows {
            // Complete tiles stay; tiles that lack rows are built again into rows appended to the pool.
            let rows = read_back::<[u32; 2]>(gpu, &requested, tiles.built as usize)?;
            let short: Vec<usize> = (0..rows.len()).filter(|place| rows[*place][1] > 0).collect();
            let missing: u32 = short.iter().map(|place| rows[*place][0]).sum();
            let before = params.pool_rows;
            let context = &context.at_once();
            let larger = node_pool(context, before + missing)?;
            params.pool_rows = larger.rows;
            copy_rows(gpu, &pool.view, &larger.view, before / (NODE_TEXTURE_WIDTH / 2))?;
            pool = larger;
            let used = Counters { overflow_rows: before - params.tile_rows, ..Zeroable::zeroed() };
            let (took, counted) =
                self.fill(context, &tiles, Some(&short), &params, (&pool.view, &requested), used)?;
            device = device.plus(took);
            overflow_rows = counted.map_or(0, |counters| counters.overflow_rows);
            pool_growths = 1;
            if params.tile_rows + overflow_rows > params.pool_rows {
                let why = "tiles that were built again requested more rows than at first";
                return Err(Error::runtime("cannot build the deep shadow map", self.params(), why));
            }
        }
        let uniform = uniform_buffer(gpu, "deep shadow map", &params);
        let left_out = tiles.tiles - tiles.built;
        let mut report = BuildReport {
            device: Some(device),
            bytes: u64::from(params.pool_rows) * ROW_BYTES + tiles.table_bytes(),
            bytes_used: u64::from(params.tile_rows) * ROW_BYTES + tiles.table_bytes(),
            guessed: known.is_none(),
            tiles: tiles.tiles,
            tiles_left_out: left_out,
            bytes_left_out: u64::from(left_out * TILE_TEXELS) * ROW_BYTES,
            pool_growths,
            ..Default::default()
        };
        if let Some(counters) = counters {
            self.add_counts(&mut report, &counters, context.node_pools);
            report.bytes_used += u64::from(overflow_rows) * ROW_BYTES;
        }
        Ok(ShadowMap {
            method: NAME,
            group: tiles.group(
                "deep shadow map",
                &[(1, context.kernels.uniform(&uniform)), (3, Slot::words(&pool.view))],
            ),
            lookup: self.lookup(),
            report,
            bound: self.bound(context, &tiles.light_space),
            light_space: tiles.light_space,
            _pool: Some(pool),
        })
    }

    /// Builds the given tiles of a deep shadow map (`None` for all), and stores their curve nodes as rows in a
    /// texture; `counters` holds the number of rows in use. Returns the counts of the build, unless it is deferred.
    fn fill(
        &self,
        context: &BuildContext<'_>,
        tiles: &TileMarch<'_>,
        some: Option<&[usize]>,
        params: &DsmParams,
        (nodes, requested): (&wgpu::TextureView, &wgpu::Buffer),
        counters: Counters,
    ) -> Result<(Span, Option<Counters>)> {
        let gpu = context.gpu();
        let params = uniform_buffer(gpu, "deep shadow map", params);
        let counters = StorageBuffer::from_slice(gpu, "deep shadow map counters", &[counters])?;
        let stage = [
            (1, Slot::store(nodes, NODE_FORMAT)),
            (2, Slot::read_write(counters.as_entire_binding())),
            (3, Slot::read_write(requested.as_entire_binding())),
        ];
        let params = [(1, context.kernels.uniform(&params))];
        let (label, shader) = ("deep shadow map build", self.build_shader());
        let read = Read { buffer: &counters, words: size_of::<Counters>() / 4 };
        let ran = match some {
            None => tiles.run(label, &shader, &params, &stage, Some(read)),
            Some(places) => tiles.run_again(places, label, &shader, &params, &stage, Some(read)),
        };
        let many = self.taps_a_texel() > 1 && self.march == MarchBy::Cells;
        let (span, words) = ran.map_err(|e| if many { e.hint(LOOP_LIMIT_HINT) } else { e })?;
        Ok((span, words.map(|words| self.counters(&words)).transpose()?))
    }

    /// Completes the report of a map whose build was deferred. Returns `false` if the pool of rows was too small.
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
        self.add_counts(report, &counters, pools);
        report.bytes_used += u64::from(counters.overflow_rows) * ROW_BYTES;
        Ok(report.bytes_used <= report.bytes)
    }

    /// Decodes the counters of a build.
    ///
    /// # Errors
    /// The adapter ended light rays early.
    fn counters(&self, words: &[u32]) -> Result<Counters> {
        let counters: Counters = bytemuck::pod_read_unaligned(bytemuck::cast_slice(words));
        if counters.texels_cut > 0 {
            let why = format!("the adapter ended {} light rays early", counters.texels_cut);
            return Err(
                Error::runtime("cannot build the deep shadow map", self.params(), why).hint(LOOP_LIMIT_HINT)
            );
        }
        Ok(counters)
    }

    /// Adds the counts of a build to its report, and records the size of the pool that it needed.
    fn add_counts(&self, report: &mut BuildReport, counters: &Counters, pools: &NodePools) {
        let share = f64::from(counters.overflow_rows) / report.texels_built().max(1) as f64;
        pools.learn_size(self.spec().to_string(), share);
        report.nodes_total = Some(u64::from(counters.nodes_total));
        report.nodes_max = Some(u64::from(counters.nodes_max));
        report.texels_hit = Some(u64::from(counters.texels_hit));
        report.texels_narrowed =
            (self.compress == Compress::Optimal).then_some(u64::from(counters.texels_narrowed));
    }
}

/// Largest factor by which a reused pool may be too large while a light moves in a window.
const POOL_SLACK: f64 = 1.25;

/// Creates or reuses the texture that stores the rows of curve nodes of a deep shadow map: at least `rows` rows, in
/// whole lines of texels. Only a window reuses pools: measured builds allocate their memory, like those of the other
/// methods.
fn node_pool(context: &BuildContext<'_>, rows: u32) -> Result<Arc<NodePool>> {
    let rows = rows.max(1).next_multiple_of(NODE_TEXTURE_WIDTH / 2);
    let reuses = context.pace.is_limited();
    let most = (POOL_SLACK * f64::from(rows)) as u32;
    if let Some(pool) = reuses.then(|| context.node_pools.reuse(rows, most)).flatten() {
        return Ok(pool);
    }
    let size = [NODE_TEXTURE_WIDTH, rows / (NODE_TEXTURE_WIDTH / 2)];
    let view = store_texture(context.gpu(), "deep shadow map nodes", NODE_FORMAT, size)?;
    let pool = Arc::new(NodePool { view, rows });
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
        assert_layout!(&build, "Counters", Counters: overflow_rows, nodes_total, nodes_max, texels_hit, texels_cut,
            texels_narrowed);
        assert_layout!(&build, "Params", DsmParams: epsilon, longest_depth, step_mm, tile_rows, pool_rows, taps,
            depth_offset_mm, depth_steps_per_mm, least_weight);
    }
}
