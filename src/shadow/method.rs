//! Interface of shadow methods: registry entry, settings, transmittance query, built shadow map, cost and error
//! bound.

use super::bound::Bound;
use super::filter::Taps;
use super::keys::{ESTIMATOR, FROM, MAP, MARCH, NEAR, SEED};
use super::lookup::Lookup;
use super::published::Published;
use super::sections::Sections;
use super::settings::{Key, Value, When, applies};
use super::style::Style;
use crate::error::{Error, Result};
use crate::field::{BuildContext, LightSpace, NodePool, NodePools, Optimization, TILE_TEXELS};
use crate::gpu::{Group, ShaderVariant, Span};
use crate::scene::Extent;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// Registry entry of a shadow method: name, settings, constructor, and the settings with which tables and tests use
/// it by default.
pub struct Entry {
    /// Name of the shadow method on the command line and in tables.
    pub name: &'static str,
    /// Description of the shadow method in one line, for `--help` and the window.
    pub summary: &'static str,
    /// Descriptions of all settings of the shadow method: names, allowed values, defaults and help.
    pub keys: &'static [Key],
    /// Creates the shadow method from values of its settings, in the order of `keys`; returns `None` if a value does
    /// not fit its setting.
    pub make: fn(&[Value]) -> Option<Box<dyn Method>>,
    /// Settings with which this shadow method appears in the default comparison table of shadow methods, in
    /// command-line syntax; empty for none.
    pub compared: &'static str,
    /// Settings with which `umbravox probe --curve` plots this shadow method's transmittance by default, in
    /// command-line syntax; empty for none.
    pub curve: &'static str,
    /// Settings with which `umbravox stability` tests this shadow method by default, in command-line syntax.
    pub stability: &'static str,
    /// Settings of the method's own paper, if that was read: a row of the default comparison table is named after it.
    pub published: Option<Published>,
    /// Colour and marker of the shadow method in every figure.
    pub style: Style,
}

/// Specification of a shadow method: its registry entry and a value for each of its settings.
#[derive(Clone)]
pub struct MethodSpec {
    pub(super) entry: &'static Entry,
    pub(super) values: Vec<Value>,
}

impl MethodSpec {
    /// Creates the specification of a shadow method from values in the order of the entry's settings.
    pub fn new(entry: &'static Entry, values: Vec<Value>) -> Self {
        Self { entry, values }
    }

    /// Creates the specification of a shadow method with its default settings.
    pub fn default_of(entry: &'static Entry) -> Self {
        Self::new(entry, entry.keys.iter().filter_map(|key| key.parse(key.default)).collect())
    }

    /// Returns the registry entry of the specified shadow method.
    pub fn entry(&self) -> &'static Entry {
        self.entry
    }

    /// Returns the values of the shadow method's settings, in the order of the entry's keys.
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    /// Returns each setting of the shadow method with its value.
    pub fn settings(&self) -> impl Iterator<Item = (&'static Key, Value)> {
        self.entry.keys.iter().zip(self.values.iter().copied())
    }

    /// Returns the value of the setting with the given name; `None` if the shadow method has no such setting.
    pub fn value(&self, key: &str) -> Option<Value> {
        self.settings().find(|(k, _)| k.name == key).map(|(_, value)| value)
    }

    /// Sets one setting of the shadow method; returns `None` if it has no such setting or does not allow the value.
    #[must_use]
    pub fn with(mut self, key: &str, value: &str) -> Option<Self> {
        let at = self.entry.keys.iter().position(|k| k.name == key)?;
        self.values[at] = self.entry.keys[at].parse(value)?;
        Some(self)
    }

    /// Whether the given setting of the shadow method has the value `word`, and no other setting disables it.
    pub fn is_set(&self, key: &str, word: &'static str) -> bool {
        self.settings().any(|(k, value)| k.name == key && value == Value::Choice(word) && self.applies(k))
    }

    /// Returns the settings with bounds on the exact transmittance (`enclose=on`).
    ///
    /// # Errors
    /// The method stores no such bounds.
    pub fn enclosing(self) -> Result<Self> {
        let name = self.entry.name;
        let enclosing = self.with("enclose", "on").filter(|spec| !spec.is_set("from", "lines"));
        let why = "only dsm with from=voxels stores bounds on the exact transmittance";
        enclosing.ok_or_else(|| Error::input("cannot certify", name, why))
    }

    /// Returns the number of shadow map texels per side if a setting fixes it; `None` if it is chosen from the scene.
    pub fn map_size(&self) -> Option<u32> {
        if let Some(Value::Whole(side)) = self.value(MAP) { Some(side) } else { None }
    }

    /// Creates the shadow method from this specification.
    ///
    /// # Errors
    /// The values do not fit the settings of the method.
    pub fn method(&self) -> Result<Box<dyn Method>> {
        (self.entry.make)(&self.values)
            .ok_or_else(|| Error::runtime("cannot set", self.entry.name, "values do not fit the keys"))
    }

    /// Returns the settings of the shadow method as `key=value` separated by spaces, for tables. It shows settings
    /// marked for labels and those that differ from their defaults. The map size is omitted, since it has its own
    /// column.
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

