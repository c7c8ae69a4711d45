//! What stays between the pictures of a session that a person works in: only what a change makes stale is made anew.

use crate::error::Result;
use crate::field::View;
use crate::render::{DeviceTransfer, DisabledOptimizations, LoadedVolume, Renderer, needs_shadows};
use crate::scene::{Light, Scene};
use crate::shadow::{Method, NoShadows, ShadowMap};
use crate::transfer::{TransferChange, TransferFunction};
use std::cell::Cell;

/// What may differ from one picture to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Another volume.
    Volume,
    /// Extinction, at values that the volume has.
    Opacity,
    /// Extinction or colour, at values that the volume does not have.
    UnusedValues,
    /// Colour alone.
    Color,
    /// Where lights are that shine, or how many.
    Light,
    /// The shadow method or its settings.
    Method,
    /// The camera.
    Camera,
    /// What the camera sees, so that a map fitted to what it saw no longer serves; beside [`Self::Camera`], or where the
    /// picture's shape changes.
    View,
    /// Colours and intensities of lights, ambient light, shading, background, step, skipping, picture size.
    Picture,
}

/// What is made on the way to a picture, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The volume on the device, and its bricks' ranges.
    Upload,
    /// Tables of the transfer function, and which bricks are active.
    Tables,
    /// Colours in the tables.
    Colors,
    /// The shadow structure.
    Shadows,
    /// The picture.
    Frame,
}

/// What each change makes stale. Whether a stale shadow structure is then made is the plan's decision
/// ([`needs_shadows`]).
pub const INVALIDATES: [(Change, &[Stage]); 9] = [
    (Change::Volume, &[Stage::Upload, Stage::Tables, Stage::Shadows, Stage::Frame]),
    (Change::Opacity, &[Stage::Tables, Stage::Shadows, Stage::Frame]),
    (Change::UnusedValues, &[]),
    (Change::Color, &[Stage::Colors, Stage::Frame]),
    (Change::Light, &[Stage::Shadows, Stage::Frame]),
    (Change::Method, &[Stage::Shadows, Stage::Frame]),
    (Change::Camera, &[Stage::Frame]),
    (Change::View, &[Stage::Shadows, Stage::Frame]),
    (Change::Picture, &[Stage::Frame]),
];

impl Change {
    /// Whether this makes a stage's product stale.
    pub fn invalidates(self, stage: Stage) -> bool {
        INVALIDATES.iter().any(|(change, stages)| *change == self && stages.contains(&stage))
    }

    /// Everything about the picture that differs from one scene to another.
    pub fn between_scenes(old: &Scene, new: &Scene) -> Vec<Self> {
        let moved = !places(old).eq(&places(new));
        // Lights elsewhere are all that is said of them.
        let lights = if moved { &new.lights } else { &old.lights };
        let rest = Scene { camera: new.camera, lights: lights.clone(), ..old.clone() };
        [(moved, Self::Light), (old.camera != new.camera, Self::Camera), (rest != *new, Self::Picture)]
            .into_iter()
            .filter_map(|(differs, change)| differs.then_some(change))
            .collect()
    }
}

/// Where lights are that a picture needs structures for.
fn places(scene: &Scene) -> Vec<Light> {
    scene.shining().iter().map(|source| source.light).collect()
}

/// What a picture's preparation cost, each `None` where nothing had to be done.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Work {
    /// Tables of the transfer function, ms.
    pub table_ms: Option<f64>,
    /// Classes of bricks, ms.
    pub classify_ms: Option<f64>,
    /// Shadow structures, ms.
    pub build_ms: Option<f64>,
}

/// Where a shadow structure is going to be looked up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapCoverage {
    /// In the picture of a scene: a map may be fitted to what the camera sees.
    Picture,
    /// At any point.
    AnyPoint,
}

impl MapCoverage {
    fn view(self, scene: &Scene) -> Option<View> {
        View::of_shadows(scene).filter(|_| self == Self::Picture)
    }
}

/// Share of what is seen that a map covers besides on each side, so that a camera that moves a little needs no other.
const VIEW_MARGIN: f64 = 0.1;

/// Which maps serve a picture that they were not built for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReusePolicy {
    /// Those that cover all that it shows; they are built a little wider, for a camera that moves.
    #[default]
    Covering,
    /// Those alone that would be built for it again: a picture is the same to the bit, whatever was drawn before.
    Same,
}

/// A map that is kept.
struct CachedMap {
    key: MapKey,
    map: ShadowMap,
    /// The view (none: every point) that was last asked about, and whether the map serves it: a picture asks several times,
    /// and going through the bricks of a large volume takes milliseconds.
    asked: Cell<Option<(Option<View>, bool)>>,
}

