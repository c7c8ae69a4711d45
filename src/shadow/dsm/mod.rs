//! Shadow method `dsm`: tiled deep shadow maps.
//!
//! Hadwiger, Kratz, Sigg, Bühler 2006, *GPU-Accelerated Deep Shadow Maps for Direct Volume Rendering*; compression
//! after Lokovic and Veach 2000. Symbols: `epsilon` is the paper's error bound on transmittance.
//!
//! Deviations from the paper, and why:
//! * One compute pass builds the map. The paper's passes of eight nodes each become rows of seven curve nodes and a
//!   link. Every texel of a tile that meets extinction has a first row. Further rows come from a pool that all tiles
//!   share, so that one texel with many nodes does not enlarge its whole tile. If the pool is too small, it grows,
//!   and the tiles that lack rows are built again.
//! * Light rays are marched cell by cell instead of at regular steps. Inside a cell the value along a ray is a cubic,
//!   and the pre-compressed transfer-function table gives the values at which extinction bends, so that no peak is
//!   missed. `march=samples` takes the paper's regular steps, with the integrals of extinction between them.
//! * The slope of a stored line segment is at most zero, so that stored transmittance never rises with depth. This
//!   stays within the error bound.
//! * `filter=bilinear` aligns the four transmittance curves at their first depths, if these are close enough to be
//!   one surface, before it averages them: otherwise slanted lit surfaces shadow themselves. Rays through texel
//!   centres, and so the error bound, do not depend on it.
//! * A curve node has 4 bytes: 16-bit depth within the map's range and 16-bit transmittance.
//! * `compress=optimal` stores the fewest nodes (Imai and Iri 1986, *An optimal algorithm for approximating a
//!   piecewise linear function*; 1988, *Polygonal approximations of a curve*) among the curves that begin with
//!   extinction, stay within `epsilon` of the marched polyline, and are level behind their last node. The number of
//!   nodes is the minimum if the algorithm's convex hulls have up to 10 corners. For larger hulls the allowed error
//!   is reduced, so that the bound holds. `docs/bound.md` has the proof; `tests/gpu/tunnel.rs` measures how far from
//!   the minimum the number is.
//! * `precompress=off` takes point samples of extinction at regular steps, as the paper's Figure 3 (left).

mod count;
mod layout;

pub use count::{NodeMap, node_depths, node_map};

use layout::{DEPTH_STEPS, NAME, NODE_FORMAT, NODE_TEXTURE_WIDTH, ROW_BYTES, UPRIGHT_STEPS, shader};

use super::keys::{
    DrawnFrom, FILTER_KEY, FIT_KEY, FROM_KEY, Filter, Fit, LOOKUP_KEY, Lookups, MAP_KEY, MARCH_KEY, MarchBy,
    UNLESS_LINES, settings,
};
use super::method::{Bound, BuildReport, Entry, Lookup, Method, ShadowMap, Taps};
use super::settings::{Key, Value, When, choices};
use super::style::{Marker, Style};
use super::tolerances::{CHORD_TOLERANCE, STEEPEST_SURFACE, longest_depth, march_bound};
use crate::error::{Error, Result};
use crate::field::{BuildContext, DEPTH_SINK, LightSpace, March, NodePool, TILE_TEXELS, TileMarch};
use crate::gpu::tuning::{MAX_LATTICE_MARCHES, MAX_LATTICE_STEPS};
use crate::gpu::{
    Read, ShaderVariant, Slot, Span, StorageBuffer, copy_rows, read_back, store_texture, uniform_buffer,
};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Transmittance at which the march of a light ray ends (`exp(-OPAQUE_DEPTH)` of the shaders).
const RAY_END: f64 = 1.0 / 2048.0;
/// Bound on the error from rounding the transmittances at both ends of a line segment of a deep shadow map to 16
/// bits.
const STORAGE: f64 = 1.0 / 65535.0;

choices! {
    /// Algorithm that compresses the transmittance curve of a light ray to a piecewise linear curve of few nodes.
    pub enum Compress {
        /// Greedy compression of a transmittance curve (Lokovic and Veach 2000): each line segment starts at the end
        /// of the last one, and is as long as the error bound allows.
        Greedy = "greedy",
        /// Compression of a transmittance curve to the fewest nodes within the error bound (Imai and Iri 1986); nodes
        /// need not lie on the curve.
        Optimal = "optimal",
    }
}