/// Formats a shadow method as `METHOD[:key=value,...]`; the alternate form `{:#}` omits all settings at their
/// defaults.
impl fmt::Display for MethodSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.entry.name)?;
        let mut separator = ':';
        for (key, value) in self.settings() {
            // A setting without effect (`When::Is`) would be refused when the text is parsed again.
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

/// Equality of shadow method specifications is total (`Eq`): no setting can be NaN, since every number has a range.
impl Eq for MethodSpec {}

impl Hash for MethodSpec {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.entry.name.hash(state);
        self.values.iter().for_each(|value| value.to_string().hash(state));
    }
}

/// Rendering pass of a published shadow method that this implementation skips, since nothing would read its result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassLeftOut {
    /// Name of the skipped rendering pass of a published shadow method.
    pub what: &'static str,
    /// Reason why a rendering pass of a published shadow method was skipped.
    pub why: &'static str,
    /// Name under which `--no-skip` runs the rendering pass after all; `None` if the pass must stay skipped.
    pub optional: Option<Optimization>,
}

/// Result of a search for the best ratio of linear to logarithmic layers of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplitChoice {
    /// Ratio that was chosen for the layers of a shadow map, from linear (0) to logarithmic (1) spacing.
    pub ratio: f64,
    /// Mean correlation of neighbouring layers of a shadow map at the chosen ratio of linear to logarithmic layers; 1
    /// for equal layers.
    pub correlation: f64,
}

/// Cost and size of a built shadow map.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BuildReport {
    /// Time that the host spent on the shadow map build, without its GPU passes, ms; the renderer sets it.
    pub host_ms: f64,
    /// Time of all GPU passes of the shadow map build, including repetitions and searches; `None` without passes.
    pub device: Option<Span>,
    /// Memory allocated for the shadow map that transmittance queries read, bytes.
    pub bytes: u64,
    /// Part of the shadow map's memory that transmittance queries can read, bytes.
    pub bytes_used: u64,
    /// Whether the maps of all lights share the memory, so that it counts once.
    pub is_shared: bool,
    /// Number of samples of a light with a size that the shadow map answers for, beside the first: all, or none.
    pub more_samples: usize,
    /// Memory of the enclosing curves (`enclose=on`), which pictures do not read, bytes.
    pub enclosure_bytes: u64,
    /// Memory that only the build needs, bytes. A window keeps it for later builds.
    pub build_bytes: u64,
    /// Number of curve nodes stored in the whole shadow map.
    pub nodes_total: Option<u64>,
    /// Largest number of curve nodes in one texel of the shadow map.
    pub nodes_max: Option<u64>,
    /// Number of shadow map texels whose light ray meets extinction.
    pub texels_hit: Option<u64>,
    /// Number of shadow map texels whose curve was too complex for the fixed buffers of `compress=optimal`, so that
    /// it may have more nodes than necessary.
    pub texels_narrowed: Option<u64>,
    /// Number of tiles of the shadow map.
    pub tiles: u32,
    /// Number of shadow map tiles that are skipped, since they cover no part of the volume with extinction.
    pub tiles_left_out: u32,
    /// Memory saved by skipped shadow map tiles, in the map or during its build, bytes.
    pub bytes_left_out: u64,
    /// Number of times that the shadow map build was repeated because the texture for curve nodes was too small.
    pub pool_growths: u32,
    /// Passes of the published shadow method that the build skipped.
    pub passes_left_out: &'static [PassLeftOut],
    /// Result of the search for a ratio of linear to logarithmic layers; `None` if the shadow map needed no search.
    pub split_choice: Option<SplitChoice>,
}

