//! Finished memory of a deep shadow map: its curve nodes without gaps, and the directory that leads to them.

use super::DeepShadowMap;
use super::build::{BuiltRows, DsmParams, node_pool, with_reserve};
use super::layout::{
    BLOCK, DIRECTORY_FORMAT, NAME, NODE_FORMAT, QUAD_BYTES, ROWS_WIDTH_SHIFT, Side, allocate_shader,
    compact_shader,
};
use crate::error::Result;
use crate::field::{BuildContext, NodePool, NodePoolSizes, TileMarch, line_of_workgroups};
use crate::gpu::{Group, Slot, Span, store_texture, uniform_buffer, write_texels};
use crate::shadow::bound::Bound;
use crate::shadow::method::{BuildReport, Method as _, ShadowMap};
use std::sync::Arc;

/// Curve nodes of a finished deep shadow map.
pub(super) struct MapNodes {
    pub(super) pool: Arc<NodePool>,
    directory: wgpu::TextureView,
    /// Number of blocks of texels on each axis.
    blocks: [u32; 2],
    params: DsmParams,
    /// Words of the counters of the build; `None` if it is deferred.
    pub(super) counted: Option<Vec<u32>>,
    /// Duration of the passes that copied the nodes.
    device: Span,
}

impl MapNodes {
    /// Uploads the quads of curve nodes of a map, and its blocks of texels with nodes: index, mask, and first head.
    ///
    /// # Errors
    /// The adapter cannot hold the map.
    pub(super) fn new(
        context: &BuildContext<'_>,
        (map, tiles): (&DeepShadowMap, &TileMarch<'_>),
        quads: &[[u32; 4]],
        entries: &[[u32; 3]],
    ) -> Result<Self> {
        let gpu = context.gpu();
        let mut params = map.params_on_device(context, tiles);
        let count = quads.len() as u32;
        let pool = node_pool(context, count, width_shift(count))?;
        (params.quads, params.quads_width_shift) = (pool.quads, pool.width_shift);
        let width = 1_u32 << pool.width_shift;
        let mut texels = quads.to_vec();
        texels.resize(texels.len().next_multiple_of(width as usize), [0; 4]);
        let lines = texels.len() as u32 / width;
        write_texels(gpu, pool.view.texture(), [0; 3], [width, lines, 1], &texels);
        let (directory, blocks) = directory(context, tiles)?;
        let mut words = vec![[0_u32; 2]; (blocks[0] * blocks[1]) as usize];
        for [index, mask, first] in entries {
            if let Some(entry) = words.get_mut(*index as usize) {
                *entry = [*mask, *first];
            }
        }
        write_texels(gpu, directory.texture(), [0; 3], [blocks[0], blocks[1], 1], &words);
        let device = Span { gpu_ms: None, wall_ms: 0.0 };
        Ok(Self { pool, directory, blocks, params, counted: None, device })
    }

    /// Adds the memory of the nodes and of the directory, and the duration of their passes, to the report of a build.
    pub(super) fn add_to(&self, report: &mut BuildReport) {
        let [columns, rows] = self.blocks.map(u64::from);
        let directory_bytes = 8 * columns * rows;
        report.device = report.device.map(|device| device.plus(self.device));
        report.bytes = u64::from(self.pool.quads) * QUAD_BYTES + directory_bytes;
        report.bytes_used = directory_bytes;
    }

    /// Makes queries of the curves return a bound on the given side, widened by the error bound of the curves.
    pub(super) fn widen(&mut self, bound: Bound, side: Side) {
        let offset_mm = match side {
            Side::Lower => bound.depth_mm,
            Side::Upper => -bound.depth_mm,
        };
        self.params.set_widening(offset_mm, bound.transmittance);
    }

    /// Creates bind group 1 of queries.
    pub(super) fn group(&self, context: &BuildContext<'_>, tiles: &TileMarch<'_>) -> Group {
        let params = uniform_buffer(context.gpu(), "deep shadow map", &self.params);
        let own = [
            (1, context.kernels.uniform(&params)),
            (3, Slot::words(&self.pool.view)),
            (4, Slot::words(&self.directory)),
        ];
        tiles.group("deep shadow map", &own)
    }
}

/// Returns the binary logarithm of the texture width for a number of quads: about their square root, so that the last
/// line of the texture wastes little memory.
fn width_shift(quads: u32) -> u32 {
    quads.isqrt().next_power_of_two().ilog2().clamp(4, ROWS_WIDTH_SHIFT)
}

/// Creates the empty directory of a map. Returns it with its number of blocks of texels on each axis.
fn directory(context: &BuildContext<'_>, tiles: &TileMarch<'_>) -> Result<(wgpu::TextureView, [u32; 2])> {
    let blocks = BLOCK.map(|texels| tiles.light_space.map_size.div_ceil(texels));
    let view = store_texture(context.gpu(), "deep shadow map directory", DIRECTORY_FORMAT, blocks)?;
    Ok((view, blocks))
}

impl DeepShadowMap {
    /// Returns the shadow map of finished nodes, without enclosing curves.
    pub(super) fn finished(
        &self,
        context: &BuildContext<'_>,
        tiles: TileMarch<'_>,
        nodes: MapNodes,
        report: BuildReport,
    ) -> ShadowMap {
        ShadowMap {
            method: NAME,
            group: nodes.group(context, &tiles),
            lookup: self.lookup(),
            report,
            bound: self.bound(context, &tiles.light_space),
            light_space: tiles.light_space,
            enclosure: None,
            sections: None,
            _pool: Some(nodes.pool),
        }
    }

