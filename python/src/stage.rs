//! Questions about a scene and the device state that they share, without Python types.

use crate::arguments::Asked;
use crate::attended::Ending;
use crate::device;
use crate::volume::Held;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;
use umbravox::engine::{CachedSession, MapCoverage, Prepared, ReusePolicy, ShadowCache, Work};
use umbravox::error::{Error, Result};
use umbravox::exact::ExactField;
use umbravox::files::loading::Loading;
use umbravox::open::presets::{PRESETS, Scale};
use umbravox::open::provenance::picture_texts;
use umbravox::open::units::Units;
use umbravox::open::{Diagnostic, Loaded, SceneSettings};
use umbravox::render::{Picture, Renderer};
use umbravox::scene::{Camera, Scene};
use umbravox::shadow::BuildReport;
use umbravox::transfer::TransferFunction;
use umbravox::volume::{DirectionMoments, Volume};

/// Interval between two attempts to lock the device state.
const WAITING: Duration = Duration::from_millis(2);
/// Duration of a band of a picture, after which cancellation is checked, ms.
const PART_MS: f64 = 200.0;

/// Volume and the state shared by the questions about it. No answer depends on the questions before it.
pub struct Stage {
    pub held: Held,
    kit: Mutex<Kit>,
    /// Locked separately, so that reading notes does not wait for a picture.
    told: Mutex<Told>,
}

/// Notes and costs of the questions so far.
#[derive(Default)]
struct Told {
    /// Cost of the last picture.
    last: Option<Cost>,
    /// Assumptions not yet reported to the caller.
    untold: Vec<Diagnostic>,
    notes: Vec<String>,
}

impl Told {
    /// Adds a note unless it is known; returns whether it was added.
    fn note(&mut self, line: &str) -> bool {
        let is_new = !self.notes.iter().any(|note| note == line);
        if is_new {
            self.notes.push(line.to_owned());
        }
        is_new
    }
}

/// Device state and the last look, reused by later questions.
#[derive(Default)]
struct Kit {
    session: Option<CachedSession>,
    looked: Option<Looked>,
}

/// Transfer function and scene defaults for one set of settings.
struct Looked {
    asked: Asked,
    loaded: Loaded,
    /// Settings of the camera and the camera framed for them: framing takes longer than a small picture.
    framed: Option<(SceneSettings, Camera)>,
}

impl Looked {
    /// Scene for settings with the same look.
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

/// Cost of a picture.
#[derive(Clone)]
pub struct Cost {
    pub adapter: String,
    pub clock: String,
    pub work: Work,
    pub frame_ms: f64,
    pub bytes: u64,
    pub left_out: Vec<String>,
}

/// Inputs of the exact reference, copied so that the lock is released meanwhile.
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
    /// Creates a stage without device state.
    pub fn new(held: Held) -> Self {
        let mut told = Told::default();
        held.diagnostics.iter().for_each(|d| {
            told.note(&d.message);
        });
        Self { held, kit: Mutex::default(), told: Mutex::new(told) }
    }

    /// Assumptions, one line each.
    pub fn notes(&self) -> Vec<String> {
        lock(&self.told).notes.clone()
    }

    /// Adds notes.
    pub fn note(&self, notes: &[String]) {
        let mut told = lock(&self.told);
        notes.iter().for_each(|line| {
            told.note(line);
        });
    }

    /// Removes and returns the assumptions made since the last call.
    pub fn take_untold(&self) -> Vec<Diagnostic> {
        std::mem::take(&mut lock(&self.told).untold)
    }

    /// Cost of the last picture.
    pub fn last(&self) -> Option<Cost> {
        lock(&self.told).last.clone()
    }

    /// Passes the volume's look and scene to `ask`; the look is cached.
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

