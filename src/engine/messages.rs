//! Messages between the window and the render thread.

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
use std::time::Instant;

/// Everything that determines a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSettings {
    pub tf: Arc<TransferFunction>,
    /// The method, and in a split view the second one.
    pub methods: Vec<MethodSpec>,
    /// Scene; its width and height are the view's, in pixels.
    pub scene: Scene,
}

/// Request for a picture.
#[derive(Debug, Clone)]
pub struct FrameRequest {
    pub settings: FrameSettings,
    /// Time of the input that caused the request.
    pub since: Instant,
    /// Number of the request; later requests have larger ones.
    pub revision: u64,
}

/// Request other than a picture. Jobs run in order.
pub enum Job {
    Upload(Box<OpenedVolume>),
    Probe(ProbeRequest),
    Difference(Arc<DifferenceRequest>),
    Thumbnail(Box<ThumbnailRequest>),
    Export(Box<Export>),
}

/// Message from the render thread.
pub enum Event {
    Uploaded(Box<OpenedVolume>),
    Frame(Box<Frame>),
    /// The change does not alter the picture: no voxel has the values concerned.
    Unchanged {
        revision: u64,
    },
    Probed(Box<ProbeResult>),
    Differences(Box<Differences>),
    /// Another request interrupted the comparison.
    DifferenceInterrupted(Arc<DifferenceRequest>),
    Thumbnail(Box<Thumbnail>),
    /// Fraction of the export that is done.
    ExportProgress(f32),
    Exported(Exported),
    /// A request failed; the picture on screen stays.
    Failed(Error),
}

/// Picture of one method.
#[derive(Debug, Clone)]
pub struct MethodFrame {
    pub texture: Arc<DisplayTexture>,
    /// The method as drawn; coarser than the requested one during interaction.
    pub spec: String,
    pub report: BuildReport,
    pub bound: Option<Bound>,
    pub skipped: Vec<Omission>,
    pub frame_ms: f64,
}

/// Finished picture, or pair of pictures in a split view.
#[derive(Debug, Clone)]
pub struct Frame {
    pub main: MethodFrame,
    pub other: Option<MethodFrame>,
    /// Full quality: no refinement follows.
    pub is_final: bool,
    pub work: Work,
    /// Time from the input to the finished picture, ms.
    pub latency_ms: f64,
    /// Duration of the longest submission, ms.
    pub longest_band_ms: f64,
    /// Number of the request.
    pub revision: u64,
}

impl Frame {
    /// Pictures from left to right.
    pub fn sides(&self) -> impl Iterator<Item = &MethodFrame> {
        std::iter::once(&self.main).chain(&self.other)
    }
}

/// Target of a probe.
#[derive(Debug, Clone)]
pub enum ProbeTarget {
    /// Point visible along a ray from the eye, unit direction.
    Ray { origin: DVec3, direction: DVec3 },
    /// Point, world mm.
    Point(DVec3),
}

/// Request for the transmittance curves through one point.
#[derive(Debug, Clone)]
pub struct ProbeRequest {
    pub target: ProbeTarget,
    pub tf: Arc<TransferFunction>,
    pub light: Light,
    pub ambient: f64,
    pub methods: Vec<MethodSpec>,
}

/// Transmittance curve of a method along the light ray.
#[derive(Debug, Clone)]
pub struct MethodCurve {
    pub spec: String,
    /// Depth in mm and transmittance.
    pub points: Vec<[f64; 2]>,
    /// Transmittance at the point itself.
    pub at_point: f64,
    /// Error bound, where the method has one.
    pub bound: Option<ProbedBound>,
}

/// Error bound, tested on one light ray near a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbedBound {
    pub bound: Bound,
    /// Light ray through the nearest texel centre; `None` where the map has no texel.
    pub nearest: Option<NearestRay>,
}

/// Test of an error bound on the light ray through the texel centre nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestRay {
    /// Distance from the point, in texel widths.
    pub texels_away: f64,
    /// Largest difference from the exact transmittance along the ray.
    pub largest: f64,
    /// Whether the bound is satisfied at every tested depth.
    pub satisfied: bool,
}

/// Transmittance against depth along the light ray through a point.
#[derive(Debug, Clone)]
pub struct ProbeResult {
    /// World mm.
    pub point: DVec3,
    /// Scalar value at the point.
    pub value: f64,
    /// Depth of the point along its light ray, mm. Zero is where the ray enters the volume, or the point light.
    pub depth_mm: f64,
    /// Depth in mm and exact transmittance.
    pub exact: Vec<[f64; 2]>,
    pub exact_at_point: f64,
    pub methods: Vec<MethodCurve>,
}

/// Request to compare methods with an exact picture.
#[derive(Debug, Clone)]
pub struct DifferenceRequest {
    pub view: Arc<ExactView>,
    pub tf: Arc<TransferFunction>,
    pub methods: Vec<MethodSpec>,
    pub logarithmic: bool,
}

/// Heat map of one method.
pub struct DifferenceSide {
    pub spec: String,
    pub map: ErrorMap,
    pub texture: Arc<DisplayTexture>,
}

/// Heat maps of the methods in the view, on one scale.
pub struct Differences {
    pub request: Arc<DifferenceRequest>,
    /// Heat maps from left to right.
    pub sides: Vec<DifferenceSide>,
    /// Errors at the two ends of the scale.
    pub least: f32,
    pub largest: f32,
}

/// Request for the thumbnail of a preset.
#[derive(Debug, Clone)]
pub struct ThumbnailRequest {
    /// Index into [`crate::transfer::presets::PRESETS`].
    pub index: usize,
    pub tf: TransferFunction,
    pub scene: Scene,
    pub volume: Arc<Volume>,
}

/// Thumbnail of a preset.
pub struct Thumbnail {
    pub index: usize,
    pub scene: Scene,
    pub volume: Arc<Volume>,
    pub texture: Arc<DisplayTexture>,
}

/// Request to write a picture file.
#[derive(Debug, Clone)]
pub struct Export {
    pub path: PathBuf,
    pub tf: Arc<TransferFunction>,
    pub method: MethodSpec,
    /// Scene with the size of the exported picture.
    pub scene: Scene,
    pub backdrop: Backdrop,
}

/// Result of an export; `false` where it was cancelled.
pub struct Exported {
    pub path: PathBuf,
    pub result: Result<bool>,
}
