//! Shadow methods: a folder each, and a line in [`registry`].
//!
//! A method states its settings ([`settings`]), builds what its lookup reads, offers that lookup, and says what it
//! promises. Everything else (light space, march, tiles, ray caster, queries, tables, plots, `--help`, the window)
//! takes it as it is. `docs/adding-a-method.md` adds one step by step.
//!
//! # What a method's shaders find and offer
//! * Group 0 is the field (`shaders/field/`), binding 0 of group 1 the light space (`umbravox::light`), which
//!   [`BuildContext`] and [`TileMarch`] bind. The rest of group 1 is the method's own: numbers, textures of any kind,
//!   samplers. A map of tiles has its table at binding 2.
//! * A build is one or more passes, most over tiles through [`TileMarch`]. A pass that marches light rays
//!   (`umbravox::march`) hands the pieces to the method's `umbravox::sink`, whose contract stands in
//!   `shaders/field/march.wgsl`.
//! * A lookup is a module `umbravox::method` with `fn transmittance(g: vec3<f32>) -> f32`, whose contract stands in
//!   `shaders/render/raycast.wgsl`.
//! * Constants that both sides know come from Rust, as `#{NAME}` ([`Constant`](crate::gpu::Constant)).

mod bom;
mod dom;
mod dsm;
#[cfg(feature = "half")]
mod half;
mod layered;
mod none;
mod osm;
mod rays;
pub mod registry;
pub mod settings;
pub mod spec;
mod style;

pub use bom::{BoundingOpacityMap, BoundingSplit, Measure, SplitChoice};
pub use dom::{Beyond, DeepOpacityMap};
pub use dsm::{DeepShadowMap, NodeMap, Precompress, node_map};
pub use none::NoShadows;
pub use osm::{OpacityShadowMap, Slicing};
pub use rays::ShadowRays;
pub use registry::{COMPARED, CURVES, Entry, METHODS, STABILITY, parse, parse_list};
pub use settings::{Key, Kind, Value, When};
pub use style::{Marker, Style};

pub use crate::field::{BuildContext, LightSpace, Projection, TILE, TileMarch};

use crate::error::Result;
use crate::field::{Omittable, marching};
use crate::gpu::{Group, ShaderVariant, Span};
use settings::choices;

/// What a method promises on light rays through texel centres, at every depth `z`:
/// `T_exact(z + depth_mm) - transmittance <= T_method(z) <= T_exact(z - depth_mm) + transmittance`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Error in transmittance.
    pub transmittance: f64,
    /// Error in depth, mm.
    pub depth_mm: f64,
}

/// Modules, definitions and constants that offer `umbravox::method::transmittance`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lookup(ShaderVariant);

impl Lookup {
    /// Of what [`field_shader`](crate::field::field_shader) begins; its entry does not matter.
    pub fn new(shader: ShaderVariant) -> Self {
        Self(shader)
    }

    /// The variant of a file with an entry point that looks light up.
    pub fn within(&self, entry: &'static str) -> ShaderVariant {
        ShaderVariant { entry, ..self.0.clone() }
    }

    /// A lookup marches a whole ray: pictures are then made in several dispatches.
    pub fn marches(&self) -> bool {
        marching(&self.0)
    }
}

/// A pass of a published method that nothing would have read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassLeftOut {
    /// The pass.
    pub what: &'static str,
    /// Why nothing would have read it.
    pub why: &'static str,
    /// Its name for `--force`, where it can be forced.
    pub optional: Option<Omittable>,
}

/// What building cost and made.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BuildReport {
    /// Host milliseconds before the device's work (fitting, tiles).
    pub host_ms: f64,
    /// The device's own time.
    pub device: Option<Span>,
    /// Bytes of the structure that lookups read.
    pub bytes: u64,
    /// Nodes stored.
    pub nodes_total: Option<u64>,
    /// The most nodes in one texel.
    pub nodes_max: Option<u64>,
    /// Texels whose ray meets extinction.
    pub texels_hit: Option<u64>,
    /// Tiles of the map.
    pub tiles: u32,
    /// Tiles left out since no active brick lies under them.
    pub tiles_left_out: u32,
    /// What these would have taken.
    pub bytes_left_out: u64,
    /// Times the build was repeated because the pool had run out.
    pub pool_growths: u32,
    /// Passes that nothing would have read.
    pub passes_left_out: &'static [PassLeftOut],
    /// The ratio that was chosen for the split of layers, where one was.
    pub split_choice: Option<SplitChoice>,
}