    /// Inputs of the exact reference, and the scene.
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
            if let Some(session) = &mut kit.session {
                session.reset(settings.disabled_optimizations());
            }
            kit.looked = Some(Looked { asked: asked.clone(), loaded, framed: None });
        }
        kit.looked.as_mut().ok_or_else(|| Error::runtime("cannot draw", "scene", "nothing is looked at"))
    }

    /// Diagnostic for a preset applied to an array whose units were never stated; `None` where they are known.
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

    /// Waits for the device state.
    fn kit(&self, ending: &Ending) -> Result<MutexGuard<'_, Kit>> {
        loop {
            match self.kit.try_lock() {
                Ok(kit) => return Ok(kit),
                // The state stays valid after a failed question.
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

    /// Prepares a picture or a query and passes it to `then` with its scene.
    pub fn prepared<T>(
        &self,
        asked: &Asked,
        ending: &Ending,
        coverage: MapCoverage,
        then: impl FnOnce(Prepared<'_>, &Scene, Work) -> Result<T>,
    ) -> Result<T> {
        let mut kit = self.kit(ending)?;
        let renderer = self.renderer(asked)?;
        // A lost device has lost everything on it.
        if kit.session.as_ref().is_some_and(|session| !Arc::ptr_eq(&session.renderer, &renderer)) {
            *kit = Kit::default();
        }
        let looked = self.look(&mut kit, asked)?;
        let (forced, tf) = (looked.asked.settings.disabled_optimizations(), looked.loaded.tf.clone());
        let scene = looked.scene(&asked.settings)?;
        if kit.session.is_none() {
            // No answer depends on the questions before it.
            let cache = ShadowCache::new(ShadowCache::INTERACTIVE, ReusePolicy::Exact);
            let mut session = CachedSession::new(renderer, forced, cache);
            session.load(Arc::clone(&self.held.volume), self.held.strands.clone())?;
            kit.session = Some(session);
        }
        let none = || Error::runtime("cannot draw", "scene", "it has no device");
        let session = kit.session.as_mut().ok_or_else(none)?;
        let mut work = Work::default();
        session.set_transfer(&tf, &mut work)?;
        let method = asked.settings.method()?;
        then(session.prepare(method.as_ref(), (&scene, coverage), &mut work)?, &scene, work)
    }

    /// Draws a picture in bands; it can be cancelled between them.
    pub fn drawn(&self, asked: &Asked, ending: &Ending) -> Result<Picture> {
        self.prepared(asked, ending, MapCoverage::Picture, |prepared, scene, work| {
            let Prepared { renderer, loaded, transfer, shadows } = prepared;
            let bytes = BuildReport::of_all(shadows.iter().copied()).bytes;
            let proceed = |_| ending.goes_on();
            let drawn = renderer.render_in_bands(loaded, transfer, shadows, scene, PART_MS, proceed)?;
            let picture = drawn.ok_or_else(|| Error::cancelled("picture"))?;
            let (frame_ms, clock) = picture.span.best();
            lock(&self.told).last = Some(Cost {
                adapter: renderer.gpu().info.name.clone(),
                clock: clock.to_string(),
                work,
                frame_ms,
                bytes,
                left_out: picture.plan.left_out.iter().map(ToString::to_string).collect(),
            });
            Ok(picture)
        })
    }

    /// Settings with every default filled in.
    pub fn resolved(&self, asked: &Asked, ending: &Ending) -> Result<SceneSettings> {
        let settings = &asked.settings;
        let mut resolved = self.looked_at(asked, ending, |loaded, scene| {
            Ok(settings.resolved(&scene, &loaded.tf_source, loaded.suiting))
        })?;
        resolved.shadow = Some(settings.method_spec());
        Ok(resolved)
    }

    /// Text chunks of a picture file.
    pub fn texts(&self, asked: &Asked, ending: &Ending) -> Result<Vec<(String, String)>> {
        let adapter = self.renderer(asked)?.gpu().info.name.clone();
        let is_of_files = self.held.is_of_files() && asked.function.is_none();
        let scene = if is_of_files { Some(self.resolved(asked, ending)?) } else { None };
        picture_texts(&adapter, scene.as_ref())
    }
}

/// Locks for a moment only.
fn lock(told: &Mutex<Told>) -> MutexGuard<'_, Told> {
    told.lock().unwrap_or_else(PoisonError::into_inner)
}
