//! Pictures of a scene that is edited, one after another: only what an edit makes stale is made anew.

use super::{DeviceTransfer, Forced, LoadedVolume, Picture, Renderer, needs_shadows};
use crate::error::Result;
use crate::scene::Scene;
use crate::shadow::{Method, NoShadows, ShadowMap};
use crate::transfer::{TransferChange, TransferFunction};
use crate::volume::Volume;
use std::sync::Arc;
use std::time::Instant;

/// What may differ from one picture to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    Volume,
    /// Extinction, at values that the volume has.
    Opacity,
    /// Extinction or colour, at values that the volume does not have.
    UnusedValues,
    /// Colour alone.
    Color,
    Light,
    /// The shadow method or its settings.
    Method,
    Camera,
    /// Ambient light, shading, background, step, skipping, picture size.
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
    Shadows,
    Frame,
}

/// What each change makes stale. Whether a stale shadow structure is then made is the plan's decision
/// ([`needs_shadows`]).
pub const INVALIDATES: [(Change, &[Stage]); 8] = [
    (Change::Volume, &[Stage::Upload, Stage::Tables, Stage::Shadows, Stage::Frame]),
    (Change::Opacity, &[Stage::Tables, Stage::Shadows, Stage::Frame]),
    (Change::UnusedValues, &[]),
    (Change::Color, &[Stage::Colors, Stage::Frame]),
    (Change::Light, &[Stage::Shadows, Stage::Frame]),
    (Change::Method, &[Stage::Shadows, Stage::Frame]),
    (Change::Camera, &[Stage::Frame]),
    (Change::Picture, &[Stage::Frame]),
];

/// What the next picture is of.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    pub volume: &'a Arc<Volume>,
    pub tf: &'a TransferFunction,
    pub method: &'a dyn Method,
    pub scene: &'a Scene,
}

/// A stage that was made, and the host's milliseconds for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Made {
    pub stage: Stage,
    pub wall_ms: f64,
}

/// What was made for a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    pub changes: Vec<Change>,
    /// Everything but the frame.
    pub made: Vec<Made>,
    /// Whether the last frame shows something else.
    pub frame_stale: bool,
}

/// Everything that is ready to be drawn.
pub struct Ready {
    pub loaded: LoadedVolume,
    pub transfer: DeviceTransfer,
    pub scene: Scene,
    /// The structure that the frame reads: the method's, or none where it needs none.
    pub shadow: ShadowMap,
}

/// A volume, a transfer function, a method and a scene that change.
pub struct Live {
    renderer: Arc<Renderer>,
    forced: Forced,
    ready: Option<Ready>,
    /// What `ready` is of.
    tf: Option<TransferFunction>,
    method: Option<ShadowKey>,
    /// The method whose structure `ready` holds: none too, where the scene needs no shadows.
    shadow_of: Option<ShadowKey>,
    framed: bool,
}

/// What tells one shadow structure from another on the same volume, tables and light.
#[derive(Debug, Clone, PartialEq)]
struct ShadowKey {
    method: &'static str,
    params: String,
    map: Option<u32>,
}

impl ShadowKey {
    fn of(method: &dyn Method) -> Self {
        Self { method: method.name(), params: method.params(), map: method.map_size() }
    }
}

impl Live {
    pub fn new(renderer: Arc<Renderer>, forced: Forced) -> Self {
        Self { renderer, forced, ready: None, tf: None, method: None, shadow_of: None, framed: false }
    }

    pub fn renderer(&self) -> &Arc<Renderer> {
        &self.renderer
    }

    /// What is ready, after the first update.
    pub fn ready(&self) -> Option<&Ready> {
        self.ready.as_ref()
    }

    /// What differs from the last picture.
    pub fn changes(&self, wanted: Wanted<'_>) -> Vec<Change> {
        let (Some(ready), Some(tf)) = (&self.ready, &self.tf) else { return vec![Change::Volume] };
        let (old, new) = (&ready.scene, wanted.scene);
        let mut changes = Vec::new();
        let mut note = |differs: bool, change| changes.extend(differs.then_some(change));
        note(!Arc::ptr_eq(&ready.loaded.volume, wanted.volume), Change::Volume);
        if tf != wanted.tf {
            let bricks = &ready.loaded.bricks;
            // Integrals are linear inside a table's bin: a value is touched by an edit a bin away.
            let bin = ready.transfer.value_bin();
            let change =
                TransferChange::between(tf, wanted.tf, |[lo, hi]| bricks.have_values(lo - bin, hi + bin));
            note(
                true,
                match change {
                    TransferChange::Nothing => Change::UnusedValues,
                    TransferChange::Color => Change::Color,
                    TransferChange::Extinction => Change::Opacity,
                },
            );
        }
        note(old.light != new.light, Change::Light);
        note(self.method.as_ref() != Some(&ShadowKey::of(wanted.method)), Change::Method);
        note(old.camera != new.camera, Change::Camera);
        let rest = Scene { camera: new.camera, light: new.light, ..old.clone() };
        note(rest != *new, Change::Picture);
        changes
    }

