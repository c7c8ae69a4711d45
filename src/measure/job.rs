//! Measuring jobs: the volume, transfer function, scene and measuring effort for a comparison of shadow methods.

use super::timing::StageTimes;
use crate::error::Result;
use crate::render::Session;
use crate::scene::Scene;
use crate::shadow::{BuildReport, Method};
use crate::strands::Strands;
use crate::transfer::TransferFunction;
use crate::volume::{DirectionMoments, Volume};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Instant;

/// Frame time above which a method is timed only once, ms, so that one slow method does not delay the whole
/// comparison.
pub(super) const SLOW_FRAME_MS: f64 = 2000.0;

/// Measuring effort: numbers of timed repeats, visible points, light rays and depths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Effort {
    /// Number of timed runs of each method, after warm-up.
    pub repeats: usize,
    /// Number of visible points at which transmittance errors are measured.
    pub points: usize,
    /// Number of light rays along which the error bound is tested.
    pub rays: usize,
    /// Number of depths tested on each light ray.
    pub depths: usize,
    /// Tests the light rays of all shadow map texels, instead of `rays` of them, and also the depths of all curve
    /// nodes.
    pub check_all: bool,
}

impl Effort {
    /// Valid range of `repeats`, the number of timed runs of each method.
    pub const REPEATS: RangeInclusive<i64> = 1..=1000;
    /// Valid range of `points`, the number of visible points for transmittance errors.
    pub const POINTS: RangeInclusive<i64> = 1..=10_000_000;
    /// Valid range of `rays`, the number of tested light rays.
    pub const RAYS: RangeInclusive<i64> = 1..=1_000_000;
    /// Valid range of `depths`, the number of depths tested on each light ray.
    pub const DEPTHS: RangeInclusive<i64> = 2..=4000;
}

impl Default for Effort {
    fn default() -> Self {
        Self { repeats: 5, points: 20_000, rays: 2000, depths: 200, check_all: false }
    }
}

/// Measuring job: the volume, transfer function and scene on which shadow methods are measured, and the measuring
/// effort.
pub struct Job<'a> {
    /// Rendering session with the volume and the transfer function on the device.
    pub session: &'a Session,
    /// Volume that the rendering session has loaded.
    pub volume: &'a Volume,
    /// Transfer function that the rendering session uses.
    pub tf: &'a TransferFunction,
    /// Strands (hair or fibres) that the volume was voxelised from, if any.
    pub strands: Option<&'a Strands>,
    /// Scene to measure: camera, lights and picture size.
    pub scene: &'a Scene,
    /// Name of the scene, which becomes the table column `scene`.
    pub scene_name: String,
    /// Prefix of the names of files for this scene. Empty where the comparison has only one scene.
    pub file_prefix: String,
    /// Remark on the timing conditions, added to the notes of table rows and of the table. May be empty.
    pub remark: String,
    /// Measuring effort: numbers of timed repeats, visible points, light rays and depths.
    pub effort: Effort,
}

impl<'a> Job<'a> {
    /// Creates a measuring job for a volume without strands, without a file prefix or remark.
    pub fn new(
        session: &'a Session,
        (volume, tf): (&'a Volume, &'a TransferFunction),
        scene: &'a Scene,
        scene_name: &str,
        effort: Effort,
    ) -> Self {
        let [file_prefix, remark] = [const { String::new() }; 2];
        let scene_name = scene_name.into();
        Self { session, volume, tf, strands: None, scene, scene_name, file_prefix, remark, effort }
    }

    /// Returns the directions of the strands, if the shading of the scene uses them.
    ///
    /// # Errors
    /// The host is out of memory.
    pub(super) fn directions(&self) -> Result<Option<Arc<DirectionMoments>>> {
        let strands = self.session.loaded.strands.as_ref().filter(|_| self.scene.shading.is_of_strands());
        strands.map(|strands| strands.directions()).transpose()
    }

    /// Builds a method's shadow maps and renders one picture, and returns the times.
    pub fn timed(&self, method: &dyn Method) -> Result<StageTimes> {
        let start = Instant::now();
        let shadows = self.session.shadows_of(method, self.scene)?;
        let build_wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let frame = self.session.render(&shadows, self.scene)?.span;
        let report = BuildReport::of_all(&shadows);
        let (build_host_ms, build_device) = (report.host_ms, report.device);
        Ok(StageTimes { tables_ms: None, build_host_ms, build_device, build_wall_ms, frame })
    }
}

/// Returns the name of a method with its settings, as tables show it.
pub fn name_of(method: &dyn Method) -> String {
    [method.name(), &method.params()].join(" ").trim_end().to_string()
}

/// Converts a text to a part of a file name. Characters other than ASCII letters, digits and dots become hyphens.
pub fn file_name_part(text: &str) -> String {
    let keep = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    text.trim_end().chars().map(keep).collect()
}
