//! Interface of shadow methods: registry entry, settings, lookup, built structure, cost and error bound.

use super::keys::{Lookups, MAP, MARCH};
use super::settings::{Key, Value, When, applies};
use super::style::Style;
use crate::error::{Error, Result};
use crate::field::{BuildContext, LightSpace, Optimization, TILE_TEXELS, marches_cells};
use crate::gpu::{Group, ShaderVariant, Span};
use std::fmt;
use std::hash::{Hash, Hasher};

/// Registry entry of a method.
pub struct Entry {
    /// Name on the command line and in tables.
    pub name: &'static str,
    /// One line for `--help` and the window.
    pub summary: &'static str,
    /// Keys of the settings.
    pub keys: &'static [Key],
    /// Creates the method from values of the keys, in their order; `None` where they do not fit.
    pub make: fn(&[Value]) -> Option<Box<dyn Method>>,
    /// Rows in the default comparison, as on the command line; empty for none.
    pub compared: &'static str,
    /// Curves in a default `probe --curve`; empty for none.
    pub curve: &'static str,
    /// Rows in the stability cases.
    pub stability: &'static str,
    /// Colour and marker in every figure.
    pub style: Style,
}

/// A shadow method with a value for each of its keys.
#[derive(Clone)]
pub struct MethodSpec {
    pub(super) entry: &'static Entry,
    pub(super) values: Vec<Value>,
}

impl MethodSpec {
    /// Specification from values of the entry's keys, in their order.
    pub fn new(entry: &'static Entry, values: Vec<Value>) -> Self {
        Self { entry, values }
    }

    /// The method with its default settings.
    pub fn default_of(entry: &'static Entry) -> Self {
        Self::new(entry, entry.keys.iter().filter_map(|key| key.parse(key.default)).collect())
    }

    /// Entry of the method in the registry.
    pub fn entry(&self) -> &'static Entry {
        self.entry
    }

    /// Values of the entry's keys, in their order.
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    /// Keys with their values.
    pub fn settings(&self) -> impl Iterator<Item = (&'static Key, Value)> {
        self.entry.keys.iter().zip(self.values.iter().copied())
    }

    /// Value of a key, where the method has it.
    pub fn value(&self, key: &str) -> Option<Value> {
        self.settings().find(|(k, _)| k.name == key).map(|(_, value)| value)
    }

    /// Sets the value of a key; `None` where the method has no such key or value.
    #[must_use]
    pub fn with(mut self, key: &str, value: &str) -> Option<Self> {
        let at = self.entry.keys.iter().position(|k| k.name == key)?;
        self.values[at] = self.entry.keys[at].parse(value)?;
        Some(self)
    }

    /// Whether a key has this word as its value, and an effect.
    pub fn is_set(&self, key: &str, word: &'static str) -> bool {
        self.settings().any(|(k, value)| k.name == key && value == Value::Choice(word) && self.applies(k))
    }

    /// Texels a side of the map, where a setting says so; the scene decides otherwise.
    pub fn map_size(&self) -> Option<u32> {
        if let Some(Value::Whole(side)) = self.value(MAP) { Some(side) } else { None }
    }

    /// The method itself.
    ///
    /// # Errors
    /// Values that do not fit the keys.
    pub fn method(&self) -> Result<Box<dyn Method>> {
        (self.entry.make)(&self.values)
            .ok_or_else(|| Error::runtime("cannot set", self.entry.name, "values do not fit the keys"))
    }

    /// Settings as `key=value` separated by spaces, for tables: those that are always shown, and those that differ from the
    /// defaults; without the size of the map, which has a column of its own.
    pub fn label(&self) -> String {
        let shown = |key: &Key, value| {
            key.name != MAP && self.applies(key) && (key.in_label || Some(value) != key.parse(key.default))
        };
        let settings = self.settings().filter(|(key, value)| shown(key, *value));
        settings.map(|(key, value)| format!("{}={value}", key.name)).collect::<Vec<_>>().join(" ")
    }

    pub(super) fn applies(&self, key: &Key) -> bool {
        applies(self.entry.keys, &self.values, key)
    }
}

