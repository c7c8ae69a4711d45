//! State of a scene without Python types: the volume, and the GPU data that its pictures and queries share.

use crate::arguments::Request;
use crate::device;
use crate::interrupts::Cancellation;
use crate::volume::InputVolume;
use ndarray::{Array3, s};
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

/// Interval between two attempts to lock the GPU data of a scene while another call uses them.
const RETRY_INTERVAL: Duration = Duration::from_millis(2);
/// Rendering time of one band (several rows) of a picture, ms; cancellation is tested after each band.
const BAND_MS: f64 = 200.0;

/// Number of rows of an exact picture that are computed between two checks for Ctrl-C.
const EXACT_ROWS: u32 = 4;

/// Volume with the GPU data that its pictures and queries share. No result depends on earlier calls.
pub struct SceneState {
    pub input: InputVolume,
    cache: Mutex<Cache>,
    /// Notes on the scene and cost of its last picture, locked separately, so that reading them does not wait for a
    /// picture.
    reported: Mutex<Reported>,
}

/// Notes on a scene, and the cost of its last rendered picture.
#[derive(Default)]
struct Reported {
    /// Cost of the last rendered picture.
    last: Option<Cost>,
    /// Assumptions about the scene of which the caller was not yet warned.
    pending: Vec<Diagnostic>,
    notes: Vec<String>,
}

impl Reported {
    /// Adds a note about the scene unless it exists already; returns whether it was added.
    fn note(&mut self, line: &str) -> bool {
        let is_new = !self.notes.iter().any(|note| note == line);
        if is_new {
            self.notes.push(line.to_owned());
        }
        is_new
    }
}

/// GPU data, transfer function and camera of a scene, reused by later pictures and queries.
#[derive(Default)]
struct Cache {
    session: Option<CachedSession>,
    scene: Option<CachedScene>,
}

/// Volume with the transfer function that one set of scene settings gives, reused by later calls.
struct CachedScene {
    request: Request,
    loaded: Loaded,
    /// Camera settings, and the camera that was fitted to the volume for them. Fitting takes longer than rendering a
    /// small picture.
    framed: Option<(SceneSettings, Camera)>,
}

impl CachedScene {
    /// Returns the scene (camera, lights, size) for settings whose transfer function is the cached one.
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

/// Cost of rendering one picture: graphics adapter, times, memory and skipped rendering work.
#[derive(Clone)]
pub struct Cost {
    pub adapter: String,
    pub clock: String,
    pub work: Work,
    pub frame_ms: f64,
    pub bytes: u64,
    pub left_out: Vec<String>,
}

/// Volume, transfer function and strand directions for exact results, copied so that the lock on the GPU data is free
/// meanwhile.
pub struct ExactInputs {
    volume: Arc<Volume>,
    tf: TransferFunction,
    directions: Option<Arc<DirectionMoments>>,
}

impl ExactInputs {
    fn of(loaded: &Loaded, scene: &Scene) -> Result<Self> {
        let strands = loaded.strands.as_ref().filter(|_| scene.shading.is_of_strands());
        let directions = strands.map(|strands| strands.directions()).transpose()?;
        Ok(Self { volume: Arc::clone(&loaded.volume), tf: loaded.tf.clone(), directions })
    }

    pub fn field(&self) -> ExactField<'_> {
        ExactField::new(&self.volume, &self.tf).with_directions(self.directions.clone())
    }

    /// Computes the exact picture of a scene, height x width x 4. `report` is called with the number of finished rows and of
    /// all rows.
    ///
    /// # Errors
    /// The computation was cancelled, or voxels cannot be read.
    pub fn picture(
        &self,
        scene: &Scene,
        cancellation: &Cancellation,
        report: impl Fn(usize, usize),
    ) -> Result<Array3<f32>> {
        let (field, height) = (self.field(), scene.height);
        let mut picture = Array3::zeros((height as usize, scene.width as usize, 4));
        for row in (0..height).step_by(EXACT_ROWS as usize) {
            let rows = row..(row + EXACT_ROWS).min(height);
            if !cancellation.goes_on() {
                return Err(Error::cancelled("exact picture"));
            }
            report(row as usize, height as usize);
            let part = field.picture_rows(scene, rows.clone());
            picture.slice_mut(s![rows.start as usize..rows.end as usize, .., ..]).assign(&part);
        }
        field.volume().check_reads()?;
        Ok(picture)
    }
}

