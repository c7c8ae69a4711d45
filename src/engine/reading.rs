//! Background reading of a volume: voxels, histogram and a suitable transfer function.

use super::task::{Task, Wake};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::open::presets::Suiting;
use crate::open::{Diagnostic, Loaded, MaskFlags, Read, SceneSettings, VolumeSpec, lacks_thickness};
use crate::scene::{Light, LightSource, Scene, Shading};
use crate::shadow::MethodSpec;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::{Histogram, Volume};
use std::sync::Arc;
use std::sync::mpsc::TryRecvError;
use std::time::Instant;

/// Bins of the histogram behind the editor.
const HISTOGRAM_BINS: usize = 512;

/// Diameter of strands that are opened without one, mm.
const ASSUMED_MM: f64 = 1.0;

/// Volume that has been read, with its initial state.
#[derive(Debug, Clone)]
pub struct OpenedVolume {
    /// Source and flags of the reading.
    pub spec: VolumeSpec,
    /// Volume.
    pub volume: Arc<Volume>,
    /// Strands that the volume was made from.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Histogram of the values.
    pub histogram: Arc<Histogram>,
    /// `None`: everything but the volume stays.
    pub initial: Option<InitialState>,
    /// Assumptions, one line each.
    pub notes: Vec<String>,
}

/// State of the window after a volume was opened.
#[derive(Debug, Clone)]
pub struct InitialState {
    /// Transfer function.
    pub tf: TransferFunction,
    /// Preset or file of `tf`.
    pub tf_source: String,
    /// Requested units and opacity scale.
    pub suiting: Suiting,
    /// Segmentation and the functions of its labels.
    pub parts: MaskFlags,
    /// Camera, lights and picture settings.
    pub scene: Scene,
    /// Shadow method; `None`: unchanged.
    pub method: Option<MethodSpec>,
    /// Whether pictures are written without their background; `None`: unchanged.
    pub transparent: Option<bool>,
}

/// Settings that a volume is opened with.
#[derive(Debug, Clone)]
pub enum OpenMode {
    /// Settings of a command line or a scene file.
    Settings(Box<SceneSettings>),
    /// Another volume in the open window: suitable defaults, but the current light and picture settings.
    Scene(Box<Scene>),
    /// New voxels of the same strands; everything else stays.
    Revoxelise,
}

/// Reading task; dropping it cancels the reading.
pub struct ReadTask {
    /// Path or name of the volume.
    pub source: String,
    /// Start time.
    pub since: Instant,
    /// Progress and cancellation.
    pub loading: Arc<Loading>,
    task: Task<Result<OpenedVolume>>,
}

impl ReadTask {
    /// Starts reading; `wake` is called at the end.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start(spec: VolumeSpec, with: OpenMode, wake: Wake) -> Result<Self> {
        let (source, loading) = (spec.source.clone(), Arc::new(Loading::default()));
        let progress = Arc::clone(&loading);
        let task = Task::start("open", wake, move |sender, _| {
            // The receiver is gone after a cancellation.
            let _ = sender.send(read(spec, with, &progress));
        })?;
        Ok(Self { source, since: Instant::now(), loading, task })
    }

    /// Result; `None` while reading.
    pub fn poll(&self) -> Option<Result<OpenedVolume>> {
        match self.task.poll() {
            Ok(outcome) => Some(outcome),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                let why = "an internal error occurred while reading it";
                Some(Err(Error::runtime("cannot read volume", &self.source, why)))
            }
        }
    }
}

impl Drop for ReadTask {
    fn drop(&mut self) {
        self.loading.cancel();
    }
}

fn read(mut spec: VolumeSpec, with: OpenMode, loading: &Loading) -> Result<OpenedVolume> {
    let (volume, strands, notes, initial) = match with {
        OpenMode::Revoxelise => {
            let Read { volume, strands } = spec.read(loading)?;
            let notes = volume.provenance.warnings.clone();
            (Arc::new(volume), strands, notes, None)
        }
        OpenMode::Settings(settings) => {
            let Loaded { volume, strands, tf, tf_source, scene, diagnostics, .. } = settings.load(loading)?;
            let (transparent, suiting) = (Some(settings.is_transparent()), settings.suiting());
            let (parts, method) = (settings.masking.clone(), Some(settings.method_spec()));
            let initial = InitialState { tf, tf_source, suiting, parts, scene, method, transparent };
            (volume, strands, texts(diagnostics), Some(initial))
        }
        OpenMode::Scene(old) => {
            let assumed = assume_thickness(&mut spec);
            let settings = SceneSettings::of_volume(&spec);
            let Loaded { volume, strands, tf, tf_source, scene, mut diagnostics, .. } =
                settings.load(loading)?;
            diagnostics.extend(assumed);
            // Point lights and meshes belong to the old volume.
            let lights = suitable_lights(&old, &scene);
            let shading = suitable_shading(old.shading, strands.is_some());
            let scene = Scene { camera: scene.camera, lights, mesh: None, shading, ..*old };
            let suiting = Suiting::default();
            let parts = MaskFlags::default();
            let initial =
                InitialState { tf, tf_source, suiting, parts, scene, method: None, transparent: None };
            (volume, strands, texts(diagnostics), Some(initial))
        }
    };
    let histogram = Arc::new(Histogram::of_with(&volume, HISTOGRAM_BINS, loading)?);
    Ok(OpenedVolume { spec, volume, strands, histogram, initial, notes })
}

/// Assumes a thickness for strands without one, since a dropped file has no flags.
fn assume_thickness(spec: &mut VolumeSpec) -> Option<Diagnostic> {
    let thickness = &mut spec.flags.strands.thickness;
    if thickness.is_some() || spec.flags.raw.is_some() || !lacks_thickness(&spec.source) {
        return None;
    }
    *thickness = Some(ASSUMED_MM);
    let hint = "change it under Strands in the side panel";
    let text = format!("{} has no thickness: {ASSUMED_MM} mm is assumed; {hint}", spec.source);
    Some(Diagnostic::note(text))
}

fn texts(diagnostics: Vec<Diagnostic>) -> Vec<String> {
    diagnostics.into_iter().map(|d| d.message).collect()
}

/// Keeps directional lights; replaces point lights, which belong to the old volume.
fn suitable_lights(scene: &Scene, framed: &Scene) -> Vec<LightSource> {
    let suitable = |source: &LightSource| match source.light {
        Light::Directional { .. } => *source,
        Light::Point { .. } => LightSource { light: framed.light(), ..*source },
    };
    scene.lights.iter().map(suitable).collect()
}

/// The shading, or none where it needs strands and the volume has none.
pub fn suitable_shading(shading: Shading, has_strands: bool) -> Shading {
    if shading.is_of_strands() && !has_strands { Shading::None } else { shading }
}