choices! {
    /// Way in which a march of light rays evaluates extinction: with the pre-compressed transfer-function table of
    /// Hadwiger et al. 2006, or without it.
    pub enum Precompress {
        /// Integrates extinction along light rays with the pre-compressed transfer-function table.
        Table = "table",
        /// Takes point samples of extinction along light rays at regular steps, without the pre-compressed table.
        Off = "off",
    }
}

settings! {
    /// Settings of a deep shadow map.
    pub struct DeepShadowMap {
        /// Largest error in transmittance that the compression of a deep shadow map may make (`epsilon` of Hadwiger
        /// et al. 2006).
        epsilon: f64 = Key::number([0.0, 1.0], "0.02", "error bound of compression, in transmittance")
            .in_label()
            .coarse("0.05")
            .search(&["0.2", "0.1", "0.06", "0.04", "0.02", "0.01", "0.005", "0.002"]),
        /// Algorithm that compresses the transmittance curve of a light ray to a piecewise linear curve of few nodes.
        compress: Compress = Key::choice(
            Compress::NAMES,
            "greedy",
            "compression: greedy segments (Lokovic and Veach), or the fewest nodes within epsilon (Imai and Iri)",
        ),
        /// Geometry that casts the shadows: the voxels of the volume, or the strands (line segments of hair or
        /// fibres) from which the volume was made.
        from: DrawnFrom = FROM_KEY,
        /// Number of sub-texel light rays whose mean transmittance a shadow map texel stores: 1, 5 or 9.
        prefilter: u32 = Key::choice(&["1", "5", "9"], "1", "number of light rays averaged in a texel")
            .coarse("1")
            .search(&["1", "5"])
            .when(UNLESS_LINES),
        /// Evaluation of extinction along light rays: with the pre-compressed transfer-function table, or by regular
        /// point samples.
        precompress: Precompress = Key::choice(
            Precompress::NAMES,
            "table",
            "pre-compressed transfer-function table, or point samples at regular steps",
        )
        .when(UNLESS_LINES),
        /// Way in which light rays are marched: cell by cell with exact integrals, or by samples at regular
        /// distances.
        march: MarchBy = MARCH_KEY.when(When::UnlessEither([("precompress", "off"), ("from", "lines")])),
        /// Number of shadow map texels per side; `None` if chosen from the scene.
        map: Option<u32> = MAP_KEY,
        /// Region that the shadow map covers: the bricks (blocks of voxels) with extinction that the camera sees, or
        /// all bricks with extinction.
        fit: Fit = FIT_KEY,
        /// Interpolation between the shadow map texels around a point: nearest or bilinear.
        filter: Filter = FILTER_KEY,
        /// Distance between regular samples along a light ray, in units of the smallest voxel spacing. It applies to
        /// `march=samples` and `precompress=off`; pre-filtered maps with the pre-compressed table take half of it.
        step: f64 = Key::number(
            [0.01, 8.0],
            "0.5",
            "step along light rays, in units of the smallest voxel spacing (march=samples, precompress=off, prefilter)",
        ),
        /// Offset (bias) added to the depth of a point, as seen from the light, before its transmittance is queried;
        /// in units of the smallest voxel spacing.
        offset: f64 = Key::number([-8.0, 8.0], "0", "bias added to the depth of a point, in units of the smallest voxel spacing"),
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: NAME,
    summary: "tiled deep shadow maps (Hadwiger et al. 2006), error-bounded",
    keys: DeepShadowMap::KEYS,
    make: |values| Some(Box::new(DeepShadowMap::from_values(values)?)),
    compared: "dsm:epsilon=0.06,0.02,0.005",
    curve: "dsm:epsilon=0.06,0.02",
    stability: "dsm:map=64",
    style: Style { color: [0, 114, 178], marker: Marker::Circle },
};

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
    same_surface_steps: f32,
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
    fn march(&self) -> March {
        self.from.march(self.march, self.step)
    }

    /// Returns the number of sub-texel light rays for each shadow map texel; maps drawn from strands use one.
    fn taps_a_texel(&self) -> u32 {
        if self.from == DrawnFrom::Lines { 1 } else { self.prefilter }
    }

    /// Whether the compression receives the whole transmittance curve of a single light ray, instead of samples at
    /// regular depths.
    fn whole_curve(&self) -> bool {
        self.from == DrawnFrom::Lines || self.precompress == Precompress::Table && self.taps_a_texel() == 1
    }

    /// Returns the distance (mm) between regular samples along a light ray of a deep shadow map. Texels that store
    /// the mean of several exact curves use half a step, so that the samples err by at most half a step in depth. The
    /// distance grows if a ray would need too many steps ([`tuning`](crate::gpu::tuning)), as for very anisotropic
    /// voxels.
    fn lattice_mm(&self, context: &BuildContext<'_>, light_space: &LightSpace) -> f64 {
        let (share, most) = match self.precompress {
            Precompress::Table => (0.5, MAX_LATTICE_MARCHES),
            Precompress::Off => (1.0, MAX_LATTICE_STEPS),
        };
        let shortest = light_space.depth_range_mm() / f64::from(most / self.taps_a_texel());
        (share * self.step * context.volume.min_spacing_mm()).max(shortest)
    }

    /// Returns the error bound of a deep shadow map, or `None` unless its light rays are marched cell by cell with
    /// the pre-compressed table. `docs/bound.md` derives its terms.
    fn bound(&self, context: &BuildContext<'_>, light_space: &LightSpace) -> Option<Bound> {
        if self.precompress == Precompress::Off || self.march() != March::Cells {
            return None;
        }
        let spacing = context.volume.min_spacing_mm();
        let (chord, lattice_mm) = if self.whole_curve() {
            (CHORD_TOLERANCE, 0.0)
        } else {
            (0.0, self.lattice_mm(context, light_space))
        };
        let march = march_bound(context, light_space);
        // Rounded texel coordinates of a point on a texel's ray give its neighbours a weight.
        let rounding = light_space.rounding(context.volume, context.transfer.clips);
        let neighbours = match self.filter {
            Filter::Bilinear => rounding.texels,
            Filter::Nearest => 0.0,
        };
        let steps = match self.compress {
            Compress::Greedy => 0.5,
            Compress::Optimal => 0.5 + 2.0 * UPRIGHT_STEPS,
        };
        let steps_mm = steps * light_space.depth_range_mm() / f64::from(DEPTH_STEPS);
        Some(Bound {
            transmittance: march.transmittance + self.epsilon + chord + RAY_END + STORAGE + 2.0 * neighbours,
            depth_mm: march.depth_mm + steps_mm + lattice_mm + self.offset.abs() * spacing,
            from_light_mm: rounding.from_light_mm,
            ..march
        })
    }

    fn build_shader(&self) -> ShaderVariant {
        let compress = match self.compress {
            Compress::Greedy => "shadow/dsm/greedy.wgsl",
            Compress::Optimal => "shadow/dsm/tunnel.wgsl",
        };
        let modules = ["field/tiles.wgsl", "shadow/dsm/rows.wgsl", compress];
        let shader = shader("shadow/dsm/build.wgsl").modules(&modules);
        let shader = shader.defs((self.taps_a_texel() > 1).then_some("PREFILTER"));
        match (self.precompress, self.whole_curve()) {
            (_, true) => {
                shader.defs(["WHOLE_CURVE", "MARCHES"]).with_march(self.march(), "shadow/dsm/sink.wgsl")
            }
            (Precompress::Off, false) => shader,
            (_, false) => shader.defs(["MARCHES"]).with_march(self.march(), DEPTH_SINK),
        }
    }

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
            same_surface_steps: (STEEPEST_SURFACE * tiles.light_space.texel_mm() * steps_per_mm) as f32,
            padding: [0.0; 3],
        }
    }

    /// Builds the given tiles of a deep shadow map (`None` for all), and stores their curve nodes as rows in a
    /// texture; `counters` holds the number of rows in use.
    fn fill(
        &self,
        context: &BuildContext<'_>,
        tiles: &TileMarch<'_>,
        some: Option<&[usize]>,
        params: &DsmParams,
        (nodes, requested): (&wgpu::TextureView, &wgpu::Buffer),
        counters: Counters,
    ) -> Result<(Span, Counters)> {
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
        let hint =
            "software adapters limit loops: use fewer pre-filter taps, a longer step, or march=samples";
        let many = self.taps_a_texel() > 1 && self.march == MarchBy::Cells;
        let (span, words) = ran.map_err(|e| if many { e.hint(hint) } else { e })?;
        let counters: Counters = bytemuck::pod_read_unaligned(bytemuck::cast_slice(&words));
        if counters.texels_cut > 0 {
            let why = format!("the adapter ended {} light rays early", counters.texels_cut);
            return Err(Error::runtime("cannot build the deep shadow map", self.params(), why).hint(hint));
        }
        Ok((span, counters))
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

impl Method for DeepShadowMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn taps(&self) -> Taps {
        Taps::Within(self.taps_a_texel())
    }

    fn lookup(&self) -> Option<Lookup> {
        let bilinear = (self.filter == Filter::Bilinear).then_some("FILTER_BILINEAR");
        let lookup = Lookup::new(shader("").modules(&["shadow/dsm/lookup.wgsl"]).defs(bilinear));
        Some(lookup.with_lookup_mode(self.lookup))
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        vec![self.build_shader(), count::shader(), count::steps_shader()]
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let gpu = context.gpu();
        let tiles = TileMarch::fit(context, self.fit.shape(self.map, self.march()))?;
        let mut params = self.params_on_device(context, &tiles);
        // Starts with the rows of the last build and a reserve, since the light may have moved. In the first build, a
        // quarter more rows than texels suffices for most scenes.
        let settings = self.spec().to_string();
        let known = context.node_pools.last_size(&settings);
        let more = |share: f64| (share * 1.125 * f64::from(params.tile_rows)) as u32 + params.tile_rows / 64;
        let pool_rows = params.tile_rows + known.map_or(params.tile_rows / 4, more);
        let mut pool = node_pool(context, pool_rows)?;
        params.pool_rows = pool.rows;
        let requested = StorageBuffer::zeroed(gpu, "requested rows", 8 * u64::from(tiles.built))?;
        let (mut device, counters) =
            self.fill(context, &tiles, None, &params, (&pool.view, &requested), Counters::zeroed())?;
        let mut overflow_rows = counters.overflow_rows;
        let mut pool_growths = 0;
        if params.tile_rows + overflow_rows > params.pool_rows {
            // Complete tiles stay; tiles that lack rows are built again into rows appended to the pool.
            let rows = read_back::<[u32; 2]>(gpu, &requested, tiles.built as usize)?;
            let short: Vec<usize> = (0..rows.len()).filter(|place| rows[*place][1] > 0).collect();
            let missing: u32 = short.iter().map(|place| rows[*place][0]).sum();
            let before = params.pool_rows;
            let larger = node_pool(context, before + missing)?;
            params.pool_rows = larger.rows;
            copy_rows(gpu, &pool.view, &larger.view, before / (NODE_TEXTURE_WIDTH / 2))?;
            pool = larger;
            let used = Counters { overflow_rows: before - params.tile_rows, ..Zeroable::zeroed() };
            let (took, counted) =
                self.fill(context, &tiles, Some(&short), &params, (&pool.view, &requested), used)?;
            device = device.plus(took);
            overflow_rows = counted.overflow_rows;
            pool_growths = 1;
            if params.tile_rows + overflow_rows > params.pool_rows {
                let why = "tiles that were built again requested more rows than at first";
                return Err(Error::runtime("cannot build the deep shadow map", self.params(), why));
            }
        }
        let share = f64::from(counters.overflow_rows) / f64::from(params.tile_rows.max(1));
        context.node_pools.learn_size(settings, share);
        let used_rows = params.tile_rows + overflow_rows;
        let uniform = uniform_buffer(gpu, "deep shadow map", &params);
        let left_out = tiles.tiles - tiles.built;
        Ok(ShadowMap {
            method: NAME,
            group: tiles.group(
                "deep shadow map",
                &[(1, context.kernels.uniform(&uniform)), (3, Slot::words(&pool.view))],
            ),
            lookup: self.lookup(),
            report: BuildReport {
                host_ms: 0.0,
                device: Some(device),
                bytes: u64::from(params.pool_rows) * ROW_BYTES + tiles.table_bytes(),
                bytes_used: u64::from(used_rows) * ROW_BYTES + tiles.table_bytes(),
                guessed: known.is_none(),
                nodes_total: Some(u64::from(counters.nodes_total)),
                nodes_max: Some(u64::from(counters.nodes_max)),
                texels_hit: Some(u64::from(counters.texels_hit)),
                texels_narrowed: (self.compress == Compress::Optimal)
                    .then_some(u64::from(counters.texels_narrowed)),
                tiles: tiles.tiles,
                tiles_left_out: left_out,
                bytes_left_out: u64::from(left_out * TILE_TEXELS) * ROW_BYTES,
                pool_growths,
                passes_left_out: &[],
                split_choice: None,
            },
            bound: self.bound(context, &tiles.light_space),
            light_space: tiles.light_space,
            _pool: Some(pool),
        })
    }
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
            depth_offset_mm, depth_steps_per_mm, same_surface_steps);
    }
}
