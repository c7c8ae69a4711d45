//! Builds a shadow map by tiles (squares of texels): chooses the tiles that are built, and runs compute passes over
//! their texels.

use super::constants::{NO_TILE, TILE_TEXELS};
use super::page_stream::{PageReach, PassRays};
use super::shader::{LINES_BINDING, RAY_STATE_BINDING, RAY_STATES, shape_of};
use super::strand_lines::line_words;
use super::{BuildContext, LightSpace, MapShape, March, Optimization, TileList, TileSet};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Group, Read, ShaderVariant, Slot, Span, StorageBuffer, WorkOrder, table_texture};
use crate::scene::Light;

/// Shadow map during its build by compute passes over tiles (squares of texels). Tiles without bricks with extinction
/// are skipped (Hadwiger et al. 2006, 3.4).
///
/// The shader of a pass imports `umbravox::tiles` (`tile_texel` finds its texel) and `umbravox::tile_table`
/// (`record_of` finds the texel's record). Bind group 1 holds the shadow map's projection at 0, the tile table at 2,
/// and the method's own resources at 1 and from 3 on. Bind group 2 holds the list of tiles at 0 and the pass's own
/// resources from 1 on.
pub struct TileMarch<'a> {
    context: BuildContext<'a>,
    /// Projection of the shadow map that is built by tiles.
    pub light_space: LightSpace,
    light: wgpu::Buffer,
    table: wgpu::TextureView,
    /// Indices of the shadow-map tiles that are built, in the order in which their texels are stored.
    built_tiles: Vec<u32>,
    list: wgpu::Buffer,
    /// Buffer of the intervals of light rays that lie in strands, if the march is [`March::Lines`].
    lines: Option<wgpu::Buffer>,
    /// Number of all tiles of the shadow map.
    pub tiles: u32,
    /// Number of shadow-map tiles that are built: those with bricks that have extinction, or all if
    /// [`Optimization::Tiles`] is disabled.
    pub built: u32,
}

impl<'a> TileMarch<'a> {
    /// Fits the projection of a shadow map to the scene, and lists the tiles (squares of texels) that are built.
    ///
    /// # Errors
    /// The adapter cannot hold the shadow map, or there are no strands for [`March::Lines`].
    pub fn fit(context: &BuildContext<'a>, shape: MapShape) -> Result<Self> {
        let gpu = context.gpu();
        let light_space = context.light_space(shape);
        let mut occupied = light_space.occupied_tiles(context.volume, &context.transfer.active);
        // A recorded build serves every light.
        if context.transfer.disabled.has(Optimization::Tiles) || context.passes.recorder.is_some() {
            occupied = TileSet::all(occupied.across());
        }
        if !context.share.is_whole() {
            let weights = light_space.tile_weights(context.volume, &context.transfer.active, &occupied);
            occupied = occupied.range(context.share.range(&weights));
        }
        let across = occupied.across();
        let (entries, list) = layout(&occupied, gpu.tuning.order);
        let table =
            table_texture(gpu, "tile table", wgpu::TextureFormat::R32Uint, [across, across], &entries)?;
        let lines = (shape.march == March::Lines).then(|| {
            let records = list.len() as u32 * TILE_TEXELS;
            let strands = context.drawn_strands()?;
            let most = gpu.device.limits().max_storage_buffer_binding_size;
            let words = line_words(strands, &light_space, &entries, records, most).map_err(|why| {
                Error::runtime("cannot draw strands into the map", "from=lines", why)
                    .hint("a smaller map= has fewer texels")
            })?;
            StorageBuffer::from_slice(gpu, "strands in the map", &words)
        });
        Ok(Self {
            context: *context,
            light: context.light_uniform(&light_space),
            light_space,
            table,
            tiles: entries.len() as u32,
            built: list.len() as u32,
            lines: lines.transpose()?,
            list: StorageBuffer::from_slice(gpu, "tile list", &list)?,
            built_tiles: list,
        })
    }

    /// Returns the number of texels for which the shadow map stores data: all texels of the tiles that are built.
    pub fn records(&self) -> u32 {
        self.built * TILE_TEXELS
    }

    /// Returns the size in bytes of the shadow map's tile table, which holds the storage index of each tile's first
    /// texel.
    pub fn table_bytes(&self) -> u64 {
        u64::from(self.tiles) * 4
    }

