//! Enclosure of the exact transmittance (`enclose=on`): a lower and an upper bound for every point, not only for points
//! on the light rays through texel centres.
//!
//! All light rays whose nearest texel is the same pass through its prism. Along the prism, the largest extinction at
//! each depth gives a transmittance below that of each of these rays, and the least extinction one above. Both curves
//! are compressed like those of the map, within half of `epsilon`, and widened by the error bound of that compression.
//! Queries march the last `near` voxels before a point, like those of the map,
//! here cell by cell. `docs/bound.md` has the derivation.

use super::build::RowPass;
use super::layout::{NAME, Side};
use super::{DeepShadowMap, Enclose, Precompress};
use crate::error::{Error, Result};
use crate::field::{BuildContext, Prism, TileMarch};
use crate::gpu::{Slot, table_texture, uniform_buffer};
use crate::shadow::bound::Bound;
use crate::shadow::filter::Filter;
use crate::shadow::keys::{Align, DrawnFrom, MarchBy};
use crate::shadow::method::{BuildReport, Enclosure, ShadowMap};
use crate::volume::BRICK_CELLS;
use bytemuck::{Pod, Zeroable};

impl BuildReport {
    /// Adds the time and the memory of an enclosure.
    pub(super) fn add_enclosure(&mut self, enclosure: &Enclosure) {
        for map in [&enclosure.lower, &enclosure.upper] {
            self.device = match (self.device, map.report.device) {
                (Some(own), Some(more)) => Some(own.plus(more)),
                (own, more) => own.or(more),
            };
            self.enclosure_bytes += map.report.bytes;
            // The curves are built one after another.
            self.build_bytes = self.build_bytes.max(map.report.build_bytes);
            self.pool_growths += map.report.pool_growths;
        }
    }
}

/// Hint for builds that exceed a software adapter's limit on loop iterations.
const LOOP_LIMIT_HINT: &str = "software adapters limit loops: prisms of a larger map meet fewer voxels";

/// Uniform of the build of an enclosure; mirrors struct `Enclosing` in `shaders/shadow/dsm/ranges.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Enclosing {
    grid_per_mm: [f32; 3],
    half_texels: f32,
    margins_mm: [f32; 2],
    slab_mm: f32,
    value_error: f32,
    brick_margin: i32,
    padding: [u32; 3],
}

impl Enclosing {
    fn new(context: &BuildContext<'_>, tiles: &TileMarch<'_>) -> Self {
        let Prism { half_texels, margins_mm, reach_mm, slab_mm, grid_per_mm } =
            tiles.light_space.prism(context.volume, context.transfer.clips);
        Self {
            grid_per_mm: grid_per_mm.as_vec3().to_array(),
            half_texels: half_texels as f32,
            margins_mm: margins_mm.map(|mm| mm as f32),
            slab_mm: slab_mm as f32,
            value_error: context.transfer.value_rounding_texels() as f32,
            brick_margin: (reach_mm * grid_per_mm.max_element() / BRICK_CELLS as f64).ceil() as i32,
            padding: [0; 3],
        }
    }
}

impl DeepShadowMap {
    /// Returns the settings of the curves that enclose the transmittance: those of the map, as far as they concern
    /// curves of single prisms.
    pub(super) fn enclosing_curves(&self) -> Self {
        Self {
            epsilon: 0.5 * self.epsilon,
            from: DrawnFrom::Voxels,
            prefilter: 1,
            precompress: Precompress::Table,
            march: MarchBy::Cells,
            filter: Filter::Nearest,
            align: Align::Off,
            offset: 0.0,
            enclose: Enclose::Off,
            ..*self
        }
    }

    /// Builds the enclosure of a map with the given tiles; `None` unless the settings ask for one.
    ///
    /// # Errors
    /// The volume has labels with their own transfer functions, there is a gradient opacity, or the adapter cannot hold the curves.
    pub(super) fn build_enclosure(
        &self,
        context: &BuildContext<'_>,
        tiles: &TileMarch<'_>,
    ) -> Result<Option<Enclosure>> {
        if self.enclose == Enclose::Off || self.from == DrawnFrom::Lines {
            return Ok(None);
        }
        if context.transfer.has_labels {
            let why = "labels use several transfer functions, whose ranges it cannot take";
            return Err(Error::input("cannot enclose the transmittance", "enclose=on", why));
        }
        if context.transfer.has_gradient_opacity {
            let why = "the extinction depends on the gradient, whose range it cannot take";
            return Err(Error::input("cannot enclose the transmittance", "enclose=on", why));
        }
        let context = &context.at_once();
        let curves = self.enclosing_curves();
        let tolerances =
            curves.bound(context, &tiles.light_space).expect("curves marched cell by cell have a bound");
        let [lower, upper] = Side::BOTH.map(|side| curves.bounding_map(context, tiles, side, tolerances));
        Ok(Some(Enclosure::new(lower?, upper?, tolerances)))
    }

    /// Builds the map of the curves of one side.
    fn bounding_map(
        &self,
        context: &BuildContext<'_>,
        tiles: &TileMarch<'_>,
        side: Side,
        tolerances: Bound,
    ) -> Result<ShadowMap> {
        let gpu = context.gpu();
        let uniform = uniform_buffer(gpu, "enclosure", &Enclosing::new(context, tiles));
        let table = context.transfer.extinction_ranges();
        let columns = table.columns as u32;
        let size = [columns, table.ranges.len() as u32 / columns];
        let ranges =
            table_texture(gpu, "extinction ranges", wgpu::TextureFormat::Rg32Float, size, &table.ranges)?;
        let own = [(5, context.kernels.uniform(&uniform)), (6, Slot::floats(&ranges))];
        let (label, shader) = ("enclosing curves build", self.prism_shader(side));
        let pass = RowPass { label, shader, own: &own, hint: Some(LOOP_LIMIT_HINT) };
        let key = format!("{self:?} {side:?}");
        let known = context.node_pools.last_sizes(&key);
        let rows = self.build_rows(context, tiles, &pass, known)?;
        let mut report = rows.report(tiles);
        let mut nodes = self.compact(context, tiles, rows, known)?;
        nodes.add_to(&mut report);
        if let Some(words) = &nodes.counted {
            self.add_counts(&mut report, &self.counters(words)?, key, context.node_pools);
        }
        nodes.widen(tolerances, side);
        Ok(ShadowMap {
            method: NAME,
            group: nodes.group(context, tiles),
            lookup: Some(self.bounding_lookup(side)),
            report,
            bound: None,
            light_space: tiles.light_space.clone(),
            enclosure: None,
            sections: None,
            _pool: Some(nodes.pool),
        })
    }
}
