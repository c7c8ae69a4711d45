//! Messages between the viewer window and the render thread.

use super::cached_session::ResidentPages;
use super::reading::OpenedVolume;
use super::shadow_cache::Work;
use crate::error::{Error, Result};
use crate::files::picture::Backdrop;
use crate::measure::error_map::{ErrorMap, ExactView};
use crate::render::{DisplayTexture, Omission};
use crate::scene::{Light, Scene};
use crate::shadow::{Bound, BuildReport, MethodSpec};
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use glam::DVec3;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Settings that determine a rendered picture: transfer function, shadow methods and scene.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSettings {
    pub tf: Arc<TransferFunction>,
    /// Shadow methods of the picture: one, or the left and the right one in a split view.
    pub methods: Vec<MethodSpec>,
    /// Scene to render. Its width and height are the size of the view, pixels.
    pub scene: Scene,
}

/// Request to the render thread for a picture.
#[derive(Debug, Clone)]
pub struct FrameRequest {
    pub settings: FrameSettings,
    /// Time of the user input that led to this request for a picture.
    pub since: Instant,
    /// Index of this request for a picture. Later requests have larger indices.
    pub revision: u64,
}

/// Request to the render thread for something other than the picture, such as a probe or an export. These jobs run in
/// order.
pub enum Job {
    Upload(Box<OpenedVolume>),
    Probe(ProbeRequest),
    Difference(Arc<DifferenceRequest>),
    Thumbnail(Box<ThumbnailRequest>),
    Export(Box<Export>),
}

/// Message from the render thread to the viewer window: a result, progress or an error.
pub enum Event {
    Uploaded(Box<OpenedVolume>),
    Frame(Box<Frame>),
    /// Pages of the volume that are resident while a picture is drawn block by block.
    Pages(ResidentPages),
    /// Message that an edit does not alter the picture, because no voxel has the edited scalar values.
    Unchanged {
        revision: u64,
    },
    Probed(Box<ProbeResult>),
    Differences(Box<Differences>),
    /// Message that another request interrupted the computation of error heat maps against the exact reference
    /// picture.
    DifferenceInterrupted(Arc<DifferenceRequest>),
    Thumbnail(Box<Thumbnail>),
    /// Completed fraction of the running picture export, 0 to 1.
    ExportProgress(f32),
    Exported(Exported),
    /// Note for the user; pictures go on.
    Note(String),
    /// Message that a request to the render thread failed. The picture on screen stays.
    Failed(Error),
}

/// Rendered picture of one shadow method, with its render time and the build report of its shadow map.
#[derive(Debug, Clone)]
pub struct MethodFrame {
    pub texture: Arc<DisplayTexture>,
    /// Shadow method with the settings that rendered this picture. During interaction they are coarser than
    /// requested.
    pub spec: String,
    pub report: BuildReport,
    pub bound: Option<Bound>,
    pub skipped: Vec<Omission>,
    pub frame_ms: f64,
}

/// Rendered picture, or pair of pictures in a split view, with its render times.
#[derive(Debug, Clone)]
pub struct Frame {
    pub main: MethodFrame,
    pub other: Option<MethodFrame>,
    /// Whether the picture has full quality, so that no refinement follows.
    pub is_final: bool,
    /// Whether the picture shows a reduced copy of the volume.
    pub is_reduced: bool,
    pub work: Work,
    /// Time from the user's input to the finished picture, ms.
    pub latency_ms: f64,
    /// Duration of the longest GPU submission while the picture was rendered, ms.
    pub longest_band_ms: f64,
    /// Pages of the volume on the device; `None` if it is one texture.
    pub pages: Option<ResidentPages>,
    /// Index of the request that this picture answers.
    pub revision: u64,
}

impl Frame {
    /// Returns the picture of the shadow method, or the left and the right picture of a split view.
    pub fn sides(&self) -> impl Iterator<Item = &MethodFrame> {
        std::iter::once(&self.main).chain(&self.other)
    }
}

/// Target of a transmittance probe: a ray from the camera, or a point of the volume.
#[derive(Debug, Clone)]
pub enum ProbeTarget {
    /// Ray from the camera, world mm, with a unit direction. The visible point along the ray is probed.
    Ray { origin: DVec3, direction: DVec3 },
    /// World point through whose light ray the transmittance is probed, mm.
    Point(DVec3),
}