    /// Creates bind group 1 of a shadow map, for its build passes and for queries: the projection, the tile table,
    /// and the bindings `own` of the shadow method.
    pub fn group(&self, label: &str, own: &[(u32, Slot<'_>)]) -> Group {
        let kernels = self.context.kernels;
        let shared = [(0, kernels.uniform(&self.light)), (2, Slot::words(&self.table))];
        kernels.group(label, &[&shared, own].concat())
    }

    /// Returns the bindings that the light march needs in bind group 2: the intervals of light rays that lie in
    /// strands for [`March::Lines`], otherwise none.
    pub fn march_slots(&self) -> Vec<(u32, Slot<'_>)> {
        self.lines.iter().map(|lines| (LINES_BINDING, Slot::read(lines.as_entire_binding()))).collect()
    }

    /// Runs a compute pass over all tiles of the shadow map that are built, in batches. `own` and `stage` are the
    /// shadow method's bindings of bind groups 1 and 2. Returns the duration, and the words of `read` after the pass
    /// ([`BuildContext::run_over`]).
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run(
        &self,
        label: &'static str,
        variant: &ShaderVariant,
        own: &[(u32, Slot<'_>)],
        stage: &[(u32, Slot<'_>)],
        read: Option<Read<'_>>,
    ) -> Result<(Span, Option<Vec<u32>>)> {
        let stage = [stage, &self.march_slots()].concat();
        let list = TileList { entries: &self.list, count: self.built, workgroups: self.workgroups_a_tile() };
        self.run_list(list, label, variant, &self.group(label, own), &stage, read)
    }

    /// Runs a compute pass again over some of the built tiles of the shadow map. `places` are their positions in the
    /// list of built tiles.
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run_again(
        &self,
        places: &[usize],
        label: &'static str,
        variant: &ShaderVariant,
        own: &[(u32, Slot<'_>)],
        stage: &[(u32, Slot<'_>)],
        read: Option<Read<'_>>,
    ) -> Result<(Span, Option<Vec<u32>>)> {
        let tiles: Vec<u32> = places.iter().map(|place| self.built_tiles[*place]).collect();
        let list = StorageBuffer::from_slice(self.context.gpu(), "some tiles", &tiles)?;
        let stage = [stage, &self.march_slots()].concat();
        let count = tiles.len() as u32;
        let list = TileList { entries: &list, count, workgroups: self.workgroups_a_tile() };
        self.run_list(list, label, variant, &self.group(label, own), &stage, read)
    }

    /// Runs a compute pass over a list of tiles: once, or until no light ray waits for a page of the volume.
    fn run_list(
        &self,
        list: TileList<'_>,
        label: &'static str,
        variant: &ShaderVariant,
        group: &Group,
        stage: &[(u32, Slot<'_>)],
        read: Option<Read<'_>>,
    ) -> Result<(Span, Option<Vec<u32>>)> {
        let context = &self.context;
        let Some(stream) = context.transfer.stream() else {
            return context.run_over(list, label, variant, group, stage, read);
        };
        let words = variant.ray_state_words().ok_or_else(|| context.not_by_blocks())?;
        let states = ray_states(context.gpu(), self.records(), words)?;
        let stage = [stage, &[(RAY_STATE_BINDING, Slot::read_write(states.as_entire_binding()))]].concat();
        let variant = variant.clone().defs([RAY_STATES]);
        // Labels and gradients of a cell are read across the faces of its page.
        let reads_neighbours = context.transfer.has_labels || context.transfer.has_gradient_opacity;
        let reach = if reads_neighbours { PageReach::Neighbours } else { PageReach::Own };
        let mut ran: Option<(Span, Option<Vec<u32>>)> = None;
        stream.sweep(context.gpu(), context.volume, (self.light_rays(), reach), || {
            // Light rays that are finished take no time, so earlier passes tell nothing about this one.
            let pace = context.pace.unlearned();
            let context = BuildContext { pace: &pace, ..context.at_once() };
            let (span, read) = context.run_over(list, label, &variant, group, &stage, read)?;
            ran = Some((ran.take().map_or(span, |(before, _)| before.plus(span)), read));
            Ok(true)
        })?;
        ran.ok_or_else(|| context.not_by_blocks())
    }

    /// Returns the light rays of the map in voxel index coordinates.
    fn light_rays(&self) -> PassRays {
        let index_from_world = self.context.volume.index_from_world();
        match self.context.light {
            Light::Directional { toward } => PassRays::Along(-(index_from_world.matrix3 * toward)),
            Light::Point { position } => PassRays::From(index_from_world.transform_point3(position)),
        }
    }

    /// Returns bind group 2 and the dispatch size of a pass over all tiles that are built, for a submission with other
    /// passes. `stage` holds the shadow method's bindings of that group.
    pub fn pass(&self, label: &str, stage: &[(u32, Slot<'_>)]) -> (Group, [u32; 3]) {
        let list = (0, Slot::read(self.list.as_entire_binding()));
        let group = self.context.kernels.group(label, &[&[list][..], stage].concat());
        (group, shape_of(self.built * self.workgroups_a_tile()))
    }

    fn workgroups_a_tile(&self) -> u32 {
        TILE_TEXELS / self.context.gpu().tuning.workgroup_side.pow(2)
    }
}

/// Creates the buffer with the states of rays that have not started: `field/ray_state.wgsl`.
///
/// # Errors
/// The adapter cannot bind a buffer of this size.
pub fn ray_states(gpu: &Gpu, rays: u32, words: u32) -> Result<wgpu::Buffer> {
    let bytes = 4 * (1 + u64::from(rays) * u64::from(1 + words));
    let states = StorageBuffer::zeroed(gpu, "states of rays", bytes)?;
    gpu.queue.write_buffer(&states, 0, &rays.to_le_bytes());
    Ok(states)
}

/// Returns the tile table of a shadow map (storage index of each tile's first texel, or [`NO_TILE`]), and the list of
/// tiles that are stored.
fn layout(occupied: &TileSet, order: WorkOrder) -> (Vec<u32>, Vec<u32>) {
    let across = occupied.across();
    let tiles = order.positions([across; 2]).filter(|tile| occupied.contains(*tile));
    let list: Vec<u32> = tiles.map(|[x, y]| y * across + x).collect();
    let mut entries = vec![NO_TILE; (across * across) as usize];
    (0..)
        .step_by(TILE_TEXELS as usize)
        .zip(&list)
        .for_each(|(record, tile)| entries[*tile as usize] = record);
    (entries, list)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_tiles_have_no_records() {
        let mut occupied = TileSet::empty(2);
        occupied.insert([0, 0], [0, 1]);
        occupied.insert([1, 1], [1, 1]);
        for order in [WorkOrder::Spread, WorkOrder::Blocks] {
            assert_eq!(layout(&occupied, order), (vec![0, NO_TILE, 256, 512], vec![0, 2, 3]));
            assert_eq!(layout(&TileSet::empty(2), order), (vec![NO_TILE; 4], Vec::new()));
        }
    }
}
