//! Shadow method `osm`: opacity shadow maps.
//!
//! Kim and Neumann 2001, *Opacity Shadow Maps*. Symbols: `D_i` (`1 <= i <= N`) is the depth of the i-th map, `D_0`
//! the least depth of the volume, `Ω` the opacity thickness stored at a texel of a map, `κ` the scale of stored
//! opacities with `exp(-κ) = 2^-d` for `d` bits. `T = exp(-κ Ω)`, `Ω` linear between `D_(i-1)` and `D_i`.
//!
//! Deviations from the paper, and why:
//! * The planes of a point light are spheres: depth is distance along the light ray, as for every method here.
//! * One pass that marches the light ray of each texel makes all maps; the paper draws the primitives once for each
//!   map.
//! * `slicing=density` is the limit of the paper's 1-D BSP: planes at equal shares of the optical mass by depth,
//!   summed over 128 x 128 rays in 1024 bins. Planes begin at the first bin with mass; matter in front of it that is
//!   narrower than the spacing of rays casts no shadow there. Mass that no light reaches counts, too; `slicing=lit`
//!   sums the lost light instead. `slicing=gamma` places plane `i` at the share `(i / N)^2.2`.
//! * All maps are stored, since a ray caster queries depths in any order; the paper stores two at a time.
//! * `between=cubic` is a monotone cubic (Fritsch and Butland 1984, *A method for constructing local monotone piecewise
//!   cubic interpolants*); the paper names a cubic spline, which may overshoot.
//! * 8 bits are the paper's; 16-bit and 32-bit floats hold the optical depth itself.

use super::filter::Taps;
use super::keys::{Align, LOOKUP_KEY, Lookups, settings};
use super::layered::{
    self, AVERAGE_KEY, Average, BITS_KEY, LAYERS, LayeredMap, Record, SPLIT_BINS, Split, SplitSearch,
    SplitTable,
};
use super::lookup::Lookup;
use super::method::{Entry, Method, PassLeftOut, ShadowMap};
use super::published::Published;
use super::settings::{Key, Value, When, choices};
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::{BuildContext, MapShape, March, TileMarch};
use crate::gpu::{Constant, ShaderVariant, Slot, StorageBuffer, read_back, uniform_buffer};

/// Exponent `g` in the depth `(i / N)^g` of plane `i` of an opacity shadow map (`slicing=gamma`), as a share of the
/// depth range.
const GAMMA: f64 = 2.2;
/// Number of light rays per side of the grid of rays along which the optical mass (summed optical depth) is measured
/// by depth.
const MASS_RAYS: u32 = 128;

choices! {
    /// Rule by which the planes of an opacity shadow map are placed in depth.
    pub enum Slicing {
        /// Places the planes of an opacity shadow map at equal distances from each other.
        Uniform = "uniform",
        /// Places the planes at equal shares of the optical mass (optical depth summed over light rays), lit or not.
        Density = "density",
        /// Places the planes of an opacity shadow map at equal shares of the absorbed light.
        Lit = "lit",
        /// Places the planes of an opacity shadow map at distances that grow away from the light.
        Gamma = "gamma",
    }
}

choices! {
    /// Interpolation of optical depth between the planes of an opacity shadow map.
    pub enum Between {
        /// Interpolates optical depth linearly between two planes.
        Linear = "linear",
        /// Interpolates optical depth by a monotone cubic, from four planes.
        Cubic = "cubic",
    }
}

