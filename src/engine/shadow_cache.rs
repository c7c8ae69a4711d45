//! Shadow maps that several pictures share.

use super::invalidation::shining_lights;
use crate::error::Result;
use crate::field::View;
use crate::render::{DeviceTransfer, LoadedVolume, Renderer};
use crate::scene::{Light, Scene};
use crate::shadow::{Method, ShadowMap};
use std::cell::Cell;

/// Time spent on the preparation of a picture; `None` where nothing had to be done.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Work {
    /// Tables of the transfer function, ms.
    pub table_ms: Option<f64>,
    /// Classification of bricks, ms.
    pub classify_ms: Option<f64>,
    /// Shadow structures, ms.
    pub build_ms: Option<f64>,
    /// Number of shadow structures built, empty ones included.
    pub built: usize,
}

/// Points at which a shadow map must be valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapCoverage {
    /// Points visible in the scene's picture.
    Picture,
    /// All points.
    AnyPoint,
}

impl MapCoverage {
    fn view(self, scene: &Scene) -> Option<View> {
        View::of_shadows(scene).filter(|_| self == Self::Picture)
    }
}

/// Fraction of the view's extent added on each side, so that a small camera movement needs no new map.
const VIEW_MARGIN: f64 = 0.1;

/// Rule that decides which cached maps a picture may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReusePolicy {
    /// Maps that cover the picture. New maps get a margin around the view.
    Covering,
    /// Maps identical to a newly built one. Pictures do not depend on the pictures before, to the bit.
    Exact,
}

/// Everything that a shadow map is built from, apart from scene and method.
#[derive(Clone, Copy)]
pub struct MapSource<'a> {
    /// Device and pipelines.
    pub renderer: &'a Renderer,
    /// Volume.
    pub loaded: &'a LoadedVolume,
    /// Tables of the transfer function.
    pub transfer: &'a DeviceTransfer,
}

/// Method with all settings, as a key.
fn method_key(method: &dyn Method) -> String {
    format!("{method:?}")
}

/// Methods that a picture may be drawn with.
struct Acceptable {
    /// Key of the requested method.
    requested: String,
    /// Key of the method that is built: the requested one, or `none` where the scene needs no shadows.
    effective: String,
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
        Self { requested: method_key(method), effective: method_key(effective), view }
    }

    fn needs_shadows(&self) -> bool {
        self.requested == self.effective
    }
}

/// A shadow map with its key.
struct CachedMap {
    method: String,
    light: Light,
    map: ShadowMap,
    /// Last view tested (`None`: all points) and the result. A test on a large volume takes milliseconds.
    tested: Cell<Option<(Option<View>, bool)>>,
}

impl CachedMap {
    /// Whether the map may be used for a view; `None` means all points.
    fn covers(&self, source: MapSource<'_>, view: Option<View>, reuse: ReusePolicy) -> bool {
        if let Some((_, covers)) = self.tested.get().filter(|(tested, _)| *tested == view) {
            return covers;
        }
        let (space, volume, active) = (&self.map.light_space, &source.loaded.volume, &source.transfer.active);
        let covers = match reuse {
            ReusePolicy::Covering => space.serves(volume, active, self.light, view.as_ref()),
            ReusePolicy::Exact => space.is_fitted_to(volume, active, self.light, view.as_ref()),
        };
        self.tested.set(Some((view, covers)));
        covers
    }
}

/// Least recently used cache of the shadow maps of one volume and one transfer function.
pub struct ShadowCache {
    /// Maximum number of maps for each light of the picture, and in total for all other lights.
    capacity: usize,
    reuse: ReusePolicy,
    /// Maps; the most recently used one is last.
    maps: Vec<CachedMap>,
}

impl ShadowCache {
    /// Capacity for interactive use: two methods side by side, each coarse and at full quality.
    pub const INTERACTIVE: usize = 4;

    /// Creates an empty cache with a capacity per light.
    pub fn new(capacity: usize, reuse: ReusePolicy) -> Self {
        Self { capacity, reuse, maps: Vec::new() }
    }

    /// Removes all maps.
    pub fn clear(&mut self) {
        self.maps.clear();
    }

    /// Number of structures that [`Self::prepare`] would build for the picture of a scene.
    pub fn missing(&self, source: MapSource<'_>, method: &dyn Method, scene: &Scene) -> usize {
        let acceptable = Acceptable::new(source, method, scene, MapCoverage::Picture.view(scene));
        let is_missing = |light: &&Light| self.find(source, &acceptable, **light).is_none();
        match acceptable.needs_shadows() {
            true => shining_lights(scene).iter().filter(is_missing).count(),
            false => 0,
        }
    }

    /// Whether maps of the method exist for every light, but one of them does not cover the picture.
    pub fn is_outgrown(&self, source: MapSource<'_>, method: &dyn Method, scene: &Scene) -> bool {
        let method_key = method_key(method);
        let exists =
            |light: &Light| self.maps.iter().any(|map| map.light == *light && map.method == method_key);
        shining_lights(scene).iter().all(exists) && self.missing(source, method, scene) > 0
    }

    fn find(&self, source: MapSource<'_>, acceptable: &Acceptable, light: Light) -> Option<usize> {
        let Acceptable { requested, effective, view } = acceptable;
        self.maps.iter().rposition(|map| {
            let is_substitute = !acceptable.needs_shadows() && map.method == *effective;
            map.light == light
                && (is_substitute || (map.method == *requested && map.covers(source, *view, self.reuse)))
        })
    }

    /// Returns a shadow structure for each light that shines, in their order; missing ones are built.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold.
    pub fn prepare(
        &mut self,
        source: MapSource<'_>,
        method: &dyn Method,
        (scene, coverage): (&Scene, MapCoverage),
        work: &mut Work,
    ) -> Result<Vec<&ShadowMap>> {
        let lights = shining_lights(scene);
        let acceptable = Acceptable::new(source, method, scene, coverage.view(scene));
        let mut missing: Vec<Light> = Vec::new();
        for light in &lights {
            match self.find(source, &acceptable, *light) {
                Some(place) => {
                    let map = self.maps.remove(place);
                    self.maps.push(map);
                }
                None if missing.contains(light) => {}
                None => missing.push(*light),
            }
        }
        if !acceptable.needs_shadows() {
            // Empty structures of earlier lights must not evict maps that took long to build.
            self.maps.retain(|map| map.method != acceptable.effective || lights.contains(&map.light));
        }
        self.make_room(&lights, missing.len());
        let margin = if self.reuse == ReusePolicy::Exact { 0.0 } else { VIEW_MARGIN };
        let view = acceptable.view.map(|view| view.with_margin(margin));
        let MapSource { renderer, loaded, transfer } = source;
        for light in missing {
            let map = renderer.shadow_in(loaded, transfer, method, (scene, light), view.as_ref())?;
            if acceptable.needs_shadows() {
                *work.build_ms.get_or_insert(0.0) += map.report.build_ms();
            }
            work.built += 1;
            let method = acceptable.effective.clone();
            self.maps.push(CachedMap { method, light, map, tested: Cell::new(None) });
        }
        // The most recently used map of each light is the one for this picture.
        let last = |light: &Light| self.maps.iter().rfind(|map| map.light == *light).map(|map| &map.map);
        Ok(lights.iter().filter_map(last).collect())
    }

    /// Evicts the least recently used maps until `missing` more fit; maps of other lights go first.
    fn make_room(&mut self, lights: &[Light], missing: usize) {
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
