//! Opening a volume away from the window: reading, counting its values, finding what suits it.

use super::Document;
use super::worker::{Job, Worker};
use crate::cli::scene_args::{SceneArgs, SceneRequest};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::transfer::TransferFunction;
use crate::transfer::presets;
use crate::volume::{self, Histogram, Volume, VolumeSpec};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

/// Bins of the histogram behind the editor.
const HISTOGRAM_BINS: usize = 512;

/// A volume that has been read, with what was asked for beside it.
#[derive(Debug, Clone)]
pub struct Opened {
    pub spec: VolumeSpec,
    pub volume: Arc<Volume>,
    pub histogram: Histogram,
    pub tf: TransferFunction,
    /// The preset or file that `tf` is.
    pub tf_source: String,
    pub scene: Scene,
    /// Bricks on the device, once there.
    pub bricks: usize,
    /// What was assumed, one line each.
    pub notes: Vec<String>,
}

/// What a volume is opened with.
#[derive(Debug, Clone)]
pub enum With {
    /// Exactly what a command line or a scene file says.
    Request(Box<SceneRequest>),
    /// Another volume in a window that is open: what suits it, but light, ambient and the like as they are.
    Scene(Box<Scene>),
}

/// A reading that is under way.
pub struct Opening {
    pub source: String,
    pub since: Instant,
    result: Receiver<Result<Opened>>,
}

impl Opened {
    /// A document that has been open before.
    pub fn again(document: &Document) -> Self {
        Self {
            spec: document.spec.clone(),
            volume: Arc::clone(&document.volume),
            histogram: document.histogram.as_ref().clone(),
            tf: document.tf.as_ref().clone(),
            tf_source: document.tf_source.0.clone(),
            scene: document.scene.clone(),
            bricks: 0,
            notes: Vec::new(),
        }
    }
}

impl Opening {
    /// Starts to read; `wake` is called when that is done.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(spec: VolumeSpec, with: With, wake: impl Fn() + Send + 'static) -> Result<Self> {
        let (send, result) = channel();
        let source = spec.source.clone();
        let place = source.clone();
        std::thread::Builder::new()
            .name("open".into())
            .spawn(move || {
                let work = std::panic::AssertUnwindSafe(|| read(spec, with));
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
        Ok(Self { source, since: Instant::now(), result })
    }

    pub fn elapsed(&self) -> Duration {
        self.since.elapsed()
    }

    /// Hands a volume that has been read on to the render thread; `None` while it is being read.
    pub fn poll(&self, worker: &Worker) -> Option<Result<()>> {
        match self.result.try_recv() {
            Ok(Ok(opened)) => {
                worker.push(Job::Upload(Box::new(opened)));
                Some(Ok(()))
            }
            Ok(Err(e)) => Some(Err(e)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                Some(Err(Error::runtime("cannot read volume", &self.source, "its thread ended")))
            }
        }
    }
}

fn read(spec: VolumeSpec, with: With) -> Result<Opened> {
    let wanted_tf = match &with {
        With::Request(request) => request.tf.clone(),
        With::Scene(_) => None,
    };
    let found = wanted_tf.as_deref().map(presets::find).transpose()?;
    let volume = volume::load(&spec)?;
    let tf_source = wanted_tf.unwrap_or_else(|| presets::default_name(&volume).to_owned());
    let found = match found {
        Some(found) => found,
        None => presets::find(&tf_source)?,
    };
    let presets::ResolvedTransferFunction { tf, note } = found.suit(&volume);
    let scene = match with {
        With::Request(request) => request.resolve(&volume)?,
        With::Scene(scene) => {
            let framed = SceneArgs::default().into_request()?.resolve(&volume)?;
            Scene { camera: framed.camera, light: as_direction(&scene, &framed), ..*scene }
        }
    };
    let histogram = Histogram::of(&volume, HISTOGRAM_BINS);
    let notes = volume.provenance.warnings.iter().cloned().chain(note).collect();
    Ok(Opened { spec, volume: Arc::new(volume), histogram, tf, tf_source, scene, bricks: 0, notes })
}

/// A light at infinity suits any volume; a point light is somewhere in the old one.
fn as_direction(scene: &Scene, framed: &Scene) -> crate::scene::Light {
    match scene.light {
        light @ crate::scene::Light::Directional { .. } => light,
        crate::scene::Light::Point { .. } => framed.light,
    }
}
