//! What answers questions about a scene, and what it keeps on the device from one to the next. It knows no Python.

use crate::arguments::Asked;
use crate::attended::Ending;
use crate::device;
use crate::volume::Held;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;
use umbravox::engine::{MapCoverage, ReusePolicy, ShadowCache, Work};
use umbravox::error::{Error, Result};
use umbravox::exact::ExactField;
use umbravox::files::loading::Loading;
use umbravox::open::presets::{PRESETS, Scale};
use umbravox::open::provenance::picture_texts;
use umbravox::open::units::Units;
use umbravox::open::{Diagnostic, Loaded, SceneSettings};
use umbravox::render::{DeviceTransfer, LoadedVolume, Picture, Renderer};
use umbravox::scene::{Camera, Scene};
use umbravox::shadow::{BuildReport, ShadowMap};
use umbravox::transfer::TransferFunction;
use umbravox::volume::{DirectionMoments, Volume};

/// Between two looks whether another question is answered.
const WAITING: Duration = Duration::from_millis(2);
/// A part of a picture between two looks whether to go on, ms; all of a small picture is one.
const PART_MS: f64 = 200.0;

/// A volume, and what is kept of the questions about it. No answer depends on the questions before it.
pub struct Stage {
    pub held: Held,
    kit: Mutex<Kit>,
    /// Apart from the rest, so that nobody waits for a picture to read them.
    told: Mutex<Told>,
}

/// What can be told of the questions so far.
#[derive(Default)]
struct Told {
    /// What the last picture took.
    last: Option<Cost>,
    /// What was assumed, and nobody has been told of.
    untold: Vec<Diagnostic>,
    notes: Vec<String>,
}

impl Told {
    /// Each line once.
    fn note(&mut self, line: &str) -> bool {
        let is_new = !self.notes.iter().any(|note| note == line);
        if is_new {
            self.notes.push(line.to_owned());
        }
        is_new
    }
}

/// What is kept from one question to the next.
#[derive(Default)]
struct Kit {
    device: Option<(Arc<Renderer>, LoadedVolume)>,
    looked: Option<Looked>,
}

/// A look at the volume.
struct Looked {
    asked: Asked,
    loaded: Loaded,
    kept: ShadowCache,
    /// Settings, and the camera that they framed: looking for that takes longer than a small picture.
    framed: Option<(SceneSettings, Camera)>,
}

impl Looked {
    /// The scene of settings that look so.
    fn scene(&mut self, settings: &SceneSettings) -> Result<Scene> {
        let of_camera = SceneSettings {
            size: settings.size,
            eye: settings.eye,
            target: settings.target,
            up: settings.up,
            view: settings.view,
            zoom: settings.zoom,
            fov: settings.fov,
            ..SceneSettings::default()
        };
        let Some((_, camera)) = self.framed.as_ref().filter(|(framed, _)| *framed == of_camera) else {
            let scene = self.loaded.scene_of(settings)?;
            self.framed = Some((of_camera, scene.camera));
            return Ok(scene);
        };
        let Camera { eye, target, up, fov_deg } = *camera;
        let place = SceneSettings {
            eye: Some(eye),
            target: Some(target),
            up: Some(up),
            fov: Some(fov_deg),
            view: None,
            zoom: None,
            ..settings.clone()
        };
        Ok(Scene { camera: *camera, ..self.loaded.scene_of(&place)? })
    }
}

/// What a picture took.
#[derive(Clone)]
pub struct Cost {
    pub adapter: String,
    pub clock: String,
    pub work: Work,
    pub frame_ms: f64,
    pub bytes: u64,
    pub left_out: Vec<String>,
}

/// What a picture, or a query, reads.
pub struct Made<'a> {
    pub renderer: &'a Renderer,
    pub on_device: &'a LoadedVolume,
    kept: &'a ShadowCache,
    pub maps: Vec<&'a ShadowMap>,
    pub scene: &'a Scene,
    work: Work,
}

impl Made<'_> {
    pub fn transfer(&self) -> Result<&DeviceTransfer> {
        self.kept.transfer().ok_or_else(|| Error::runtime("cannot draw", "scene", "it has no tables"))
    }
}

/// What the exact reference asks, apart from the scene, so that it is not held up meanwhile.
pub struct Looks {
    volume: Arc<Volume>,
    tf: TransferFunction,
    directions: Option<Arc<DirectionMoments>>,
}