    /// Makes everything that the wanted picture needs and lacks. What fails leaves what was ready before it in place: the
    /// old volume after one that cannot be loaded, all but the shadows after a map that is too large.
    ///
    /// # Errors
    /// As [`Renderer::load`], [`Renderer::transfer`] and [`Renderer::shadow`].
    pub fn update(&mut self, wanted: Wanted<'_>) -> Result<Update> {
        let changes = self.changes(wanted);
        let stale = |stage: Stage| {
            let table = INVALIDATES.iter().filter(|(change, _)| changes.contains(change));
            table.flat_map(|(_, stages)| *stages).any(|s| *s == stage)
        };
        let mut made = Vec::new();
        let mut start = Instant::now();
        let mut done = |stage| {
            made.push(Made { stage, wall_ms: start.elapsed().as_secs_f64() * 1e3 });
            start = Instant::now();
        };
        let renderer = &self.renderer;
        let frame_stale = stale(Stage::Frame) || !self.framed;
        if stale(Stage::Upload) || self.ready.is_none() {
            let loaded = renderer.load(Arc::clone(wanted.volume))?;
            done(Stage::Upload);
            let transfer = renderer.transfer(&loaded, wanted.tf, self.forced)?;
            let shadow = renderer.shadow(&loaded, &transfer, &NoShadows, wanted.scene.light)?;
            self.ready = Some(Ready { loaded, transfer, scene: wanted.scene.clone(), shadow });
            self.tf = Some(wanted.tf.clone());
            self.shadow_of = None;
            done(Stage::Tables);
        }
        let Some(ready) = &mut self.ready else { return Ok(Update { changes, made, frame_stale }) };
        self.framed &= !frame_stale;
        if stale(Stage::Tables) && !stale(Stage::Upload) {
            ready.transfer = renderer.transfer(&ready.loaded, wanted.tf, self.forced)?;
            self.tf = Some(wanted.tf.clone());
            self.shadow_of = None;
            done(Stage::Tables);
        } else if stale(Stage::Colors) && !stale(Stage::Upload) {
            ready.transfer = renderer.recolor(&ready.loaded, &ready.transfer, wanted.tf)?;
            self.tf = Some(wanted.tf.clone());
            done(Stage::Colors);
        }
        if stale(Stage::Shadows) {
            self.shadow_of = None;
        }
        let needed = needs_shadows(wanted.scene, &ready.loaded.volume, &ready.transfer).is_ok();
        let method = if needed { wanted.method } else { &NoShadows };
        let key = ShadowKey::of(method);
        // A map that the last picture did not need may be what this one lacks, and the other way round it may stay.
        if self.shadow_of.as_ref() != Some(&key) && (needed || self.shadow_of.is_none()) {
            ready.shadow = renderer.shadow(&ready.loaded, &ready.transfer, method, wanted.scene.light)?;
            self.shadow_of = Some(key);
            done(Stage::Shadows);
        }
        ready.scene = wanted.scene.clone();
        self.method = Some(ShadowKey::of(wanted.method));
        Ok(Update { changes, made, frame_stale })
    }

    /// Says that a frame of what is ready has been drawn by other means than [`Self::picture`].
    pub fn drawn(&mut self) {
        self.framed = true;
    }

    /// Updates, and draws where the last frame shows something else.
    ///
    /// # Errors
    /// As [`Self::update`] and [`Renderer::render`].
    pub fn picture(&mut self, wanted: Wanted<'_>) -> Result<(Update, Option<Picture>)> {
        let update = self.update(wanted)?;
        let Some(ready) = self.ready.as_ref().filter(|_| update.frame_stale) else {
            return Ok((update, None));
        };
        let picture = self.renderer.render(&ready.loaded, &ready.transfer, &ready.shadow, &ready.scene)?;
        self.drawn();
        Ok((update, Some(picture)))
    }
}