/// `METHOD[:key=value,...]`; the alternate form `{:#}` has no defaults.
impl fmt::Display for MethodSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.entry.name)?;
        let mut separator = ':';
        for (key, value) in self.settings() {
            // A key of another setting would be refused when read back.
            let readable = self.applies(key) || !matches!(key.when, When::Is(..));
            let is_labelled = !f.alternate() && key.in_label && self.applies(key);
            if readable && (is_labelled || Some(value) != key.parse(key.default)) {
                write!(f, "{separator}{}={value}", key.name)?;
                separator = ',';
            }
        }
        Ok(())
    }
}

impl fmt::Debug for MethodSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl PartialEq for MethodSpec {
    fn eq(&self, other: &Self) -> bool {
        self.entry.name == other.entry.name && self.values == other.values
    }
}

/// No value is NaN: every key has a range.
impl Eq for MethodSpec {}

impl Hash for MethodSpec {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.entry.name.hash(state);
        self.values.iter().for_each(|value| value.to_string().hash(state));
    }
}

/// Error bound of a method on light rays through texel centres, at every depth `z`:
/// `T_exact(z + depth_mm) - transmittance <= T_method(z) <= T_exact(z - depth_mm) + transmittance`.
///
/// `T_exact` belongs to a ray within `lateral_mm` of the texel's, through values within `value` of the volume's. These are
/// the limits of float32: a ray that grazes a surface may miss it for less (`docs/bound.md`).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bound {
    /// Error in transmittance.
    pub transmittance: f64,
    /// Error in depth, mm.
    pub depth_mm: f64,
    /// Lateral error of the ray, mm.
    pub lateral_mm: f64,
    /// Error of the values along the ray, in the volume's units.
    pub value: f64,
    /// Distance from a point light within which no bound holds, mm: float32 does not resolve texels there.
    pub from_light_mm: f64,
}

impl Bound {
    /// Bound that the structures of several lights all satisfy; `None` where one has no bound.
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

/// Shader modules, definitions and constants that provide `umbravox::method::transmittance`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lookup(ShaderVariant);

impl Lookup {
    /// Lookup from the modules of a [`field_shader`](crate::field::field_shader), whose entry point is ignored.
    pub fn new(shader: ShaderVariant) -> Self {
        Self(shader)
    }

    /// Sets whether eye samples share lookups.
    #[must_use]
    pub fn with_lookup_mode(self, samples: Lookups) -> Self {
        Self(self.0.defs((samples == Lookups::Each).then_some("LOOKUP_EACH")))
    }

    /// Shader variant of an entry point that uses the lookup.
    pub fn within(&self, entry: &'static str) -> ShaderVariant {
        ShaderVariant { entry, ..self.0.clone() }
    }

    /// Whether a lookup marches a whole ray; pictures are then drawn in several dispatches.
    pub fn marches(&self) -> bool {
        marches_cells(&self.0)
    }
}

/// A pass of a published method that was skipped, since nothing would read its result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassLeftOut {
    /// Name of the pass.
    pub what: &'static str,
    /// Reason.
    pub why: &'static str,
    /// Name for `--no-skip`, if it can be disabled.
    pub optional: Option<Optimization>,
}

/// Ratio chosen for the split of a map's layers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplitChoice {
    /// Blend from linear (0) to logarithmic (1) division.
    pub ratio: f64,
    /// Mean correlation of neighbouring layers; 1 for equal layers.
    pub correlation: f64,
}

/// Cost and size of a built structure.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BuildReport {
    /// Host milliseconds of the build without the device's passes; the renderer fills it in.
    pub host_ms: f64,
    /// Time of the device's passes, repetitions and choices included; `None` without passes.
    pub device: Option<Span>,
    /// Bytes allocated for lookups.
    pub bytes: u64,
    /// Bytes that a lookup can reach.
    pub bytes_used: u64,
    /// Whether a size was guessed, so that `bytes` of the next build will differ.
    pub guessed: bool,
    /// Number of stored nodes.
    pub nodes_total: Option<u64>,
    /// Largest number of nodes in a texel.
    pub nodes_max: Option<u64>,
    /// Texels whose ray meets extinction.
    pub texels_hit: Option<u64>,
    /// Texels whose tunnel had too many corners, so that their nodes may not be the fewest.
    pub texels_narrowed: Option<u64>,
    /// Tiles of the map.
    pub tiles: u32,
    /// Tiles skipped since they cover no active brick.
    pub tiles_left_out: u32,
    /// Bytes saved by skipped tiles.
    pub bytes_left_out: u64,
    /// Repetitions of the build since the pool was too small.
    pub pool_growths: u32,
    /// Skipped passes.
    pub passes_left_out: &'static [PassLeftOut],
    /// Ratio chosen for the split of layers, where a search chose one.
    pub split_choice: Option<SplitChoice>,
}

