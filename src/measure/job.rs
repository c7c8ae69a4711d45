//! Measuring jobs: volume, transfer function and scene for a comparison of shadow methods, and numbers of repeats,
//! points and rays.

use super::timing::StageTimes;
use crate::error::Result;
use crate::gpu::{ClockRate, Filler};
use crate::render::Session;
use crate::scene::Scene;
use crate::shadow::{BuildReport, Method};
use crate::strands::Strands;
use crate::transfer::TransferFunction;
use crate::volume::{DirectionMoments, Volume};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Frame time above which a shadow method is timed only once, ms. One slow method thus does not delay the whole
/// comparison.
pub(super) const SLOW_FRAME_MS: f64 = 2000.0;

/// Time of build and frame together below which they count as short, ms: 20 runs of a method take a second at most.
pub(super) const SHORT_MS: f64 = 50.0;

/// Extent of a measurement: numbers of timed repeats, visible points, light rays and depths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Effort {
    /// Number of timed runs of each shadow method, after warm-up.
    pub repeats: usize,
    /// Number of timed runs of a shadow method whose build and frame together are short, if larger than `repeats`.
    #[serde(default)]
    pub short_repeats: usize,
    /// Number of points visible to the camera at which transmittance errors are measured.
    pub points: usize,
    /// Number of light rays along which each shadow method's error bound is tested.
    pub rays: usize,
    /// Number of depths on each light ray at which a shadow method's transmittance is tested.
    pub depths: usize,
    /// Extent of the test of error bounds.
    pub check: Checked,
    /// Number of steps of the light, and of the camera, over which flicker is measured; 0: it is not measured.
    #[serde(default)]
    pub flicker: usize,
}

/// Extent of the test of error bounds: light rays of texels, and points between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Checked {
    /// Tests as many light rays as `--rays`, and points in a twentieth as many cells between texels.
    #[default]
    Sample,
    /// Tests the light ray of every shadow map texel, also at the depths of all curve nodes, and points as `sample`.
    All,
    /// Tests a million points between the light rays of texels, and light rays as `sample`.
    Points,
}

impl Checked {
    /// Returns the extent as `--check` takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::All => "all",
            Self::Points => "points",
        }
    }
}

impl Effort {
    /// Valid range of `repeats`, the number of timed runs of each method.
    pub const REPEATS: RangeInclusive<i64> = 1..=1000;
    /// Valid range of `points`, the number of visible points at which transmittance errors are measured.
    pub const POINTS: RangeInclusive<i64> = 1..=10_000_000;
    /// Valid range of `rays`, the number of light rays along which transmittance is tested.
    pub const RAYS: RangeInclusive<i64> = 1..=1_000_000;
    /// Valid range of `depths`, the number of depths on each light ray at which transmittance is tested.
    pub const DEPTHS: RangeInclusive<i64> = 2..=4000;
    /// Valid range of `flicker`, the number of steps of the light over which flicker is measured.
    pub const FLICKER: RangeInclusive<i64> = 2..=1000;
}

impl Default for Effort {
    fn default() -> Self {
        Self {
            repeats: 6,
            short_repeats: 20,
            points: 20_000,
            rays: 2000,
            depths: 200,
            check: Checked::Sample,
            flicker: 0,
        }
    }
}

/// Measuring job: volume, transfer function and scene on which shadow methods are measured, and numbers of repeats,
/// points, rays and depths.
pub struct Job<'a> {
    /// Rendering session that keeps the volume and the transfer function on the graphics device.
    pub session: &'a Session,
    /// Volume on which shadow methods are measured; the rendering session has loaded it.
    pub volume: &'a Volume,
    /// Transfer function with which shadow methods are measured; the rendering session uses it.
    pub tf: &'a TransferFunction,
    /// Strands (hair or fibres) that the volume was voxelised from, if any.
    pub strands: Option<&'a Strands>,
    /// Scene on which shadow methods are measured: camera, lights and picture size.
    pub scene: &'a Scene,
    /// Name of the scene on which shadow methods are measured, for the comparison table column `scene`.
    pub scene_name: String,
    /// Scene name that starts the file names of this scene's pictures. Empty where the comparison has only one scene.
    pub file_prefix: String,
    /// Remark on conditions that affect the measured times, added to the notes of the comparison table and its rows.
    /// May be empty.
    pub remark: String,
    /// Extent of the measurement: numbers of timed repeats, visible points, light rays and depths.
    pub effort: Effort,
    /// Pass that keeps a graphics card busy between timed runs, compiled at first use.
    pub(crate) filler: OnceLock<Filler>,
}

impl<'a> Job<'a> {
    /// Creates a measuring job for a volume without strands, with an empty file name prefix and an empty remark.
    pub fn new(
        session: &'a Session,
        (volume, tf): (&'a Volume, &'a TransferFunction),
        scene: &'a Scene,
        scene_name: &str,
        effort: Effort,
    ) -> Self {
        let [file_prefix, remark] = [const { String::new() }; 2];
        let scene_name = scene_name.into();
        Self {
            session,
            volume,
            tf,
            strands: None,
            scene,
            scene_name,
            file_prefix,
            remark,
            effort,
            filler: OnceLock::new(),
        }
    }

    /// Returns the directions of the strands (hair or fibres), if the shading of the scene uses them.
    ///
    /// # Errors
    /// The host is out of memory.
    pub(super) fn directions(&self) -> Result<Option<Arc<DirectionMoments>>> {
        let strands = self.session.loaded.strands.as_ref().filter(|_| self.scene.shading.is_of_strands());
        strands.map(|strands| strands.directions()).transpose()
    }

    /// Builds the shadow maps of a shadow method, renders one picture with them, and returns the times of both.
    pub fn timed(&self, method: &dyn Method) -> Result<StageTimes> {
        self.timed_in(method, self.scene)
    }

    /// Does the same as [`Self::timed`] in another scene of the same volume and transfer function.
    pub fn timed_in(&self, method: &dyn Method, scene: &Scene) -> Result<StageTimes> {
        let start = Instant::now();
        let shadows = self.session.shadows_of(method, scene)?;
        let build_wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let picture = self.session.render(&shadows, scene)?;
        let (frame, frame_host_ms) = (picture.span, picture.host_ms);
        let report = BuildReport::of_all(&shadows);
        let (build_host_ms, build_device) = (report.host_ms, report.device);
        Ok(StageTimes {
            tables_ms: None,
            build_host_ms,
            build_device,
            build_wall_ms,
            frame,
            frame_host_ms,
            gpu_mhz: None,
            unsteady: false,
        })
    }

    /// Keeps a graphics card busy for a moment, and returns its clock rate meanwhile, MHz: `None` where the system reports
    /// none. On adapters without timestamps it only reads the rate.
    ///
    /// # Errors
    /// The device is lost.
    pub fn keep_busy(&self) -> Result<Option<f64>> {
        let gpu = self.session.renderer.gpu();
        let read = || gpu.clock_rate.as_ref().and_then(ClockRate::read_mhz);
        if gpu.timestamp_period_ns.is_none() {
            return Ok(read());
        }
        self.filler.get_or_init(|| Filler::new(gpu)).keep_busy(gpu, read)
    }
}

/// Returns the name of a shadow method with its settings, as tables show it.
pub fn name_of(method: &dyn Method) -> String {
    [method.name(), &method.params()].join(" ").trim_end().to_string()
}

/// Converts a text to a part of a file name. Characters other than ASCII letters, digits and dots become hyphens.
pub fn file_name_part(text: &str) -> String {
    let keep = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    text.trim_end().chars().map(keep).collect()
}
