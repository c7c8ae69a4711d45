//! Errors of transmittance against the strands (hair or fibres) as cylinders, for a volume that was voxelised from
//! strands.
//!
//! All other errors are measured against the voxel field. The field is only a substitute: its blur and the overlap of
//! strands in bundles are errors too. Here, the true transmittance at a visible point is the mean over a light beam
//! through the cylinders, as wide as a voxel ([`cylinders`](super::cylinders)).

use super::cylinders::beam_halves;
use super::errors::{VisiblePoints, VisiblePointsByLight};
use super::job::Job;
use super::stats::ErrorStats;
use crate::error::Result;
use crate::render::Session;
use crate::scene::Light;
use crate::shadow::ShadowMap;
use crate::strands::Strands;

/// Maximum number of points visible to the camera at which transmittance is compared with the strands. Each point
/// needs a light beam of 256 rays.
const MOST_BEAMS: usize = 4000;

/// Transmittance from the light through the strands as cylinders, at some of the points visible to the camera.
pub struct StrandReference {
    /// Points visible to the camera, with the transmittance from the light through the strands as cylinders.
    truth: VisiblePoints,
    /// Rms error of the exact transmittance through the voxel volume, against that through the strands as cylinders.
    field_rms: f64,
    sampling_rms: f64,
}

impl StrandReference {
    /// Computes the transmittance through the strands as cylinders at some of the points visible to the camera, for a
    /// volume voxelised from them.
    ///
    /// # Errors
    /// The transmittance through strands is not defined for this scene; the error is the reason, in words.
    pub fn new(strands: &Strands, job: &Job, visible: &VisiblePointsByLight) -> Result<Self, &'static str> {
        let [visible] = visible.parts() else {
            return Err("beams are of one light, and there are several");
        };
        if job.scene.has_soft_light() {
            return Err("beams are parallel, and the light has a size");
        }
        let Light::Directional { toward } = job.scene.light() else {
            return Err("beams are parallel, and the light is at a point");
        };
        if !job.tf.leaves_extinction(job.volume.value_range()[1]) {
            return Err("the transfer function does not take the strands' extinction as it is");
        }
        let points = visible.first(MOST_BEAMS);
        let halves = beam_halves(strands, points.points_mm(), toward, job.volume.min_spacing_mm());
        let truth = points.with_exact(halves.iter().map(|[a, b]| 0.5 * (a + b)).collect());
        let rms = |errors: &mut dyn Iterator<Item = f64>| {
            let stats = ErrorStats::of(errors.zip(truth.weights().iter().copied()));
            stats.ok().flatten().map(|s| s.rms).ok_or("the camera sees nothing")
        };
        let field_rms =
            rms(&mut points.exact().iter().zip(truth.exact()).map(|(field, truth)| field - truth))?;
        let sampling_rms = rms(&mut halves.iter().map(|[a, b]| 0.5 * (a - b)))?;
        Ok(Self { truth, field_rms, sampling_rms })
    }

    /// Root mean square of the transmittance error `T_method - T_strands` at visible points, weighted by visibility.
    ///
    /// # Errors
    /// The device is lost.
    pub fn rms(&self, session: &Session, shadow: &ShadowMap) -> Result<Option<f64>> {
        Ok(self.truth.errors(session, std::slice::from_ref(shadow))?.map(|stats| stats.rms))
    }

    /// Returns a note for the reader of the comparison table: the transmittance error of the voxel volume itself
    /// against the strands.
    pub fn note(&self) -> String {
        format!(
            "strand_err_rms is of {} points that the camera sees, against beams through the strands; the voxel field itself \
            is off by {:.4} there (the number of rays explains up to {:.4})",
            self.truth.len(),
            self.field_rms,
            self.sampling_rms
        )
    }
}
