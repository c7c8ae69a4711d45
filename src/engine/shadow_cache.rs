//! Cache of shadow maps that several pictures share.

use crate::error::Result;
use crate::field::{BuildPasses, DeferredPasses, View};
use crate::render::{DeviceTransfer, LoadedVolume, Renderer};
use crate::scene::{LightSource, Scene};
use crate::shadow::{Method, ShadowMap, mapped_lights};
use std::cell::Cell;
use std::ops::Range;

/// Times spent to prepare a picture: transfer-function tables, brick classification and shadow maps. `None` marks a
/// step that was not necessary.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Work {
    /// Time to compute the transfer-function tables, ms.
    pub table_ms: Option<f64>,
    /// Time to classify the volume's bricks (blocks of voxels), ms.
    pub classify_ms: Option<f64>,
    /// Time to build the shadow maps or other shadow data structures, ms.
    pub build_ms: Option<f64>,
    /// Number of shadow maps or other shadow data structures that were built, including empty ones.
    pub built: usize,
}

/// Way in which [`ShadowCache::prepare`] builds missing shadow maps. The default runs all passes at once.
#[derive(Clone, Copy, Default)]
pub struct Building<'a> {
    /// Build passes that wait for the submission of the picture; `None` if passes run at once.
    pub deferred: Option<&'a DeferredPasses>,
    /// Receives, before each build, the number of maps that are built and the number of maps to build.
    pub watch: Option<&'a dyn Fn(usize, usize)>,
    /// Called between submissions of a build; `false` cancels it.
    pub go_on: Option<&'a dyn Fn() -> bool>,
}

/// Region in which a shadow map must be valid: the visible points of a picture, or all points of the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapCoverage {
    /// Requires the shadow map to be valid at all points that are visible in the picture.
    Picture,
    /// Requires the shadow map to be valid at all points of the volume.
    AnyPoint,
}

impl MapCoverage {
    fn view(self, scene: &Scene) -> Option<View> {
        View::of_shadows(scene).filter(|_| self == Self::Picture)
    }
}

/// Margin around the view that a new shadow map also covers, as a fraction of the view's extent. Small camera
/// movements then need no new map.
const VIEW_MARGIN: f64 = 0.1;

/// Rule that decides which cached shadow maps a picture may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReusePolicy {
    /// Allows any cached shadow map that covers the picture. New maps also cover a margin around the view.
    Covering,
    /// Allows only cached shadow maps identical to a newly built one. Each picture is then bit-identical whatever was
    /// rendered before.
    Exact,
}

/// Inputs from which a shadow map is built, apart from scene and method: volume and transfer-function tables on the
/// device.
#[derive(Clone, Copy)]
pub struct MapSource<'a> {
    /// Renderer with the graphics device and its compute pipelines.
    pub renderer: &'a Renderer,
    /// Volume on the graphics device.
    pub loaded: &'a LoadedVolume,
    /// Lookup tables of the transfer function on the graphics device.
    pub transfer: &'a DeviceTransfer,
}

/// Cache key of a shadow method: its name with all settings.
fn method_key(method: &dyn Method) -> String {
    format!("{method:?}")
}

/// Lights of the shadow maps of a picture, without colours.
fn lights_of(method: &dyn Method, scene: &Scene) -> Vec<LightSource> {
    mapped_lights(method, scene).into_iter().map(LightSource::uncolored).collect()
}

/// Shadow methods whose cached shadow maps a picture may use, as cache keys.
struct Acceptable {
    /// Cache key of the shadow method that the user requested.
    requested: String,
    /// Cache key of the shadow method whose map is built: the requested method, or `none` if the scene needs no
    /// shadows.
    effective: String,
    /// Lights for which the maps are built.
    lights: Vec<LightSource>,
    view: Option<View>,
}

impl Acceptable {
    fn new(
        MapSource { renderer, loaded, transfer }: MapSource<'_>,
        method: &dyn Method,
        scene: &Scene,
        view: Option<View>,
    ) -> Self {
        let effective = renderer.effective_method(loaded, transfer, method, scene);
        let lights = lights_of(effective, scene);
        Self { requested: method_key(method), effective: method_key(effective), lights, view }
    }