settings! {
    /// Settings of an opacity shadow map.
    pub struct OpacityShadowMap {
        /// Number of planes of an opacity shadow map (`N` of Kim and Neumann 2001).
        layers: u32 = Key::whole(LAYERS, "32", "number of planes").in_label().search(&["2", "4", "8", "16", "32", "64", "128"]),
        /// Rule by which the planes of an opacity shadow map are placed in depth.
        slicing: Slicing = Key::choice(
            Slicing::NAMES,
            "uniform",
            "positions of planes: evenly spaced, at equal shares of optical depth or of absorbed light, or denser near the light",
        )
        .search_all(),
        /// Width, in texels, of the square of shadow map texels over which a transmittance query averages: 1 or 3.
        kernel: u32 = Key::choice(&["1", "3"], "1", "width of the averaging kernel, in texels")
            .search_all()
            .when(When::UnlessAny(&[("filter", "gauss"), ("filter", "pcf")])),
        /// Interpolation of optical depth between the planes of an opacity shadow map.
        between: Between = Key::choice(Between::NAMES, "linear", "optical depth between planes: linear, or a monotone cubic"),
        /// Number of bits of each optical depth stored in an opacity shadow map: 8, 16 or 32.
        bits: u32 = BITS_KEY,
        ..MapSettings,
        /// Quantity that a transmittance query averages among shadow map texels: optical depth or transmittance.
        average: Average = AVERAGE_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "osm",
    summary: "opacity shadow maps (Kim and Neumann 2001): planes across the light",
    keys: OpacityShadowMap::KEYS,
    make: |values| Some(Box::new(OpacityShadowMap::from_values(values)?)),
    compared: "osm:layers=8,32,128",
    curve: "osm:layers=16",
    stability: "osm:layers=32,map=64,near=0",
    published: Some(Published {
        paper: "Kim and Neumann 2001",
        settings: "osm:kernel=3,filter=nearest,near=0,average=depth,lookup=each",
    }),
    style: Style { color: [230, 159, 0], marker: Marker::Square },
};

/// Pass that sums the optical depth of the volume by depth, which is skipped: an opacity shadow map with a single
/// plane does not need it.
const NOT_WEIGHED: PassLeftOut =
    PassLeftOut { what: "weighing the volume", why: "a single plane lies at its far side", optional: None };

fn mass_shader(march: March, lit: bool) -> ShaderVariant {
    let shader =
        layered::shader("shadow/osm/mass.wgsl").constants(&[Constant::unsigned("MASS_RAYS", MASS_RAYS)]);
    shader.defs(lit.then_some("WEIGH_LIGHT")).with_march(march, "shadow/osm/mass_sink.wgsl")
}

impl OpacityShadowMap {
    fn map_shape(&self) -> MapShape {
        let shape = self.shape();
        MapShape { reach: shape.reach.max(self.kernel.div_ceil(2)), ..shape }
    }

    fn layered_map(&self, split: Split) -> LayeredMap {
        let Self { layers, bits, filter, average, kernel, .. } = *self;
        let record = Record { layers, bits, depths: 0, depth_bits: 0, own_split: false };
        let shape = self.map_shape();
        LayeredMap { record, split, reach: 1.0, last_takes_rest: true, filter, average, kernel, shape }
    }

    /// Returns the positions of an opacity shadow map's planes as a division into layers; `None` if they depend on
    /// the volume's optical depth.
    fn plain_split(&self) -> Option<Split> {
        match self.slicing {
            Slicing::Uniform => Some(Split::Power(1.0)),
            Slicing::Gamma => Some(Split::Power(GAMMA)),
            Slicing::Density | Slicing::Lit => (self.layers == 1).then_some(Split::Power(1.0)),
        }
    }

    /// Sums the optical depth of many light rays (or the light absorbed along them) in bins of depth, in fixed point.
    fn weigh(&self, context: &BuildContext<'_>, tiles: &TileMarch<'_>) -> Result<(Vec<u32>, SplitSearch)> {
        let gpu = context.gpu();
        let params = self.layered_map(Split::Power(1.0)).params(&tiles.light_space);
        let params = uniform_buffer(gpu, "optical mass", &params);
        let mass = StorageBuffer::zeroed(gpu, "optical mass", 4 * SPLIT_BINS as u64)?;
        let mut stage = tiles.march_slots();
        stage.push((0, Slot::read_write(mass.as_entire_binding())));
        let groups = [
            &tiles.group("optical mass", &[(1, context.kernels.uniform(&params))]),
            &context.kernels.group("optical mass", &stage),
        ];
        let shader = mass_shader(self.map_shape().march, self.slicing == Slicing::Lit);
        let device = context.run("optical mass", &shader, groups, [MASS_RAYS / 8, MASS_RAYS / 8, 1])?;
        Ok((read_back::<u32>(gpu, &mass, SPLIT_BINS)?, SplitSearch { device, bytes: mass.size() }))
    }
}

impl Method for OpacityShadowMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn lookup(&self) -> Option<Lookup> {
        let split = self.plain_split().unwrap_or(Split::Tables(Vec::new()));
        let modules = ["shadow/osm/cubic.wgsl", "shadow/osm/lookup.wgsl"];
        let lookup = self.layered_map(split).lookup(&modules, Align::Off);
        let cubic = (self.between == Between::Cubic).then_some("CUBIC");
        Some(lookup.defs(cubic).with_lookup_mode(self.lookup))
    }

    fn taps(&self) -> Taps {
        self.filter.taps(Taps::Texels(self.kernel))
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        let split = self.plain_split().unwrap_or(Split::Tables(Vec::new()));
        let layered_map = self.layered_map(split);
        vec![
            layered_map.build_shader(),
            mass_shader(layered_map.shape.march, false),
            mass_shader(layered_map.shape.march, true),
        ]
    }

    fn builds_on_device(&self) -> bool {
        self.plain_split().is_some() && self.shape().march == March::Cells
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let tiles = TileMarch::fit(context, self.map_shape())?;
        let (split, search) = match self.plain_split() {
            Some(split) => (split, None),
            None => {
                let (mass, costs) = self.weigh(context, &tiles)?;
                (Split::Tables(vec![SplitTable::of_mass(&mass)]), Some(costs))
            }
        };
        let mut built = self.layered_map(split).build(context, tiles, None)?;
        built.after(search);
        if matches!(self.slicing, Slicing::Density | Slicing::Lit) && search.is_none() {
            built.report.passes_left_out = &[NOT_WEIGHED];
        }
        Ok(built.into_map(context, self))
    }
}