impl BuildReport {
    /// Host plus device milliseconds, by the better clock.
    pub fn build_ms(&self) -> f64 {
        self.host_ms + self.device.map_or(0.0, |s| s.best().0)
    }
}

/// A built shadow structure for one light.
pub struct ShadowMap {
    /// Name of the method.
    pub method: &'static str,
    /// Group 1 of what looks it up.
    pub(crate) group: Group,
    /// How it is looked up; `None`: everything is lit.
    pub lookup: Option<Lookup>,
    /// Its projection.
    pub light_space: LightSpace,
    /// What it cost.
    pub report: BuildReport,
    /// What it promises, where it promises anything.
    pub bound: Option<Bound>,
}

/// A shadow method with its settings.
pub trait Method: std::fmt::Debug + Send + Sync {
    /// Its line of the registry.
    fn entry(&self) -> &'static Entry;
    /// Its settings: values of the entry's keys, in their order.
    fn values(&self) -> Vec<Value>;
    /// How what [`Self::build`] makes is looked up; `None`: everything is lit.
    fn lookup(&self) -> Option<Lookup>;
    /// The passes that [`Self::build`] may run, for tests of shaders.
    fn passes(&self) -> Vec<ShaderVariant> {
        Vec::new()
    }
    /// Sub-texel rays whose mean a texel stands for.
    fn taps(&self) -> u32 {
        1
    }
    /// Makes what lookups read.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold.
    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap>;

    /// Name on the command line and in tables.
    fn name(&self) -> &'static str {
        self.entry().name
    }

    /// Its own settings as `key=value` separated by spaces, for tables: the telling ones, and what differs from the
    /// defaults; without the side of the map, which has a column of its own.
    fn params(&self) -> String {
        let (keys, values) = (self.entry().keys, self.values());
        let shown = |(key, value): &(&Key, &Value)| {
            key.name != MAP
                && settings::applies(keys, &values, key)
                && (key.telling || Some(**value) != key.parse(key.default))
        };
        let settings = keys.iter().zip(&values).filter(shown);
        settings.map(|(key, value)| format!("{}={value}", key.name)).collect::<Vec<_>>().join(" ")
    }

    /// Texels a side, where it has a map.
    fn map_size(&self) -> Option<u32> {
        let mut settings = self.entry().keys.iter().zip(self.values());
        settings.find_map(|(key, value)| match value {
            Value::Whole(side) if key.name == MAP => Some(side),
            _ => None,
        })
    }
}

/// Name of the key for texels a side.
const MAP: &str = "map";
/// Key of methods that have a map.
const MAP_KEY: Key = Key::whole([1, 8192], "512", "texels a side");

choices! {
    /// How the four texels around a point are used.
    pub enum Filter {
        /// The nearest one.
        Nearest = "nearest",
        /// All of them, by how near they are.
        Bilinear = "bilinear",
    }
}

/// Key of methods whose maps are filtered.
const FILTER_KEY: Key = Key::choice(Filter::NAMES, "bilinear", "texels used for a point");

/// Optical depth at which a light ray is over (a transmittance of 2^-11).
const OPAQUE_DEPTH: f32 = 7.6246;
/// What the polyline that a march hands to a sink may stray from the curve between its points, in transmittance.
const CHORD_TOLERANCE: f64 = 0.002;
/// Slope against the light up to which neighbouring texels are taken to see one surface.
const STEEPEST_SURFACE: f64 = 4.0;

/// Optical depth whose chord stays within [`CHORD_TOLERANCE`] at transmittance 1: a chord of length `h` strays by at
/// most `h^2 sigma^2 / 8`.
fn longest_depth() -> f32 {
    (8.0 * CHORD_TOLERANCE).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_is_over_at_the_stated_transmittance() {
        assert!((f64::from(-OPAQUE_DEPTH).exp() * 2048.0 - 1.0).abs() < 1e-4);
    }
}