    fn needs_shadows(&self) -> bool {
        self.requested == self.effective
    }
}

/// Cached shadow map, with the shadow method and the light for which it was built.
struct CachedMap {
    method: String,
    light: LightSource,
    map: ShadowMap,
    /// View for which the coverage of this cached shadow map was tested last (`None`: all points), and the result of
    /// the test. A test on a large volume takes milliseconds.
    tested: Cell<Option<(Option<View>, bool)>>,
    /// Range of the deferred passes that build this shadow map; `None` for a complete map.
    deferred: Option<Range<usize>>,
}

impl CachedMap {
    /// Whether this cached shadow map may be used for a view; `None` means all points of the volume.
    fn covers(&self, source: MapSource<'_>, view: Option<View>, reuse: ReusePolicy) -> bool {
        if let Some((_, covers)) = self.tested.get().filter(|(tested, _)| *tested == view) {
            return covers;
        }
        let (space, volume, active) = (&self.map.light_space, &source.loaded.volume, &source.transfer.active);
        // Without a view, only points are asked.
        let in_view = view.is_none() || self.map.sections.as_ref().is_none_or(|s| s.serves(view.as_ref()));
        let covers = in_view
            && match reuse {
                ReusePolicy::Covering => space.serves(volume, active, self.light.light, view.as_ref()),
                ReusePolicy::Exact => space.is_fitted_to(volume, active, self.light.light, view.as_ref()),
            };
        self.tested.set(Some((view, covers)));
        covers
    }
}

/// Least-recently-used cache of the shadow maps of one volume with one transfer function.
pub struct ShadowCache {
    /// Maximum number of cached shadow maps for each light of the picture, and in total for all other lights.
    capacity: usize,
    reuse: ReusePolicy,
    /// Cached shadow maps, the most recently used one last.
    maps: Vec<CachedMap>,
}

impl ShadowCache {
    /// Cache capacity (shadow maps per light) for interactive use: two methods side by side, each coarse and at full
    /// quality.
    pub const INTERACTIVE: usize = 4;

    /// Creates an empty cache for `capacity` shadow maps per light.
    pub fn new(capacity: usize, reuse: ReusePolicy) -> Self {
        Self { capacity, reuse, maps: Vec::new() }
    }

    /// Removes all shadow maps from the cache.
    pub fn clear(&mut self) {
        self.maps.clear();
    }

    /// Number of shadow maps that [`Self::prepare`] would have to build for a picture of a scene, because the cache
    /// lacks them.
    pub fn missing(&self, source: MapSource<'_>, method: &dyn Method, scene: &Scene) -> usize {
        let acceptable = Acceptable::new(source, method, scene, MapCoverage::Picture.view(scene));
        let is_missing = |light: &&LightSource| self.find(source, &acceptable, light).is_none();
        match acceptable.needs_shadows() {
            true => acceptable.lights.iter().filter(is_missing).count(),
            false => 0,
        }
    }

    fn find(&self, source: MapSource<'_>, acceptable: &Acceptable, light: &LightSource) -> Option<usize> {
        let Acceptable { requested, effective, view, .. } = acceptable;
        self.maps.iter().rposition(|map| {
            let is_substitute = !acceptable.needs_shadows() && map.method == *effective;
            map.light == *light
                && map.deferred.is_none()
                && (is_substitute || (map.method == *requested && map.covers(source, *view, self.reuse)))
        })
    }

