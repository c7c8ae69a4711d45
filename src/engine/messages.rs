//! What the window and the render thread say to each other. Both sides import this; it imports neither.

use crate::engine::Work;
use crate::engine::method_choice::MethodChoice;
use crate::engine::reading::Opened;
use crate::error::{Error, Result};
use crate::files::picture::Backdrop;
use crate::measure::error_map::{ErrorMap, ExactView};
use crate::render::{DisplayTexture, Omission};
use crate::scene::{Light, Scene};
use crate::shadow::{Bound, BuildReport};
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use glam::DVec3;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// All that decides a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    pub tf: Arc<TransferFunction>,
    /// The method, and a second one for the picture on the other side of the split.
    pub methods: Vec<MethodChoice>,
    /// Its width and height are the view's, in pixels.
    pub scene: Scene,
}

/// The picture that the window wants to show.
#[derive(Debug, Clone)]
pub struct Wanted {
    pub subject: Subject,
    /// When the hand did what this picture answers.
    pub since: Instant,
    /// Rises with everything that is wanted.
    pub revision: u64,
}

/// Work besides pictures, in order.
pub enum Job {
    Upload(Box<Opened>),
    Probe(ProbeRequest),
    Difference(Arc<DifferenceRequest>),
    Thumbnail(Box<ThumbnailRequest>),
    Export(Export),
}

/// What the render thread has to say.
pub enum Event {
    Uploaded(Box<Opened>),
    Frame(Box<Frame>),
    /// The change reached no picture: no voxel has the values that it concerns.
    Unchanged {
        revision: u64,
    },
    Probed(Box<ProbeResult>),
    Differences(Box<Differences>),
    /// Something else came before the comparison was done.
    DifferenceUnfinished(Arc<DifferenceRequest>),
    Thumbnail(Box<Thumbnail>),
    /// Share of the export that is done.
    ExportProgress(f32),
    Exported(Exported),
    /// Something failed; what was shown before stays.
    Failed(Error),
}

/// One method's part of a frame.
#[derive(Debug, Clone)]
pub struct Side {
    pub texture: Arc<DisplayTexture>,
    /// The method as drawn, which is coarser than the one wanted while a hand moves.
    pub spec: String,
    pub report: BuildReport,
    pub bound: Option<Bound>,
    pub left_out: Vec<Omission>,
    pub frame_ms: f64,
}

/// A finished picture.
#[derive(Debug, Clone)]
pub struct Frame {
    pub main: Side,
    pub other: Option<Side>,
    /// Of full quality: nothing finer follows.
    pub whole: bool,
    pub work: Work,
    /// From the hand's movement to the finished picture, ms.
    pub latency_ms: f64,
    /// The longest that one submission kept the queue, ms.
    pub longest_band_ms: f64,
    /// Of what was wanted.
    pub revision: u64,
}

impl Frame {
    /// Left and right of the split, or the only one.
    pub fn sides(&self) -> impl Iterator<Item = &Side> {
        std::iter::once(&self.main).chain(&self.other)
    }
}

/// Where to probe.
#[derive(Debug, Clone)]
pub enum Aim {
    /// What is seen through a pixel's middle: along a ray from the eye, unit direction.
    Ray { origin: DVec3, direction: DVec3 },
    /// A point, world mm.
    Point(DVec3),
}

/// A question about one point.
#[derive(Debug, Clone)]
pub struct ProbeRequest {
    pub aim: Aim,
    pub tf: Arc<TransferFunction>,
    pub light: Light,
    pub ambient: f64,
    pub methods: Vec<MethodChoice>,
}

/// A method's answer along the light ray.
#[derive(Debug, Clone)]
pub struct MethodCurve {
    pub spec: String,
    /// Depth in mm and transmittance.
    pub points: Vec<[f64; 2]>,
    /// Transmittance at the point itself.
    pub at_point: f64,
    /// What it promises, where it does.
    pub promise: Option<ProbedPromise>,
}

/// A promise, and how it is kept close to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbedPromise {
    pub bound: Bound,
    /// On the light ray through the nearest texel's centre; `None` where the map has no texel.
    pub nearest: Option<NearestRay>,
}

/// The light ray through the centre of the texel that is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestRay {
    /// From the point to it, in widths of a texel.
    pub texels_away: f64,
    /// The largest difference of transmittance from the exact one at a depth of this ray.
    pub largest: f64,
    /// Whether the promise is kept at every depth that was tested.
    pub kept: bool,
}

/// Transmittance against depth along the light ray through a point.
#[derive(Debug, Clone)]
pub struct ProbeResult {
    /// World mm.
    pub point: DVec3,
    /// The scalar value there.
    pub value: f64,
    /// Depth of the point along its light ray, mm; 0 is where the ray comes to the volume (or leaves the light).
    pub depth_mm: f64,
    /// Depth in mm and exact transmittance.
    pub exact: Vec<[f64; 2]>,
    pub exact_at_point: f64,
    pub methods: Vec<MethodCurve>,
}

/// Methods to compare with an exact answer.
#[derive(Debug, Clone)]
pub struct DifferenceRequest {
    pub view: Arc<ExactView>,
    pub tf: Arc<TransferFunction>,
    pub methods: Vec<MethodChoice>,
    pub logarithmic: bool,
}

/// One method's heat map.
pub struct DifferenceSide {
    pub spec: String,
    pub map: ErrorMap,
    pub texture: Arc<DisplayTexture>,
}

/// The heat maps of the shown methods, on one scale.
pub struct Differences {
    pub request: Arc<DifferenceRequest>,
    /// Left and right of the split, or the only one.
    pub sides: Vec<DifferenceSide>,
    /// The errors at the scale's two ends.
    pub least: f32,
    pub largest: f32,
}

/// A preset's small picture, asked for.
#[derive(Debug, Clone)]
pub struct ThumbnailRequest {
    /// Of [`crate::transfer::presets::PRESETS`].
    pub index: usize,
    pub tf: TransferFunction,
    pub scene: Scene,
    pub volume: Arc<Volume>,
}

/// A preset's small picture.
pub struct Thumbnail {
    pub index: usize,
    pub scene: Scene,
    pub volume: Arc<Volume>,
    pub texture: Arc<DisplayTexture>,
}

/// A picture to write.
#[derive(Debug, Clone)]
pub struct Export {
    pub path: PathBuf,
    pub tf: Arc<TransferFunction>,
    pub method: MethodChoice,
    /// With the picture's own size.
    pub scene: Scene,
    pub backdrop: Backdrop,
}

/// How an export ended; `false`: it was cancelled.
pub struct Exported {
    pub path: PathBuf,
    pub result: Result<bool>,
}
