//! Reading of a volume on a background thread: voxels, histogram and a suitable transfer function.

use super::task::{Task, Wake};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::open::presets::Suiting;
use crate::open::{Diagnostic, Loaded, MaskFlags, Read, SceneSettings, VolumeSpec, lacks_thickness};
use crate::scene::{Extent, Light, LightSource, Scene, Shading};
use crate::shadow::MethodSpec;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::{Histogram, Volume};
use std::sync::Arc;
use std::sync::mpsc::TryRecvError;
use std::time::Instant;

/// Number of bins of the volume histogram in the transfer-function editor.
const HISTOGRAM_BINS: usize = 512;

/// Assumed diameter of strands whose file gives none, mm.
const ASSUMED_MM: f64 = 1.0;

/// Volume that has been read from a file, with its histogram and the initial settings to show it.
#[derive(Debug, Clone)]
pub struct OpenedVolume {
    /// Path or name of the volume, with the flags by which it was read.
    pub spec: VolumeSpec,
    /// Voxel data of the opened volume.
    pub volume: Arc<Volume>,
    /// Hair or fibre strands from which the volume was voxelised, if any.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Histogram of the scalar values of the volume.
    pub histogram: Arc<Histogram>,
    /// Initial settings with which the viewer shows the volume. `None` keeps the current settings and replaces only
    /// the volume.
    pub initial: Option<InitialState>,
    /// Notes and warnings from reading the volume, such as an assumed strand diameter, one line each.
    pub notes: Vec<String>,
}

/// Initial settings of the viewer after a volume was opened: transfer function, scene and shadow method.
#[derive(Debug, Clone)]
pub struct InitialState {
    /// Initial transfer function for the opened volume.
    pub tf: TransferFunction,
    /// Preset name or file path of the initial transfer function.
    pub tf_source: String,
    /// Units of the scalar values and scale of the opacity that the user requested for transfer functions.
    pub suiting: Suiting,
    /// Segmentation of the volume and the transfer functions of its labels.
    pub parts: MaskFlags,
    /// Initial scene of the opened volume: camera, lights and picture settings.
    pub scene: Scene,
    /// Shadow method for the opened volume. `None` keeps the viewer's current method.
    pub method: Option<MethodSpec>,
    /// Whether exported picture files have a transparent background. `None` keeps the viewer's current choice.
    pub transparent: Option<bool>,
}

/// Source of the settings with which the viewer shows a newly opened volume.
#[derive(Debug, Clone)]
pub enum OpenMode {
    /// Settings from a command line or a scene file.
    Settings(Box<SceneSettings>),
    /// Settings for another volume in the open window: defaults that suit the volume, but the current lights and
    /// picture settings.
    Scene(Box<Scene>),
    /// Current settings of the viewer, unchanged, for a new voxelisation of the open strands.
    Revoxelise,
}

/// Background task that reads a volume. Dropping it cancels the reading.
pub struct ReadTask {
    /// Path or name of the volume that is being read.
    pub source: String,
    /// Time at which reading the volume started.
    pub since: Instant,
    /// Progress of reading the volume, which can also be cancelled.
    pub loading: Arc<Loading>,
    task: Task<Result<OpenedVolume>>,
}

impl ReadTask {
    /// Starts to read a volume on a background thread, which calls `wake` at the end.
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

    /// Result of reading the volume; `None` while the task runs.
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

/// Assumes a diameter for strands whose file gives none, since a dropped file has no flags. Returns a note for the
/// user.
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

/// Lights for a new volume: keeps directional lights of the old scene, and replaces point lights, whose positions
/// belong to the old volume.
fn suitable_lights(scene: &Scene, framed: &Scene) -> Vec<LightSource> {
    let suitable = |source: &LightSource| match source.light {
        Light::Directional { .. } => source.clone(),
        Light::Point { .. } => LightSource { light: framed.light(), extent: Extent::None, ..source.clone() },
    };
    scene.lights.iter().map(suitable).collect()
}

/// Returns the requested shading, or no shading if it needs strands and the volume has none.
pub fn suitable_shading(shading: Shading, has_strands: bool) -> Shading {
    if shading.is_of_strands() && !has_strands { Shading::None } else { shading }
}