impl SceneState {
    /// Creates the state of a scene, without data on the GPU.
    pub fn new(input: InputVolume) -> Self {
        let mut reported = Reported::default();
        input.diagnostics.iter().for_each(|d| {
            reported.note(&d.message);
        });
        Self { input, cache: Mutex::default(), reported: Mutex::new(reported) }
    }

    /// Returns the assumptions made about the scene, one line each.
    pub fn notes(&self) -> Vec<String> {
        lock(&self.reported).notes.clone()
    }

    /// Adds notes about the scene, each of them once.
    pub fn note(&self, notes: &[String]) {
        let mut reported = lock(&self.reported);
        notes.iter().for_each(|line| {
            reported.note(line);
        });
    }

    /// Removes and returns the assumptions about the scene that were made since the last call.
    pub fn take_pending(&self) -> Vec<Diagnostic> {
        std::mem::take(&mut lock(&self.reported).pending)
    }

    /// Returns the cost of the last rendered picture.
    pub fn last(&self) -> Option<Cost> {
        lock(&self.reported).last.clone()
    }

    /// Calls `ask` with the scene, and with the volume and its transfer function, which are cached.
    pub fn with_scene<T>(
        &self,
        request: &Request,
        cancellation: &Cancellation,
        ask: impl FnOnce(&Loaded, Scene) -> Result<T>,
    ) -> Result<T> {
        let mut cache = self.cache(cancellation)?;
        let cached = self.cached_scene(&mut cache, request)?;
        let scene = cached.scene(&request.settings)?;
        ask(&cached.loaded, scene)
    }

    /// Returns the volume, transfer function and strand directions for exact results, and the scene.
    pub fn exact(&self, request: &Request, cancellation: &Cancellation) -> Result<(ExactInputs, Scene)> {
        self.with_scene(request, cancellation, |loaded, scene| Ok((ExactInputs::of(loaded, &scene)?, scene)))
    }