impl Looks {
    fn of(loaded: &Loaded, scene: &Scene) -> Result<Self> {
        let strands = loaded.strands.as_ref().filter(|_| scene.shading.is_of_strands());
        let directions = strands.map(|strands| strands.directions()).transpose()?;
        Ok(Self { volume: Arc::clone(&loaded.volume), tf: loaded.tf.clone(), directions })
    }

    pub fn field(&self) -> ExactField<'_> {
        ExactField::new(&self.volume, &self.tf).with_directions(self.directions.clone())
    }
}

impl Stage {
    /// Nothing kept yet.
    pub fn new(held: Held) -> Self {
        let mut told = Told::default();
        held.diagnostics.iter().for_each(|d| {
            told.note(&d.message);
        });
        Self { held, kit: Mutex::default(), told: Mutex::new(told) }
    }

    /// What was assumed, a line each.
    pub fn notes(&self) -> Vec<String> {
        lock(&self.told).notes.clone()
    }

    /// More of that.
    pub fn note(&self, notes: &[String]) {
        let mut told = lock(&self.told);
        notes.iter().for_each(|line| {
            told.note(line);
        });
    }

    /// What was assumed since this was asked last.
    pub fn take_untold(&self) -> Vec<Diagnostic> {
        std::mem::take(&mut lock(&self.told).untold)
    }

    /// What the last picture took.
    pub fn last(&self) -> Option<Cost> {
        lock(&self.told).last.clone()
    }

    /// Looks at the volume, unless that look is kept, and asks something of it.
    pub fn looked_at<T>(
        &self,
        asked: &Asked,
        ending: &Ending,
        ask: impl FnOnce(&Loaded, Scene) -> Result<T>,
    ) -> Result<T> {
        let mut kit = self.kit(ending)?;
        let looked = self.look(&mut kit, asked)?;
        let scene = looked.scene(&asked.settings)?;
        ask(&looked.loaded, scene)
    }

    /// What the exact reference is asked of.
    pub fn exact(&self, asked: &Asked, ending: &Ending) -> Result<(Looks, Scene)> {
        self.looked_at(asked, ending, |loaded, scene| Ok((Looks::of(loaded, &scene)?, scene)))
    }