    /// Returns the shadow map of each light that is not black, in the order of the lights. Builds the maps that
    /// are not in the cache. With `building.deferred`, passes wait there for the submission of the picture, and
    /// [`Self::complete`] has to follow: otherwise the next call discards these maps.
    ///
    /// # Errors
    /// A shadow map that the graphics adapter cannot hold, or `building.go_on` cancelled a build.
    pub fn prepare(
        &mut self,
        source: MapSource<'_>,
        method: &dyn Method,
        (scene, coverage): (&Scene, MapCoverage),
        work: &mut Work,
        Building { deferred, watch, go_on }: Building<'_>,
    ) -> Result<Vec<&ShadowMap>> {
        self.maps.retain(|map| map.deferred.is_none());
        let acceptable = Acceptable::new(source, method, scene, coverage.view(scene));
        let lights = &acceptable.lights;
        let mut missing: Vec<LightSource> = Vec::new();
        for light in lights {
            match self.find(source, &acceptable, light) {
                Some(place) => {
                    let map = self.maps.remove(place);
                    self.maps.push(map);
                }
                None if missing.contains(light) => {}
                None => missing.push(light.clone()),
            }
        }
        if !acceptable.needs_shadows() {
            // Empty shadow maps of earlier lights must not evict maps that took long to build.
            self.maps.retain(|map| map.method != acceptable.effective || lights.contains(&map.light));
        }
        self.make_room(lights, missing.len());
        let margin = if self.reuse == ReusePolicy::Exact { 0.0 } else { VIEW_MARGIN };
        let view = acceptable.view.map(|view| view.with_margin(margin));
        let MapSource { renderer, loaded, transfer } = source;
        let count = missing.len();
        for (built, light) in missing.into_iter().enumerate() {
            watch.iter().filter(|_| acceptable.needs_shadows()).for_each(|watch| watch(built, count));
            let first = deferred.map_or(0, DeferredPasses::len);
            let field = (loaded, transfer);
            let passes = BuildPasses { deferred, go_on, recorder: None };
            let map = renderer.shadow_with(field, method, (scene, &light), view.as_ref(), passes)?;
            let passes = first..deferred.map_or(0, DeferredPasses::len);
            let deferred = (!passes.is_empty()).then_some(passes);
            if acceptable.needs_shadows() {
                *work.build_ms.get_or_insert(0.0) += map.report.build_ms();
            }
            work.built += 1;
            let method = acceptable.effective.clone();
            let tested = Cell::new(Some((acceptable.view, true)));
            self.maps.push(CachedMap { method, light, map, tested, deferred });
        }
        // The most recently used map of each light is the one for this picture.
        let last =
            |light: &LightSource| self.maps.iter().rfind(|map| map.light == *light).map(|map| &map.map);
        Ok(lights.iter().filter_map(last).collect())
    }

    /// Completes the shadow maps whose passes were deferred, once the picture is drawn, and adds their build time.
    /// Returns `false` if a map is incomplete, so that the picture is invalid; the cache then lacks this map.
    ///
    /// # Errors
    /// The device could not build a map.
    pub fn complete(
        &mut self,
        MapSource { renderer, loaded, .. }: MapSource<'_>,
        method: &dyn Method,
        deferred: DeferredPasses,
        work: &mut Work,
    ) -> Result<bool> {
        let results = deferred.into_results();
        let mut outcome = Ok(true);
        self.maps.retain_mut(|cached| {
            let Some(passes) = cached.deferred.take() else { return true };
            let own = results.get(passes).unwrap_or(&[None]);
            let spans = own.iter().flatten().map(|result| result.span.best().0);
            match renderer.complete(loaded, method, &mut cached.map, own) {
                Ok(true) => {
                    *work.build_ms.get_or_insert(0.0) += spans.sum::<f64>();
                    true
                }
                Ok(false) => {
                    outcome = std::mem::replace(&mut outcome, Ok(true)).map(|_| false);
                    false
                }
                Err(e) => {
                    outcome = Err(e);
                    false
                }
            }
        });
        outcome
    }

    /// Evicts the least recently used shadow maps from the cache until it has space for `missing` more. Maps of
    /// lights outside `lights` are evicted first.
    fn make_room(&mut self, lights: &[LightSource], missing: usize) {
        let is_other = |map: &CachedMap| !lights.contains(&map.light);
        loop {
            let others = self.maps.iter().filter(|map| is_other(map)).count();
            let is_full = self.maps.len() + missing > self.capacity * lights.len();
            let evicted = match others > self.capacity || (is_full && others > 0) {
                true => self.maps.iter().position(is_other),
                false => (is_full && !self.maps.is_empty()).then_some(0),
            };
            let Some(evicted) = evicted else { return };
            self.maps.remove(evicted);
        }
    }
}
