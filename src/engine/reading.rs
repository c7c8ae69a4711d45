//! Reading a volume away from the window: its voxels, their histogram, what suits it.

use super::method_choice::MethodChoice;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::open::presets::Suiting;
use crate::open::{Diagnostic, Loaded, MaskFlags, Read, SceneSettings, VolumeSpec, lacks_thickness};
use crate::scene::{Light, LightSource, Scene, Shading};
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::{Histogram, Volume};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

/// Bins of the histogram behind the editor.
const HISTOGRAM_BINS: usize = 512;

/// Diameter of strands that are opened without one, mm.
const ASSUMED_MM: f64 = 1.0;

/// A volume that has been read, with what was asked for beside it.
#[derive(Debug, Clone)]
pub struct Opened {
    pub spec: VolumeSpec,
    pub volume: Arc<Volume>,
    /// What it was made from, where that is strands.
    pub strands: Option<Arc<VoxelisedStrands>>,
    pub histogram: Arc<Histogram>,
    /// `None`: everything but the volume stays as it is.
    pub beginning: Option<Beginning>,
    /// What was assumed, one line each.
    pub notes: Vec<String>,
}

/// What a volume begins with.
#[derive(Debug, Clone)]
pub struct Beginning {
    pub tf: TransferFunction,
    /// The preset or file that `tf` is.
    pub tf_source: String,
    /// What was asked for of units and opacity.
    pub suiting: Suiting,
    /// The segmentation and the functions of its labels.
    pub parts: MaskFlags,
    pub scene: Scene,
    /// `None`: as before.
    pub method: Option<MethodChoice>,
    /// Whether pictures are to be written without their background; `None`: as before.
    pub transparent: Option<bool>,
}

/// What a volume is opened with.
#[derive(Debug, Clone)]
pub enum With {
    /// Exactly what a command line or a scene file says.
    Settings(Box<SceneSettings>),
    /// Another volume in a window that is open: what suits it, but light, ambient and the like as they are.
    Scene(Box<Scene>),
    /// The same strands as other voxels: transfer function, camera, light and method stay as they are.
    Again,
}

/// A reading that is under way; it ends early once nobody waits for it any more.
pub struct Reading {
    pub source: String,
    pub since: Instant,
    pub loading: Arc<Loading>,
    result: Receiver<Result<Opened>>,
}

impl Reading {
    /// Starts to read; `wake` is called when that is done.
    ///
    /// # Errors
    /// A request for no shadow method, or a system that has no thread left.
    pub fn start(spec: VolumeSpec, with: With, wake: impl Fn() + Send + 'static) -> Result<Self> {
        let method = match &with {
            // Bad settings are said at once, not after a long reading.
            With::Settings(settings) => Some(MethodChoice::parse(&settings.method_spec().to_string())?),
            With::Scene(_) | With::Again => None,
        };
        let (send, result) = channel();
        let source = spec.source.clone();
        let place = source.clone();
        let loading = Arc::new(Loading::default());
        let theirs = Arc::clone(&loading);
        std::thread::Builder::new()
            .name("open".into())
            .spawn(move || {
                let work = std::panic::AssertUnwindSafe(|| read(spec, with, method, &theirs));
                let outcome = std::panic::catch_unwind(work).unwrap_or_else(|_| {
                    Err(Error::runtime(
                        "cannot read volume",
                        place,
                        "the program met a fault while reading it",
                    ))
                });
                // Nobody waits any more once the opening was cancelled.
                let _ = send.send(outcome);
                wake();
            })
            .map_err(|e| Error::runtime("cannot read volume", "window", e))?;
        Ok(Self { source, since: Instant::now(), loading, result })
    }

    /// What has been read; `None` while it is being read.
    pub fn poll(&self) -> Option<Result<Opened>> {
        match self.result.try_recv() {
            Ok(outcome) => Some(outcome),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                Some(Err(Error::runtime("cannot read volume", &self.source, "its thread ended")))
            }
        }
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        self.loading.cancel();
    }
}

fn read(mut spec: VolumeSpec, with: With, method: Option<MethodChoice>, loading: &Loading) -> Result<Opened> {
    let (volume, strands, notes, beginning) = match with {
        With::Again => {
            let Read { volume, strands } = spec.read(loading)?;
            let notes = volume.provenance.warnings.clone();
            (Arc::new(volume), strands, notes, None)
        }
        With::Settings(settings) => {
            let Loaded { volume, strands, tf, tf_source, scene, diagnostics, .. } = settings.load(loading)?;
            let (transparent, suiting) = (Some(settings.is_transparent()), settings.suiting());
            let parts = settings.masking.clone();
            let beginning = Beginning { tf, tf_source, suiting, parts, scene, method, transparent };
            (volume, strands, texts(diagnostics), Some(beginning))
        }
        With::Scene(old) => {
            let assumed = assume_thickness(&mut spec);
            let settings = SceneSettings::of_volume(&spec);
            let Loaded { volume, strands, tf, tf_source, scene, mut diagnostics, .. } =
                settings.load(loading)?;
            diagnostics.extend(assumed);
            // Point lights and meshes are somewhere in the old one.
            let lights = as_directions(&old, &scene);
            let shading = suited_shading(old.shading, strands.is_some());
            let scene = Scene { camera: scene.camera, lights, mesh: None, shading, ..*old };
            let suiting = Suiting::default();
            let parts = MaskFlags::default();
            let beginning = Beginning { tf, tf_source, suiting, parts, scene, method, transparent: None };
            (volume, strands, texts(diagnostics), Some(beginning))
        }
    };
    let histogram = Arc::new(Histogram::of_with(&volume, HISTOGRAM_BINS, loading)?);
    Ok(Opened { spec, volume, strands, histogram, beginning, notes })
}

/// Gives strands whose file has no thickness one, since a file that is dropped has no flags beside it, and says so.
fn assume_thickness(spec: &mut VolumeSpec) -> Option<Diagnostic> {
    let asked = &mut spec.flags.strands.thickness;
    if asked.is_some() || spec.flags.raw.is_some() || !lacks_thickness(&spec.source) {
        return None;
    }
    *asked = Some(ASSUMED_MM);
    let elsewhere = "Strands, at the side, takes another";
    let text = format!("{} has no thickness: {ASSUMED_MM} mm is assumed; {elsewhere}", spec.source);
    Some(Diagnostic::note(text))
}

fn texts(diagnostics: Vec<Diagnostic>) -> Vec<String> {
    diagnostics.into_iter().map(|d| d.message).collect()
}

/// A light at infinity suits any volume; a point light is somewhere in the old one.
fn as_directions(scene: &Scene, framed: &Scene) -> Vec<LightSource> {
    let suited = |source: &LightSource| match source.light {
        Light::Directional { .. } => *source,
        Light::Point { .. } => LightSource { light: framed.light(), ..*source },
    };
    scene.lights.iter().map(suited).collect()
}

/// The shading, unless it is one of strands and the volume is not of any.
pub fn suited_shading(shading: Shading, of_strands: bool) -> Shading {
    if shading.is_of_strands() && !of_strands { Shading::None } else { shading }
}