impl BuildReport {
    /// Texels of the built tiles.
    pub fn texels_built(&self) -> u64 {
        u64::from((self.tiles - self.tiles_left_out) * TILE_TEXELS)
    }

    /// Sets the host's share of a build that took `all_ms`.
    pub fn set_host_ms(&mut self, all_ms: f64) {
        self.host_ms = (all_ms - self.device.map_or(0.0, |s| s.wall_ms)).max(0.0);
    }

    /// Sum over the structures of several lights, with the maximum of maxima.
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

    /// Host plus device milliseconds, by the more precise clock.
    pub fn build_ms(&self) -> f64 {
        self.host_ms + self.device.map_or(0.0, |s| s.best().0)
    }
}

/// Shape of a method's transmittance along a light ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Curve {
    /// Non-increasing, within 0 and 1.
    #[default]
    Falls,
    /// Transmittance is within 0 and 1, but may rise with depth.
    Stays,
    /// May rise and exceed 1, as a ringing series does.
    Rings,
}

/// Rays whose mean transmittance a map stores for the centre of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taps {
    /// 1, 5 or 9 rays within the texel (`tap_offset` of `shaders/shadow/dsm/build.wgsl`).
    Within(u32),
    /// Centres of the texels of a square map with a number of texels per side.
    Texels(u32),
}

/// Built shadow structure of one light.
pub struct ShadowMap {
    /// Name of the method.
    pub method: &'static str,
    /// Bind group 1 of lookups.
    pub(crate) group: Group,
    /// Lookup; `None` where everything is lit.
    pub lookup: Option<Lookup>,
    /// Projection of the light.
    pub light_space: LightSpace,
    /// Cost and size.
    pub report: BuildReport,
    /// Error bound, where the method has one.
    pub bound: Option<Bound>,
}

/// A shadow method with its settings.
pub trait Method: std::fmt::Debug + Send + Sync {
    /// Entry of the registry.
    fn entry(&self) -> &'static Entry;
    /// Values of the entry's keys, in their order.
    fn values(&self) -> Vec<Value>;
    /// Lookup into the built structure; `None` where everything is lit.
    fn lookup(&self) -> Option<Lookup>;
    /// Passes that [`Self::build`] may run, for tests of shaders.
    fn passes(&self) -> Vec<ShaderVariant> {
        Vec::new()
    }
    /// Rays whose mean a lookup at a texel's centre returns.
    fn taps(&self) -> Taps {
        Taps::Within(1)
    }
    /// Shape of the transmittance along a light ray.
    fn curve(&self) -> Curve {
        Curve::Falls
    }
    /// Builds the shadow map of a light.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold.
    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap>;

    /// Name on the command line and in tables.
    fn name(&self) -> &'static str {
        self.entry().name
    }

    /// Specification: entry and values.
    fn spec(&self) -> MethodSpec {
        MethodSpec::new(self.entry(), self.values())
    }

    /// Label of the settings ([`MethodSpec::label`]).
    fn params(&self) -> String {
        self.spec().label()
    }

    /// Variant that marches cell by cell, for a map that marches by regular samples.
    fn by_cells(&self) -> Option<Box<dyn Method>> {
        let spec = self.spec();
        let is_sampled = spec.is_set(MARCH, "samples");
        is_sampled.then(|| spec.with(MARCH, "cells")?.method().ok()).flatten()
    }

    /// Whether it has a map of texels.
    fn has_map(&self) -> bool {
        self.entry().keys.iter().any(|key| key.name == MAP)
    }

    /// Texels a side of the map ([`MethodSpec::map_size`]); the scene decides otherwise ([`LightSpace::map_size`]).
    fn map_size(&self) -> Option<u32> {
        self.spec().map_size()
    }
}
