//! Shadow methods: one narrow trait, one registry list, one file a method.
//!
//! A method says which shader modules look light up, builds what they read, and states what it promises. Everything
//! else (light space, march, ray caster, queries, tables) is shared. Adding a method touches its own files and
//! [`METHODS`].

mod deep;
mod deep_count;
mod layers;
mod light_space;
mod parts;
mod plain;
pub mod spec;

pub use deep::{Counters, DeepShadowMap, Filter, Precompress};
pub use deep_count::{NodeMap, node_map};
pub use layers::{
    Beyond, BoundingOpacityMap, BoundingSplit, DeepOpacityMap, Measure, OpacityShadowMap, Slicing,
    SplitChoice,
};
pub use light_space::{LightSpace, LightUniform, Projection, TILE};
pub(crate) use parts::TilePace;
use parts::TileParts;
pub use plain::{NoShadows, ShadowRays};

use crate::error::{Error, Result};
use crate::gpu::Span;
use crate::render::{DeviceTransfer, Optional, Renderer};
use crate::scene::Light;
use crate::volume::Volume;
use spec::Setting;

/// What a method promises on light rays through texel centres, at every depth `z`:
/// `T_exact(z + depth_mm) - transmittance <= T_method(z) <= T_exact(z - depth_mm) + transmittance`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    pub transmittance: f64,
    pub depth_mm: f64,
}

/// Modules and definitions that offer `umbravox::method::transmittance`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lookup {
    pub modules: &'static [&'static str],
    pub defs: Vec<&'static str>,
    /// A lookup marches a whole ray: pictures are then made in several dispatches.
    pub marches: bool,
}

/// What a method's build needs.
pub struct BuildContext<'a> {
    pub renderer: &'a Renderer,
    pub volume: &'a Volume,
    pub transfer: &'a DeviceTransfer,
    pub light: Light,
}

impl BuildContext<'_> {
    /// Whether each tile of the map is built: those with active bricks, or all where that is forced.
    fn built_tiles(&self, light_space: &LightSpace) -> Vec<bool> {
        let mut tiles = light_space.occupied_tiles(self.volume, &self.transfer.active);
        if self.transfer.forced.has(Optional::Tiles) {
            tiles.fill(true);
        }
        tiles
    }

    /// Definitions of a pipeline with `common/march.wgsl`, whose table is made now where it has not been.
    fn march_defs(&self) -> Result<Option<&'static str>> {
        self.renderer.march_table(self.transfer)?;
        Ok(self.transfer.march_defs())
    }
}

/// A pass of a published method that nothing would have read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassLeftOut {
    pub what: &'static str,
    pub why: &'static str,
    /// Its name for `--force`, where it can be forced.
    pub optional: Option<Optional>,
}

/// What building cost and made.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BuildReport {
    /// Host milliseconds before the device's work (fitting, tiles), and the device's own.
    pub host_ms: f64,
    pub device: Option<Span>,
    /// Bytes of the structure that lookups read.
    pub bytes: u64,
    /// Nodes stored, the most in one texel, and the texels whose ray meets extinction.
    pub nodes_total: Option<u64>,
    pub nodes_max: Option<u64>,
    pub texels_hit: Option<u64>,
    /// Tiles of the map, and those left out since no active brick lies under them.
    pub tiles: u32,
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
    pub(crate) bind_group: wgpu::BindGroup,
    /// How it is looked up; `None`: everything is lit.
    pub lookup: Option<Lookup>,
    pub light_space: LightSpace,
    pub report: BuildReport,
    pub bound: Option<Bound>,
}

/// A shadow method with its parameters.
pub trait Method: std::fmt::Debug + Send + Sync {
    /// Name on the command line and in tables.
    fn name(&self) -> &'static str;
    /// Its own parameters as `key=value` separated by spaces, for tables.
    fn params(&self) -> String;
    /// Texels a side, where it has a map.
    fn map_size(&self) -> Option<u32>;
    /// Sub-texel rays whose mean a texel stands for.
    fn taps(&self) -> u32 {
        1
    }
    /// Makes what lookups read.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold.
    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap>;
}

/// A parameter as the command line and `--help` know it.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    pub name: &'static str,
    pub values: &'static str,
    pub default: &'static str,
    pub help: &'static str,
}

/// A method as the registry knows it.
pub struct Entry {
    pub name: &'static str,
    /// One line for `--help` and the window.
    pub summary: &'static str,
    pub keys: &'static [Key],
    /// Parses one setting (each key with one value).
    pub parse: fn(&Setting) -> Result<Box<dyn Method>>,
}

/// Every method, in the order of tables and menus.
pub const METHODS: &[&Entry] =
    &[&plain::NONE, &plain::RAYS, &deep::ENTRY, &layers::OSM, &layers::DOM, &layers::BOM];

/// Parses `METHOD[:key=value,...]`.
///
/// # Errors
/// An unknown method or key, or a value out of range, naming it and what there is.
pub fn parse(text: &str) -> Result<Box<dyn Method>> {
    let mut methods = parse_list(text)?;
    match (methods.pop(), methods.is_empty()) {
        (Some(only), true) => Ok(only),
        _ => Err(Error::input("bad shadow method", text, "one method with one value a key is meant here")),
    }
}

/// Parses a list of methods (`;` apart), a row for every combination of values.
///
/// # Errors
/// As [`parse`].
pub fn parse_list(text: &str) -> Result<Vec<Box<dyn Method>>> {
    let mut methods = Vec::new();
    for spec in spec::parse_list(text)? {
        for setting in spec.expand()? {
            methods.push(from_setting(&setting)?);
        }
    }
    Ok(methods)
}

fn from_setting(setting: &Setting) -> Result<Box<dyn Method>> {
    let entry = METHODS.iter().find(|m| m.name == setting.name).ok_or_else(|| {
        let names = METHODS.iter().map(|m| m.name).collect::<Vec<_>>().join(", ");
        Error::input("unknown shadow method", format!("`{}`", setting.name), format!("there is: {names}"))
    })?;
    for (key, _) in &setting.params {
        if !entry.keys.iter().any(|k| k.name == key) {
            let keys = entry.keys.iter().map(|k| k.name).collect::<Vec<_>>().join(", ");
            let why =
                if keys.is_empty() { "the method has no keys".into() } else { format!("there is: {keys}") };
            return Err(Error::input("unknown key", format!("{}:{key}", setting.name), why));
        }
    }
    (entry.parse)(setting)
}