    fn look<'s>(&self, kit: &'s mut Kit, asked: &Asked) -> Result<&'s mut Looked> {
        let same =
            |l: &Looked| l.asked.settings.looks_as(&asked.settings) && l.asked.function == asked.function;
        if !kit.looked.as_ref().is_some_and(same) {
            let settings = &asked.settings;
            let mut functions = settings.functions(self.held.volume.labels().is_some())?;
            if let Some(tf) = &asked.function {
                functions = functions.with_whole(&tf.name, tf.clone());
            }
            let field = (Arc::clone(&self.held.volume), self.held.strands.clone());
            let loaded = settings.look_at(field, functions, Vec::new(), &Loading::default())?;
            let mut told = lock(&self.told);
            for diagnostic in loaded.diagnostics.iter().cloned().chain(self.guess(asked, &loaded)) {
                if told.note(&diagnostic.message) {
                    told.untold.push(diagnostic);
                }
            }
            let kept = ShadowCache::new(settings.forced()).serving_by(ReusePolicy::Same);
            kit.looked = Some(Looked { asked: asked.clone(), loaded, kept, framed: None });
        }
        kit.looked.as_mut().ok_or_else(|| Error::runtime("cannot draw", "scene", "nothing is looked at"))
    }

    /// What to say where nobody has said what an array's values are, and a preset was laid over them.
    fn guess(&self, asked: &Asked, loaded: &Loaded) -> Option<Diagnostic> {
        let is_preset = PRESETS.iter().any(|p| p.name == loaded.tf_source && p.scale == Scale::Hounsfield);
        let said = self.held.read_by.is_some() || asked.settings.units.is_some() || asked.function.is_some();
        let is_chosen = asked.settings.tf.is_none();
        let units = loaded.suiting.units.filter(|_| (is_preset || is_chosen) && !said)?;
        let taken = match units {
            Units::Hu => "Hounsfield units",
            Units::Fraction => "fractions of their range",
        };
        let text = format!(
            "the array's values are taken for {taken}: units=\"hu\" or \"fraction\" says what they are"
        );
        Some(Diagnostic::warning(text))
    }

    /// The kit, once nobody else uses it.
    fn kit(&self, ending: &Ending) -> Result<MutexGuard<'_, Kit>> {
        loop {
            match self.kit.try_lock() {
                Ok(kit) => return Ok(kit),
                // What a question that failed half-way has left is as good as any.
                Err(TryLockError::Poisoned(left)) => return Ok(left.into_inner()),
                Err(TryLockError::WouldBlock) if ending.goes_on() => std::thread::sleep(WAITING),
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::cancelled("waiting for another question"));
                }
            }
        }
    }

    pub fn renderer(&self, asked: &Asked) -> Result<Arc<Renderer>> {
        device::renderer(asked.adapter.as_deref())
    }

    /// Builds what a picture or a query reads, unless it is kept.
    pub fn prepared<T>(
        &self,
        asked: &Asked,
        ending: &Ending,
        asked_for: MapCoverage,
        then: impl FnOnce(Made<'_>) -> Result<T>,
    ) -> Result<T> {
        let mut kit = self.kit(ending)?;
        let renderer = self.renderer(asked)?;
        // A device that was lost has taken all that was on it.
        if kit.device.as_ref().is_some_and(|(kept, _)| !Arc::ptr_eq(kept, &renderer)) {
            (kit.device, kit.looked) = (None, None);
        }
        if kit.device.is_none() {
            let on_device = renderer.load(Arc::clone(&self.held.volume))?;
            kit.device = Some((renderer, on_device.with_strands(self.held.strands.clone())));
        }
        self.look(&mut kit, asked)?;
        let Kit { device: Some((renderer, on_device)), looked: Some(looked) } = &mut *kit else {
            return Err(Error::runtime("cannot draw", "scene", "nothing is looked at"));
        };
        let scene = looked.scene(&asked.settings)?;
        let mut work = Work::default();
        looked.kept.set_transfer(renderer, on_device, &looked.loaded.tf, &mut work)?;
        let method = asked.settings.method()?;
        let spec = asked.settings.method_spec().to_string();
        looked.kept.prepare(renderer, on_device, (&spec, method.as_ref()), (&scene, asked_for), &mut work)?;
        let maps = looked.kept.shadows(&spec, &scene).unwrap_or_default();
        then(Made { renderer, on_device, kept: &looked.kept, maps, scene: &scene, work })
    }

    /// Draws a picture, in parts between which it can be ended.
    pub fn drawn(&self, asked: &Asked, ending: &Ending) -> Result<Picture> {
        self.prepared(asked, ending, MapCoverage::Picture, |made| {
            let Made { renderer, on_device, maps, scene, work, .. } = &made;
            let go_on = |_| ending.goes_on();
            let drawn =
                renderer.render_in_bands(on_device, made.transfer()?, maps.clone(), scene, PART_MS, go_on)?;
            let picture = drawn.ok_or_else(|| Error::cancelled("picture"))?;
            let (frame_ms, clock) = picture.span.best();
            lock(&self.told).last = Some(Cost {
                adapter: renderer.gpu().info.name.clone(),
                clock: clock.to_string(),
                work: *work,
                frame_ms,
                bytes: BuildReport::of_all(maps.iter().copied()).bytes,
                left_out: picture.plan.left_out.iter().map(ToString::to_string).collect(),
            });
            Ok(picture)
        })
    }

    /// The settings with nothing left to a default.
    pub fn resolved(&self, asked: &Asked, ending: &Ending) -> Result<SceneSettings> {
        let settings = &asked.settings;
        let mut resolved = self.looked_at(asked, ending, |loaded, scene| {
            Ok(settings.resolved(&scene, &loaded.tf_source, loaded.suiting))
        })?;
        resolved.shadow = Some(settings.method_spec());
        Ok(resolved)
    }

    /// What a picture file keeps as text.
    pub fn texts(&self, asked: &Asked, ending: &Ending) -> Result<Vec<(String, String)>> {
        let adapter = self.renderer(asked)?.gpu().info.name.clone();
        let is_of_files = self.held.is_of_files() && asked.function.is_none();
        let scene = if is_of_files { Some(self.resolved(asked, ending)?) } else { None };
        picture_texts(&adapter, scene.as_ref())
    }
}

/// Held for moments alone.
fn lock(told: &Mutex<Told>) -> MutexGuard<'_, Told> {
    told.lock().unwrap_or_else(PoisonError::into_inner)
}
