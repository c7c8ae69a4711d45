//! Measuring jobs: scene, methods and effort.

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

/// Frames slower than this are timed once, so that one method does not hold up the table.
pub(super) const SLOW_FRAME_MS: f64 = 2000.0;

/// Amounts of measurement: repeats, points, rays, depths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Effort {
    /// Timed runs of each method, after warm-up.
    pub repeats: usize,
    /// Points that the camera sees.
    pub points: usize,
    /// Light rays.
    pub rays: usize,
    /// Depths on each light ray.
    pub depths: usize,
    /// Every texel's light ray, and besides the depths every node on it, instead of so many rays.
    pub check_all: bool,
}

impl Effort {
    /// Valid range of `repeats`.
    pub const REPEATS: RangeInclusive<i64> = 1..=1000;
    /// Valid range of `points`.
    pub const POINTS: RangeInclusive<i64> = 1..=10_000_000;
    /// Valid range of `rays`.
    pub const RAYS: RangeInclusive<i64> = 1..=1_000_000;
    /// Valid range of `depths`.
    pub const DEPTHS: RangeInclusive<i64> = 2..=4000;
}

impl Default for Effort {
    fn default() -> Self {
        Self { repeats: 5, points: 20_000, rays: 2000, depths: 200, check_all: false }
    }
}

/// Volume, transfer function and scene that methods are measured on, with the measuring effort.
pub struct Job<'a> {
    /// The volume and the transfer function on a device.
    pub session: &'a Session,
    /// Volume of the session.
    pub volume: &'a Volume,
    /// Transfer function of the session.
    pub tf: &'a TransferFunction,
    /// Strands that the volume was made from, if any.
    pub strands: Option<&'a Strands>,
    /// Camera, lights, and size of the picture.
    pub scene: &'a Scene,
    /// The column `scene`.
    pub scene_name: String,
    /// Prefix of the names of the scene's files; empty where there is but one scene.
    pub file_prefix: String,
    /// Remark on the timing of rows, for their notes and those of the table; may be empty.
    pub remark: String,
    /// Amounts of measurement.
    pub effort: Effort,
}

impl<'a> Job<'a> {
    /// A job on a volume without strands, in a folder of its own.
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

    /// Directions of the strands, if the shading of the scene uses them.
    ///
    /// # Errors
    /// The host has no memory for it.
    pub(super) fn directions(&self) -> Result<Option<Arc<DirectionMoments>>> {
        let strands = self.session.loaded.strands.as_ref().filter(|_| self.scene.shading.is_of_strands());
        strands.map(|strands| strands.directions()).transpose()
    }

    /// One timed run of a method.
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

/// Method and settings as tables name them.
pub fn name_of(method: &dyn Method) -> String {
    [method.name(), &method.params()].join(" ").trim_end().to_string()
}

/// Text as part of a file name.
pub fn file_name_part(text: &str) -> String {
    let keep = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    text.trim_end().chars().map(keep).collect()
}
