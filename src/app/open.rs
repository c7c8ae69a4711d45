//! Opening a volume away from the window: reading, counting its values, finding what suits it.

use super::Document;
use super::worker::{Job, Worker};
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingProgress};
use crate::open::{self, Loaded, Remark, SceneSettings, VolumeSpec};
use crate::scene::{Light, Scene};
use crate::transfer::TransferFunction;
use crate::volume::{Histogram, Volume};
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
    /// `None`: everything but the volume stays as it is.
    pub beginning: Option<Beginning>,
    /// Bricks on the device, once there.
    pub bricks: usize,
    /// What was assumed, one line each.
    pub notes: Vec<String>,
}

/// What a volume begins with.
#[derive(Debug, Clone)]
pub struct Beginning {
    pub tf: TransferFunction,
    /// The preset or file that `tf` is.
    pub tf_source: String,
    pub scene: Scene,
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
pub struct Opening {
    pub source: String,
    pub since: Instant,
    pub loading: Arc<Loading>,
    result: Receiver<Result<Opened>>,
}

impl Opened {
    /// A document that has been open before.
    pub fn again(document: &Document) -> Self {
        Self {
            spec: document.spec.clone(),
            volume: Arc::clone(&document.volume),
            histogram: document.histogram.as_ref().clone(),
            beginning: None,
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
        let loading = Arc::new(Loading::default());
        let theirs = Arc::clone(&loading);
        std::thread::Builder::new()
            .name("open".into())
            .spawn(move || {
                let work = std::panic::AssertUnwindSafe(|| read(spec, with, &theirs));
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

    pub fn elapsed(&self) -> Duration {
        self.since.elapsed()
    }

    pub fn progress(&self) -> ReadingProgress {
        self.loading.progress()
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

impl Drop for Opening {
    fn drop(&mut self) {
        self.loading.cancel();
    }
}

fn read(spec: VolumeSpec, with: With, loading: &Loading) -> Result<Opened> {
    let (volume, notes, beginning) = match with {
        With::Again => {
            let volume = open::load_with(&spec, loading)?;
            let notes = volume.provenance.warnings.clone();
            (volume, notes, None)
        }
        With::Settings(settings) => {
            let Loaded { volume, tf, tf_source, scene, remarks } = settings.load(loading)?;
            let transparent = Some(settings.is_transparent());
            (volume, texts(remarks), Some(Beginning { tf, tf_source, scene, transparent }))
        }
        With::Scene(old) => {
            let settings = SceneSettings::of_volume(&spec);
            let Loaded { volume, tf, tf_source, scene, remarks } = settings.load(loading)?;
            let scene = Scene { camera: scene.camera, light: as_direction(&old, &scene), ..*old };
            (volume, texts(remarks), Some(Beginning { tf, tf_source, scene, transparent: None }))
        }
    };
    let histogram = Histogram::of_with(&volume, HISTOGRAM_BINS, loading)?;
    Ok(Opened { spec, volume: Arc::new(volume), histogram, beginning, bricks: 0, notes })
}

fn texts(remarks: Vec<Remark>) -> Vec<String> {
    remarks.into_iter().map(|(_, text)| text).collect()
}

/// A light at infinity suits any volume; a point light is somewhere in the old one.
fn as_direction(scene: &Scene, framed: &Scene) -> Light {
    match scene.light {
        light @ Light::Directional { .. } => light,
        Light::Point { .. } => framed.light,
    }
}
