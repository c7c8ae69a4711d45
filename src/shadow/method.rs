//! What a shadow method is to everything else: its line of the registry, what it builds, and what it promises.

use super::settings::{self, Key, Lookups, MAP, MARCH, Value};
use super::spec::Setting;
use super::style::Style;
use crate::error::{Error, Result};
use crate::field::{BuildContext, LightSpace, Optimization, TILE_TEXELS, marches_cells};
use crate::gpu::{Group, ShaderVariant, Span};

/// A method as all others know it.
pub struct Entry {
    /// Its name on the command line and in tables.
    pub name: &'static str,
    /// One line for `--help` and the window.
    pub summary: &'static str,
    /// What can be set.
    pub keys: &'static [Key],
    /// Its settings from values of the keys, in their order; `None` where they do not fit.
    pub make: fn(&[Value]) -> Option<Box<dyn Method>>,
    /// Its rows in the default comparison, as on the command line; empty for none.
    pub compared: &'static str,
    /// Its curves in a default `probe --curve`; empty for none.
    pub curve: &'static str,
    /// How it is put to the stability cases.
    pub stability: &'static str,
    /// How it looks in every figure.
    pub style: Style,
    /// What a search within a budget may set, as on the command line: the values that are tried of each key, the default
    /// among them, numbers in the order in which they cost no less memory. Empty where there is nothing to tune.
    pub tuned: &'static str,
}

impl Entry {
    /// With settings as written (each key with one value).
    ///
    /// # Errors
    /// An unknown key, or a value out of range, naming it and what there is.
    pub fn with(&self, setting: &Setting) -> Result<Box<dyn Method>> {
        let values = settings::read(self.name, self.keys, setting)?;
        (self.make)(&values)
            .ok_or_else(|| Error::runtime("cannot set", self.name, "values do not fit the keys"))
    }
}

/// What a method promises on light rays through texel centres, at every depth `z`:
/// `T_exact(z + depth_mm) - transmittance <= T_method(z) <= T_exact(z - depth_mm) + transmittance`.
///
/// `T_exact` is of a ray that strays no more than `lateral_mm` from the texel's, through values that differ no more than
/// `value` from the volume's: float32 knows neither better, and a ray that grazes a surface may miss it altogether for
/// less (`docs/bound.md`).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bound {
    /// Error in transmittance.
    pub transmittance: f64,
    /// Error in depth, mm.
    pub depth_mm: f64,
    /// How far the ray may stray sideways, mm.
    pub lateral_mm: f64,
    /// How far values along it may stray, in the volume's values.
    pub value: f64,
    /// Distance from a point light up to which nothing is promised, mm: float32 does not know the texel there.
    pub from_light_mm: f64,
}

impl Bound {
    /// What the structures of several lights all promise: the loosest of each; `None` where one promises nothing.
    pub fn of_all<'a>(maps: impl IntoIterator<Item = &'a ShadowMap>) -> Option<Self> {
        let looser = |a: Self, b: Self| Self {
            transmittance: a.transmittance.max(b.transmittance),
            depth_mm: a.depth_mm.max(b.depth_mm),
            lateral_mm: a.lateral_mm.max(b.lateral_mm),
            value: a.value.max(b.value),
            from_light_mm: a.from_light_mm.max(b.from_light_mm),
        };
        let bounds = maps.into_iter().map(|map| map.bound).collect::<Option<Vec<_>>>()?;
        bounds.into_iter().reduce(looser)
    }
}

/// Modules, definitions and constants that offer `umbravox::method::transmittance`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lookup(ShaderVariant);

impl Lookup {
    /// Of what [`field_shader`](crate::field::field_shader) begins; its entry does not matter.
    pub fn new(shader: ShaderVariant) -> Self {
        Self(shader)
    }

    /// With a lookup for each eye sample, or shared ones.
    #[must_use]
    pub fn asked_by(self, samples: Lookups) -> Self {
        Self(self.0.defs((samples == Lookups::Each).then_some("LOOKUP_EACH")))
    }

    /// The variant of a file with an entry point that looks light up.
    pub fn within(&self, entry: &'static str) -> ShaderVariant {
        ShaderVariant { entry, ..self.0.clone() }
    }

    /// A lookup marches a whole ray: pictures are then made in several dispatches.
    pub fn marches(&self) -> bool {
        marches_cells(&self.0)
    }
}

/// A pass of a published method that nothing would have read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassLeftOut {
    /// The pass.
    pub what: &'static str,
    /// Why nothing would have read it.
    pub why: &'static str,
    /// Its name for `--no-skip`, where it can be forced.
    pub optional: Option<Optimization>,
}

/// The ratio that was chosen for how a whole map's layers share their depth, and what they are then like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplitChoice {
    /// From linear (0) to logarithmic (1).
    pub ratio: f64,
    /// Mean correlation of neighbouring layers; 1 where they are the same.
    pub correlation: f64,
}