impl CachedMap {
    fn serves(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        view: Option<View>,
        serving: ReusePolicy,
    ) -> bool {
        if let Some((_, serves)) = self.asked.get().filter(|(asked, _)| *asked == view) {
            return serves;
        }
        let space = &self.map.light_space;
        let (volume, active, light) = (&loaded.volume, &transfer.active, self.key.light);
        let serves = match serving {
            ReusePolicy::Covering => space.serves(volume, active, light, view.as_ref()),
            ReusePolicy::Same => space.is_fitted_to(volume, active, light, view.as_ref()),
        };
        self.asked.set(Some((view, serves)));
        serves
    }
}

/// Which map is meant.
#[derive(Debug, Clone, PartialEq)]
struct MapKey {
    /// The method as written, with every setting.
    method: String,
    light: Light,
    /// Whether the scene needed it; where none did, an empty structure stands in.
    needed: bool,
}

/// Shadow maps that are kept at once for each light of the picture, and for lights that are not in it any more: two methods
/// side by side, each coarse and whole.
const MOST_MAPS: usize = 4;

/// Tables and shadow maps of one volume.
#[derive(Default)]
pub struct ShadowCache {
    transfer: Option<(TransferFunction, DeviceTransfer)>,
    forced: DisabledOptimizations,
    serving: ReusePolicy,
    /// Maps of the tables' extinction; the most lately used is last.
    maps: Vec<CachedMap>,
}

impl ShadowCache {
    /// Nothing yet; `forced` is what is done although no picture needs it.
    pub fn new(forced: DisabledOptimizations) -> Self {
        Self { forced, ..Self::default() }
    }

    /// The same, of whose maps only such serve.
    #[must_use]
    pub fn serving_by(self, serving: ReusePolicy) -> Self {
        Self { serving, ..self }
    }

    /// Makes the tables of `tf`, as far as it differs from the function before; `None` where it is the same.
    ///
    /// # Errors
    /// A function that cannot be drawn, or a device out of memory; what was kept before stays.
    pub fn set_transfer(
        &mut self,
        renderer: &Renderer,
        loaded: &LoadedVolume,
        tf: &TransferFunction,
        work: &mut Work,
    ) -> Result<Option<Change>> {
        let change = match &self.transfer {
            Some((before, _)) if before == tf => return Ok(None),
            Some((before, tables)) => change_of_transfer(before, tf, loaded, tables),
            None => Change::Opacity,
        };
        let made = match &self.transfer {
            Some((_, before)) if change.invalidates(Stage::Colors) => {
                Some(renderer.recolor(loaded, before, tf)?)
            }
            _ if change.invalidates(Stage::Tables) => Some(renderer.transfer(loaded, tf, self.forced)?),
            // The function that the tables are of stays the one that edits are compared with.
            _ => None,
        };
        if let Some(made) = made {
            work.table_ms = Some(made.table_ms);
            work.classify_ms = change.invalidates(Stage::Tables).then_some(made.classify_ms);
            self.transfer = Some((tf.clone(), made));
        }
        if change.invalidates(Stage::Shadows) {
            self.maps.clear();
        }
        Ok(Some(change))
    }

    /// The tables; `None` before the first [`Self::set_transfer`].
    pub fn transfer(&self) -> Option<&DeviceTransfer> {
        self.transfer.as_ref().map(|(_, made)| made)
    }

    /// Whether [`Self::prepare`] would build nothing: the method's structure is made, or the scene needs none.
    pub fn has(&self, loaded: &LoadedVolume, spec: &str, scene: &Scene) -> bool {
        self.missing(loaded, spec, scene) == 0
    }

    /// How many structures [`Self::prepare`] would build for the picture of a scene.
    pub fn missing(&self, loaded: &LoadedVolume, spec: &str, scene: &Scene) -> usize {
        let unneeded = |t: &DeviceTransfer| needs_shadows(scene, &loaded.volume, t).is_err();
        if self.transfer().is_some_and(unneeded) {
            return 0;
        }
        let view = MapCoverage::Picture.view(scene);
        places(scene).into_iter().filter(|light| self.serving(loaded, spec, *light, view).is_none()).count()
    }

    /// [`Change::View`], where maps of the method under this light are kept, but none for what the camera sees.
    pub fn change_of_view(&self, loaded: &LoadedVolume, spec: &str, scene: &Scene) -> Option<Change> {
        let kept = |light: &Light| self.place(spec, *light, true).is_some();
        let outgrown = places(scene).iter().all(kept) && !self.has(loaded, spec, scene);
        outgrown.then_some(Change::View)
    }

    /// Where a map is kept that serves.
    fn serving(&self, loaded: &LoadedVolume, spec: &str, light: Light, view: Option<View>) -> Option<usize> {
        let (_, transfer) = self.transfer.as_ref()?;
        self.maps.iter().rposition(|kept| {
            let key = &kept.key;
            let same = key.light == light && key.needed && key.method == spec;
            same && kept.serves(loaded, transfer, view, self.serving)
        })
    }