/// Request for a probe: transmittance curves of several shadow methods along the light ray through one point.
#[derive(Debug, Clone)]
pub struct ProbeRequest {
    pub target: ProbeTarget,
    pub tf: Arc<TransferFunction>,
    pub light: Light,
    pub ambient: f64,
    pub methods: Vec<MethodSpec>,
}

/// Transmittance by one shadow method against depth along the light ray through the probed point.
#[derive(Debug, Clone)]
pub struct MethodCurve {
    pub spec: String,
    /// Samples of the shadow method's transmittance curve: depth along the light ray in mm, and transmittance.
    pub points: Vec<[f64; 2]>,
    /// Transmittance from the light to the probed point, by this shadow method.
    pub at_point: f64,
    /// Error bound of the shadow method's transmittance near the probed point; `None` if the method has no bound.
    pub bound: Option<ProbedBound>,
}

/// Error bound of a shadow method, and the result of its test on the light ray nearest to the probed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbedBound {
    pub bound: Bound,
    /// Result of testing the error bound on the light ray through the texel centre nearest to the probed point.
    /// `None` if no texel of the shadow map covers the point.
    pub nearest: Option<NearestRay>,
}

/// Result of testing a shadow method's error bound on the light ray through the texel centre nearest to the probed
/// point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestRay {
    /// Distance from the probed point to the tested light ray, in texel widths.
    pub texels_away: f64,
    /// Largest difference between the shadow method's transmittance and the exact one along the tested light ray.
    pub largest: f64,
    /// Whether the shadow method's error bound is satisfied at every tested depth of the light ray.
    pub satisfied: bool,
}

/// Result of a probe: transmittance against depth along the light ray through a point, exact and by each shadow
/// method.
#[derive(Debug, Clone)]
pub struct ProbeResult {
    /// Point at which the user probes the transmittance, world mm.
    pub point: DVec3,
    /// Scalar value of the volume at the probed point.
    pub value: f64,
    /// Depth of the probed point along its light ray, mm. Depth is zero where the ray enters the volume, or at a
    /// point light inside it.
    pub depth_mm: f64,
    /// Samples of the exact transmittance curve: depth along the light ray in mm, and transmittance.
    pub exact: Vec<[f64; 2]>,
    pub exact_at_point: f64,
    pub methods: Vec<MethodCurve>,
}

/// Request for error heat maps, which compare shadow methods with an exact reference picture.
#[derive(Debug, Clone)]
pub struct DifferenceRequest {
    pub view: Arc<ExactView>,
    pub tf: Arc<TransferFunction>,
    pub methods: Vec<MethodSpec>,
    pub logarithmic: bool,
}

/// Heat map of one shadow method's error against the exact reference picture.
pub struct DifferenceSide {
    pub spec: String,
    pub map: ErrorMap,
    pub texture: Arc<DisplayTexture>,
}

/// Error heat maps of the shadow methods in the view, all on the same colour scale.
pub struct Differences {
    pub request: Arc<DifferenceRequest>,
    /// Error heat maps of the shadow methods: one, or the left and the right one in a split view.
    pub sides: Vec<DifferenceSide>,
    /// Error at the lower end of the heat maps' colour scale.
    pub least: f32,
    pub largest: f32,
}

/// Request for the thumbnail of a transfer-function preset.
#[derive(Debug, Clone)]
pub struct ThumbnailRequest {
    /// Index of the transfer-function preset in [`crate::transfer::presets::PRESETS`].
    pub index: usize,
    pub tf: TransferFunction,
    pub scene: Scene,
    pub volume: Arc<Volume>,
}

/// Rendered thumbnail of a transfer-function preset.
pub struct Thumbnail {
    pub index: usize,
    pub scene: Scene,
    pub volume: Arc<Volume>,
    pub texture: Arc<DisplayTexture>,
}

/// Request to render a picture and write it to a file.
#[derive(Debug, Clone)]
pub struct Export {
    pub path: PathBuf,
    pub tf: Arc<TransferFunction>,
    pub method: MethodSpec,
    /// Scene to export. Its width and height are the size of the picture file, pixels.
    pub scene: Scene,
    pub backdrop: Backdrop,
    /// Set by the window to end this export, also before it starts.
    pub cancelled: Arc<AtomicBool>,
}

/// Result of a picture export; `false` if the export was cancelled.
pub struct Exported {
    pub path: PathBuf,
    pub result: Result<bool>,
}