/// What building cost and made.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BuildReport {
    /// Host milliseconds from asking for the structure to having it, without those that the device's passes took. The
    /// renderer fills it in, for all methods alike.
    pub host_ms: f64,
    /// The device's passes, repetitions and choices among them; `None` where there are none.
    pub device: Option<Span>,
    /// Bytes that are allocated for what lookups read.
    pub bytes: u64,
    /// Bytes of these that a lookup can reach.
    pub bytes_used: u64,
    /// Something was allocated by guess: the next build knows better, and `bytes` will differ.
    pub guessed: bool,
    /// Nodes stored.
    pub nodes_total: Option<u64>,
    /// The most nodes in one texel.
    pub nodes_max: Option<u64>,
    /// Texels whose ray meets extinction.
    pub texels_hit: Option<u64>,
    /// Texels whose nodes may be more than the fewest, since the device kept too few corners of their tunnel.
    pub texels_narrowed: Option<u64>,
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
    /// Texels of the tiles that were built.
    pub fn texels_built(&self) -> u64 {
        u64::from((self.tiles - self.tiles_left_out) * TILE_TEXELS)
    }

    /// Fills in the host's part of a build that took so many milliseconds.
    pub fn set_host_ms(&mut self, all_ms: f64) {
        self.host_ms = (all_ms - self.device.map_or(0.0, |s| s.wall_ms)).max(0.0);
    }

    /// Of the structures of several lights, in their order: sums, and the most of what is a most. A choice of split is each
    /// map's own.
    pub fn of_all<'a>(maps: impl IntoIterator<Item = &'a ShadowMap>) -> Self {
        maps.into_iter().map(|map| map.report).reduce(Self::plus).unwrap_or_default()
    }

    fn plus(self, other: Self) -> Self {
        let device = match (self.device, other.device) {
            (Some(a), Some(b)) => Some(a.plus(b)),
            (a, b) => a.or(b),
        };
        let sum = |a: Option<u64>, b: Option<u64>| a.zip(b).map_or(a.or(b), |(a, b)| Some(a + b));
        Self {
            host_ms: self.host_ms + other.host_ms,
            device,
            bytes: self.bytes + other.bytes,
            bytes_used: self.bytes_used + other.bytes_used,
            guessed: self.guessed || other.guessed,
            nodes_total: sum(self.nodes_total, other.nodes_total),
            nodes_max: self.nodes_max.max(other.nodes_max),
            texels_hit: sum(self.texels_hit, other.texels_hit),
            texels_narrowed: sum(self.texels_narrowed, other.texels_narrowed),
            tiles: self.tiles + other.tiles,
            tiles_left_out: self.tiles_left_out + other.tiles_left_out,
            bytes_left_out: self.bytes_left_out + other.bytes_left_out,
            pool_growths: self.pool_growths + other.pool_growths,
            passes_left_out: self.passes_left_out,
            split_choice: None,
        }
    }

    /// Host plus device milliseconds, by the better clock.
    pub fn build_ms(&self) -> f64 {
        self.host_ms + self.device.map_or(0.0, |s| s.best().0)
    }
}

/// What transmittance does along a light ray by a method's own definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Curve {
    /// It falls with depth, and stays within 0 and 1.
    #[default]
    Falls,
    /// It stays within 0 and 1, but may rise.
    Stays,
    /// It may rise and exceed 1, as a series does that rings.
    Rings,
}

/// Rays whose mean transmittance a map is to give at the centre of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taps {
    /// 1, 5 or 9 spread over the texel, as `tap_offset` of `shaders/shadow/dsm/build.wgsl` has them.
    Within(u32),
    /// The centres of a square of so many texels a side around it.
    Texels(u32),
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
    /// Rays whose mean a lookup at a texel's centre stands for.
    fn taps(&self) -> Taps {
        Taps::Within(1)
    }
    /// What transmittance does along a light ray.
    fn curve(&self) -> Curve {
        Curve::Falls
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

    /// The same map marched cell by cell, where it is marched by regular samples.
    fn by_cells(&self) -> Option<Box<dyn Method>> {
        let (keys, mut values) = (self.entry().keys, self.values());
        let march = keys.iter().position(|key| key.name == MARCH)?;
        if values[march] != Value::Choice("samples") || !settings::applies(keys, &values, &keys[march]) {
            return None;
        }
        values[march] = Value::Choice("cells");
        (self.entry().make)(&values)
    }

    /// Whether it has a map, of texels that light rays go through.
    fn has_map(&self) -> bool {
        self.entry().keys.iter().any(|key| key.name == MAP)
    }

    /// Texels a side, where it has a map and a setting says so; else the scene does ([`LightSpace::map_size`]).
    fn map_size(&self) -> Option<u32> {
        let mut settings = self.entry().keys.iter().zip(self.values());
        settings.find_map(|(key, value)| match value {
            Value::Whole(side) if key.name == MAP => Some(side),
            _ => None,
        })
    }
}