    /// Where a structure is kept, the most lately used one; what stands for none needed serves every method.
    fn place(&self, spec: &str, light: Light, needed: bool) -> Option<usize> {
        self.maps.iter().rposition(|CachedMap { key, .. }| {
            (key.light, key.needed) == (light, needed) && (!needed || key.method == spec)
        })
    }

    /// Builds the shadow structures of a method, which `spec` names, for each light of a scene that shines, unless they are
    /// kept; no map at all where no light can be kept from a sample.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold.
    pub fn prepare(
        &mut self,
        renderer: &Renderer,
        loaded: &LoadedVolume,
        (spec, method): (&str, &dyn Method),
        (scene, asked): (&Scene, MapCoverage),
        work: &mut Work,
    ) -> Result<()> {
        let lights = places(scene);
        for light in &lights {
            self.prepare_light(renderer, loaded, (spec, method), (scene, *light, asked), work)?;
        }
        self.forget_beyond(&lights);
        Ok(())
    }

    fn prepare_light(
        &mut self,
        renderer: &Renderer,
        loaded: &LoadedVolume,
        (spec, method): (&str, &dyn Method),
        (scene, light, asked): (&Scene, Light, MapCoverage),
        work: &mut Work,
    ) -> Result<()> {
        let Some((_, transfer)) = &self.transfer else { return Ok(()) };
        let needed = needs_shadows(scene, &loaded.volume, transfer).is_ok();
        // A map serves a scene that needs none; what was made where none was needed serves no other.
        let kept = self.serving(loaded, spec, light, asked.view(scene));
        if let Some(found) = kept.or_else(|| self.place(spec, light, false).filter(|_| !needed)) {
            let found = self.maps.remove(found);
            self.maps.push(found);
            return Ok(());
        }
        let method = if needed { method } else { &NoShadows };
        let margin = if self.serving == ReusePolicy::Same { 0.0 } else { VIEW_MARGIN };
        let view = asked.view(scene).map(|view| view.with_margin(margin));
        let map = renderer.shadow_in(loaded, transfer, method, light, view.as_ref())?;
        if needed {
            *work.build_ms.get_or_insert(0.0) += map.report.build_ms();
        }
        if !needed {
            // One for each light is enough, and must not drive out what took long to build.
            let lights = places(scene);
            self.maps.retain(|kept| {
                kept.key.needed || (lights.contains(&kept.key.light) && kept.key.light != light)
            });
        }
        let key = MapKey { method: spec.into(), light, needed };
        self.maps.push(CachedMap { key, map, asked: Cell::new(None) });
        Ok(())
    }

    /// Lets go of the maps that were used longest ago, beyond those that are kept for these lights and for others.
    fn forget_beyond(&mut self, lights: &[Light]) {
        let is_other = |kept: &CachedMap| !lights.contains(&kept.key.light);
        loop {
            let others = self.maps.iter().filter(|kept| is_other(kept)).count();
            // Other lights' maps make room first, and are never more than the maps of one light may be.
            let too_many = self.maps.len() > MOST_MAPS * lights.len();
            let first = match others > MOST_MAPS || (too_many && others > 0) {
                true => self.maps.iter().position(is_other),
                false => (too_many && !self.maps.is_empty()).then_some(0),
            };
            let Some(first) = first else { return };
            self.maps.remove(first);
        }
    }

    /// What [`Self::prepare`] has made for these, under one light.
    pub fn shadow(&self, spec: &str, light: Light) -> Option<&ShadowMap> {
        let named = |key: &MapKey| key.light == light && (!key.needed || key.method == spec);
        self.maps.iter().rfind(|kept| named(&kept.key)).map(|kept| &kept.map)
    }

    /// What [`Self::prepare`] has made for a scene: for each light that shines, in their order.
    pub fn shadows(&self, spec: &str, scene: &Scene) -> Option<Vec<&ShadowMap>> {
        places(scene).into_iter().map(|light| self.shadow(spec, light)).collect()
    }
}

/// What an edit changes of the pictures of a volume.
fn change_of_transfer(
    before: &TransferFunction,
    after: &TransferFunction,
    loaded: &LoadedVolume,
    tables: &DeviceTransfer,
) -> Change {
    // Integrals are linear inside a table's bin: a value is touched by an edit a bin away.
    let bin = tables.value_bin();
    let occurs = |[low, high]: [f64; 2]| loaded.volume.bricks().have_values(low - bin, high + bin);
    match TransferChange::between(before, after, occurs) {
        TransferChange::Nothing => Change::UnusedValues,
        TransferChange::Color => Change::Color,
        TransferChange::Extinction => Change::Opacity,
    }
}