impl BuildReport {
    /// Returns the number of texels in the shadow map tiles that were built.
    pub fn texels_built(&self) -> u64 {
        u64::from((self.tiles - self.tiles_left_out) * TILE_TEXELS)
    }

    /// Sets the host time of a shadow map build from its total time `all_ms`, by subtracting the time of GPU passes.
    pub fn set_host_ms(&mut self, all_ms: f64) {
        self.host_ms = (all_ms - self.device.map_or(0.0, |s| s.wall_ms)).max(0.0);
    }

    /// Returns the total cost and size of the shadow maps of several lights. `nodes_max` and memory that all maps share
    /// are the maximum instead of the sum.
    pub fn of_all<'a>(maps: impl IntoIterator<Item = &'a ShadowMap>) -> Self {
        maps.into_iter().map(|map| map.report).reduce(Self::plus).unwrap_or_default()
    }

    fn plus(self, other: Self) -> Self {
        let device = match (self.device, other.device) {
            (Some(a), Some(b)) => Some(a.plus(b)),
            (a, b) => a.or(b),
        };
        let sum = |a: Option<u64>, b: Option<u64>| a.zip(b).map_or(a.or(b), |(a, b)| Some(a + b));
        let is_shared = self.is_shared && other.is_shared;
        let memory = |a: u64, b: u64| if is_shared { a.max(b) } else { a + b };
        Self {
            host_ms: self.host_ms + other.host_ms,
            device,
            bytes: memory(self.bytes, other.bytes),
            bytes_used: memory(self.bytes_used, other.bytes_used),
            is_shared,
            more_samples: self.more_samples + other.more_samples,
            enclosure_bytes: self.enclosure_bytes + other.enclosure_bytes,
            // Maps are built one after another.
            build_bytes: self.build_bytes.max(other.build_bytes),
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

    /// Returns the time of the shadow map build, ms: host time plus GPU time, by GPU timestamps if there are any.
    pub fn build_ms(&self) -> f64 {
        self.host_ms + self.device.map_or(0.0, |s| s.best().0)
    }
}

/// Guarantee on the transmittance of a shadow method along a light ray: falling, within 0 and 1, or neither.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Curve {
    /// Transmittance never rises with depth and stays within 0 and 1.
    #[default]
    Falls,
    /// Transmittance stays within 0 and 1, but may rise with depth.
    Stays,
    /// Transmittance may rise with depth and exceed 1, as with a truncated Fourier series.
    Rings,
}

impl Curve {
    /// Returns the guarantee of a method whose map stores falling curves. With `near`, transmittance may rise with
    /// depth: a march from a point takes other samples than one from its neighbour.
    pub(super) fn of_map(spec: &MethodSpec) -> Self {
        let near = spec.value(NEAR).unwrap_or(Value::Number(0.0));
        let marches = near != Value::Number(0.0) && spec.value(FROM) != Some(Value::Choice("lines"));
        if marches { Self::Stays } else { Self::Falls }
    }
}

/// Shadow map (or other shadow data structure) built for one light.
pub struct ShadowMap {
    /// Name of the shadow method that built this shadow map.
    pub method: &'static str,
    /// Resources of the shadow map that shaders bind in group 1.
    pub(crate) group: Group,
    /// Shader code of transmittance queries; `None` if every point is fully lit.
    pub lookup: Option<Lookup>,
    /// Projection of world positions onto the shadow map, as seen from the light.
    pub light_space: LightSpace,
    /// Cost and size of the built shadow map.
    pub report: BuildReport,
    /// Error bound of the shadow map; `None` if the method has none.
    pub bound: Option<Bound>,
    /// Bounds on the exact transmittance at every point; `None` if the method stores none.
    pub enclosure: Option<Enclosure>,
    /// Sections of the volume for which it answers one after the other; `None` if it answers for all points.
    pub(crate) sections: Option<Sections>,
    /// Texture of curve nodes, which later builds do not reuse as long as this map exists; `None` for methods without.
    pub(crate) _pool: Option<Arc<NodePool>>,
}

/// Lower and upper bounds on the exact transmittance at every point, which are queried like shadow maps.
pub struct Enclosure {
    /// Map whose queries return a lower bound on the exact transmittance.
    pub lower: Box<ShadowMap>,
    /// Map whose queries return an upper bound on the exact transmittance.
    pub upper: Box<ShadowMap>,
    /// Tolerances within which these bounds hold.
    pub tolerances: Bound,
}