    fn cached_scene<'s>(&self, cache: &'s mut Cache, request: &Request) -> Result<&'s mut CachedScene> {
        let same = |l: &CachedScene| {
            l.request.settings.looks_as(&request.settings) && l.request.function == request.function
        };
        if !cache.scene.as_ref().is_some_and(same) {
            let settings = &request.settings;
            let mut functions = settings.functions(self.input.volume.labels().is_some())?;
            if let Some(tf) = &request.function {
                functions = functions.with_whole(&tf.name, tf.clone());
            }
            let field = (Arc::clone(&self.input.volume), self.input.strands.clone());
            let loaded = settings.look_at(field, functions, Vec::new(), &Loading::default())?;
            let mut reported = lock(&self.reported);
            for diagnostic in loaded.diagnostics.iter().cloned().chain(self.guess(request, &loaded)) {
                if reported.note(&diagnostic.message) {
                    reported.pending.push(diagnostic);
                }
            }
            if let Some(session) = &mut cache.session {
                session.reset(settings.disabled_optimizations());
            }
            cache.scene = Some(CachedScene { request: request.clone(), loaded, framed: None });
        }
        cache.scene.as_mut().ok_or_else(|| Error::runtime("cannot draw", "scene", "no scene is loaded"))
    }

    /// Returns a warning if a preset or default transfer function is applied to an array whose units were never
    /// stated; `None` otherwise.
    fn guess(&self, request: &Request, loaded: &Loaded) -> Option<Diagnostic> {
        let is_preset = PRESETS.iter().any(|p| p.name == loaded.tf_source && p.scale == Scale::Hounsfield);
        let is_known =
            self.input.read_by.is_some() || request.settings.units.is_some() || request.function.is_some();
        let is_chosen = request.settings.tf.is_none();
        let units = loaded.suiting.units.filter(|_| (is_preset || is_chosen) && !is_known)?;
        let taken = match units {
            Units::Hu => "Hounsfield units",
            Units::Fraction => "fractions of their range",
        };
        let text = format!(
            "the array's values are taken for {taken}: units=\"hu\" or \"fraction\" says what they are"
        );
        Some(Diagnostic::warning(text))
    }

    /// Waits until no other call uses the GPU data of the scene, and locks them.
    fn cache(&self, cancellation: &Cancellation) -> Result<MutexGuard<'_, Cache>> {
        loop {
            match self.cache.try_lock() {
                Ok(cache) => return Ok(cache),
                // The cached data stay valid after a failed call.
                Err(TryLockError::Poisoned(left)) => return Ok(left.into_inner()),
                Err(TryLockError::WouldBlock) if cancellation.goes_on() => std::thread::sleep(RETRY_INTERVAL),
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::cancelled("waiting for another question"));
                }
            }
        }
    }

    pub fn renderer(&self, request: &Request) -> Result<Arc<Renderer>> {
        device::renderer(&request.run)
    }

    /// Prepares the GPU data for a picture or a query, and passes them to `then` with the scene.
    pub fn prepared<T>(
        &self,
        request: &Request,
        cancellation: &Cancellation,
        coverage: MapCoverage,
        then: impl FnOnce(Prepared<'_>, &Scene, Work) -> Result<T>,
    ) -> Result<T> {
        let mut cache = self.cache(cancellation)?;
        let renderer = self.renderer(request)?;
        // All data on a lost device are lost.
        if cache.session.as_ref().is_some_and(|session| !Arc::ptr_eq(&session.renderer, &renderer)) {
            *cache = Cache::default();
        }
        let cached = self.cached_scene(&mut cache, request)?;
        let (forced, tf) = (cached.request.settings.disabled_optimizations(), cached.loaded.tf.clone());
        let scene = cached.scene(&request.settings)?;
        if cache.session.is_none() {
            // Exact reuse only: no result may depend on earlier calls.
            let maps = ShadowCache::new(ShadowCache::INTERACTIVE, ReusePolicy::Exact);
            let mut session = CachedSession::new(renderer, forced, maps);
            session.load(Arc::clone(&self.input.volume), self.input.strands.clone())?;
            cache.session = Some(session);
        }
        let none = || Error::runtime("cannot draw", "scene", "it has no device");
        let session = cache.session.as_mut().ok_or_else(none)?;
        let mut work = Work::default();
        session.set_transfer(&tf, &mut work)?;
        let method = request.settings.method()?;
        then(session.prepare(method.as_ref(), (&scene, coverage), &mut work)?, &scene, work)
    }

    /// Renders a picture in bands of rows; the rendering can be cancelled between them.
    pub fn drawn(&self, request: &Request, cancellation: &Cancellation) -> Result<Picture> {
        self.prepared(request, cancellation, MapCoverage::Picture, |prepared, scene, work| {
            let Prepared { renderer, loaded, transfer, shadows } = prepared;
            let bytes = BuildReport::of_all(shadows.iter().copied()).bytes;
            let proceed = |_| cancellation.goes_on();
            let drawn = renderer.render_in_bands(loaded, transfer, shadows, scene, BAND_MS, proceed)?;
            let picture = drawn.ok_or_else(|| Error::cancelled("picture"))?;
            let (frame_ms, clock) = picture.span.best();
            lock(&self.reported).last = Some(Cost {
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

    /// Returns the scene settings with every default filled in.
    pub fn resolved(&self, request: &Request, cancellation: &Cancellation) -> Result<SceneSettings> {
        let settings = &request.settings;
        let mut resolved = self.with_scene(request, cancellation, |loaded, scene| {
            Ok(settings.resolved(&scene, &loaded.tf_source, loaded.suiting))
        })?;
        resolved.shadow = Some(settings.method_spec());
        Ok(resolved)
    }

    /// Returns the text chunks (metadata) of a picture file.
    pub fn texts(&self, request: &Request, cancellation: &Cancellation) -> Result<Vec<(String, String)>> {
        let adapter = self.renderer(request)?.gpu().info.name.clone();
        let is_of_files = self.input.is_of_files() && request.function.is_none();
        let scene = if is_of_files { Some(self.resolved(request, cancellation)?) } else { None };
        picture_texts(&adapter, scene.as_ref())
    }
}

/// Locks the notes on a scene and the cost of its last picture, for a moment only.
fn lock(reported: &Mutex<Reported>) -> MutexGuard<'_, Reported> {
    reported.lock().unwrap_or_else(PoisonError::into_inner)
}