    /// Copies the curve nodes of texels that have any from rows to memory without gaps.
    ///
    /// # Errors
    /// The adapter cannot hold the map, or it is lost.
    pub(super) fn compact(
        &self,
        context: &BuildContext<'_>,
        tiles: &TileMarch<'_>,
        rows: BuiltRows,
        known: Option<NodePoolSizes>,
    ) -> Result<MapNodes> {
        let (gpu, mut params) = (context.gpu(), rows.params);
        let texels = params.tile_rows;
        let learned = known.map_or(0, |sizes| with_reserve(sizes.quads, texels));
        let needed = rows.counted.map_or(learned, |counted| counted.quads_needed);
        let quads = context.passes.recorder.map_or(needed, |_| needed.max(learned));
        let pool = node_pool(context, quads, width_shift(quads))?;
        if let Some(recorder) = context.passes.recorder {
            recorder.limit(rows.outputs.limit(pool.quads));
        }
        (params.quads, params.quads_width_shift) = (pool.quads, pool.width_shift);
        let (directory, blocks) = directory(context, tiles)?;
        let stage = [
            (0, Slot::words(&rows.outputs.rows.view)),
            (2, Slot::read_write(rows.outputs.counters.as_entire_binding())),
            (4, Slot::read_write(rows.outputs.blocks.as_entire_binding())),
            (5, Slot::store(&directory, DIRECTORY_FORMAT)),
            (6, Slot::store(&pool.view, NODE_FORMAT)),
        ];
        let label = "deep shadow map compaction";
        let uniform = uniform_buffer(gpu, "deep shadow map", &params);
        let shadow = tiles.group(label, &[(1, context.kernels.uniform(&uniform))]);
        let stage = context.kernels.group(label, &stage);
        let passes = [
            (&allocate_shader(), line_of_workgroups((blocks[0] * blocks[1]) as usize)),
            (&compact_shader(), line_of_workgroups(texels as usize)),
        ];
        let read = rows.outputs.counts();
        let is_deferred = rows.counted.is_none();
        let (device, counted) = context.run_behind(label, &passes, [&shadow, &stage], read, is_deferred)?;
        Ok(MapNodes { pool, directory, blocks, params, counted, device })
    }
}

#[cfg(test)]
mod tests {
    use super::width_shift;

    #[test]
    fn the_last_line_of_a_texture_is_a_small_part_of_it() {
        assert_eq!([0, 1, 300, 30_000, 1 << 24, 1 << 30].map(width_shift), [4, 4, 5, 8, 12, 12]);
        for quads in (10_000..1_000_000).step_by(997) {
            assert!(f64::from(1 << width_shift(quads)) < 0.021 * f64::from(quads), "{quads}");
        }
    }
}