impl Enclosure {
    pub(super) fn new(lower: ShadowMap, upper: ShadowMap, tolerances: Bound) -> Self {
        Self { lower: Box::new(lower), upper: Box::new(upper), tolerances }
    }
}

/// Interface of a shadow method with given values of its settings.
pub trait Method: std::fmt::Debug + Send + Sync {
    /// Returns the registry entry of the shadow method.
    fn entry(&self) -> &'static Entry;
    /// Returns the values of the shadow method's settings, in the order of the entry's keys.
    fn values(&self) -> Vec<Value>;
    /// Returns the shader code of transmittance queries; `None` if every point is fully lit.
    fn lookup(&self) -> Option<Lookup>;
    /// Returns the shader passes that [`Self::build`] may run, for tests of shaders.
    fn passes(&self) -> Vec<ShaderVariant> {
        Vec::new()
    }
    /// Returns the light rays whose mean transmittance is the result of a query at the centre of a shadow map texel.
    fn taps(&self) -> Taps {
        Taps::Within(1)
    }
    /// Returns the guarantee on the method's transmittance along a light ray: falling, within 0 and 1, or neither.
    fn curve(&self) -> Curve {
        Curve::of_map(&self.spec())
    }
    /// Whether another program can build the map again under another directional light
    /// ([`BuildRecorder`](crate::field::BuildRecorder)). The passes then depend on the light only through the projection
    /// (binding 0 of bind group 1) and through lengths that follow from its depth range. The host reads nothing between them.
    fn builds_on_device(&self) -> bool {
        false
    }
    /// Whether one map answers for a whole light of this size, and not for one of its samples.
    fn covers(&self, _size: &Extent) -> bool {
        false
    }
    /// Builds the shadow map of a light.
    ///
    /// # Errors
    /// A shadow map that is too large for the graphics adapter.
    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap>;
    /// Completes the report of a shadow map whose passes were deferred ([`DeferredPasses`]), from the words that the
    /// last of them read. Returns `false` if the map is incomplete: it must not be used, and is built again.
    ///
    /// # Errors
    /// The device could not build the map.
    ///
    /// [`DeferredPasses`]: crate::field::DeferredPasses
    fn complete(&self, report: &mut BuildReport, words: &[u32], _pools: &NodePools) -> Result<bool> {
        report.texels_hit = words.first().map(|n| u64::from(*n));
        Ok(true)
    }

    /// Returns the name of the shadow method on the command line and in tables.
    fn name(&self) -> &'static str {
        self.entry().name
    }

    /// Returns the specification of the shadow method: its registry entry and the values of its settings.
    fn spec(&self) -> MethodSpec {
        MethodSpec::new(self.entry(), self.values())
    }

    /// Returns the settings of the shadow method as a short text for tables ([`MethodSpec::label`]).
    fn params(&self) -> String {
        self.spec().label()
    }

    /// Returns a variant of the shadow method that marches light rays cell by cell; `None` unless this one marches by
    /// regular samples.
    fn by_cells(&self) -> Option<Box<dyn Method>> {
        let spec = self.spec();
        let is_sampled = spec.is_set(MARCH, "samples");
        is_sampled.then(|| spec.with(MARCH, "cells")?.method().ok()).flatten()
    }

    /// Returns the shadow method with its seed increased by `by`; `None` unless its results are random.
    fn reseeded(&self, by: u32) -> Option<Box<dyn Method>> {
        let spec = self.spec();
        let is_random = spec.value(ESTIMATOR).is_some_and(|estimator| estimator != Value::Choice("off"));
        let Some(Value::Whole(seed)) = spec.value(SEED).filter(|_| is_random) else { return None };
        spec.with(SEED, &seed.wrapping_add(by).to_string())?.method().ok()
    }

    /// Whether the shadow method stores a map of texels, as seen from the light.
    fn has_map(&self) -> bool {
        self.entry().keys.iter().any(|key| key.name == MAP)
    }

    /// Returns the number of shadow map texels per side ([`MethodSpec::map_size`]); `None` if it is chosen from the
    /// scene ([`LightSpace::map_size`]).
    fn map_size(&self) -> Option<u32> {
        self.spec().map_size()
    }
}
