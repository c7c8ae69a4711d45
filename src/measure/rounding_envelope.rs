//! Rounding envelope of a light ray: bounds on its transmittance over all rays and volume values that float32 cannot
//! distinguish from the exact ones (`docs/bound.md`).

use super::test_depths::sort_distinct;
use crate::exact::{ExactField, OpticalDepthCurve};
use crate::shadow::Bound;
use crate::transfer::TransferFunction;
use glam::DVec3;
use std::sync::OnceLock;

/// Number of neighbouring rays on each ring around a light ray, from which its rounding envelope is computed.
const AROUND: usize = 8;
/// Radii of the rings of neighbouring rays around a light ray, as fractions of the error bound's lateral tolerance.
const RINGS: [f64; 2] = [0.5, 1.0];
/// Number of evenly spaced depths on a light ray at which the rounding envelope is computed, besides the requested
/// depths and the jumps of extinction.
const REGULAR_DEPTHS: usize = 256;

/// Rounding envelope of transmittance along a light ray. It contains every curve whose slope at each depth lies
/// between those of the curves that float32 cannot distinguish from the exact one. For a pre-filtered shadow map it
/// is the mean of the envelopes of the averaged rays.
#[derive(Debug, Clone)]
pub struct RoundingEnvelope(Vec<Envelope>);

/// Smallest and largest transmittance of the rounding envelope at each depth of a light ray (mm, ascending).
#[derive(Debug, Clone)]
struct Envelope {
    depths_mm: Vec<f64>,
    range: Vec<[f64; 2]>,
}

impl RoundingEnvelope {
    /// Computes the rounding envelope of several optical depth curves of one light ray. A curve inside the envelope
    /// may switch from one of them to another at each of `depths_mm` (ascending).
    pub fn of(optical_depths: &[impl Fn(f64) -> f64], depths_mm: Vec<f64>) -> Self {
        let mut range = Vec::with_capacity(depths_mm.len());
        let mut before: Vec<f64> = vec![0.0; optical_depths.len()];
        let [mut least, mut most] = [0.0, 0.0];
        for &z in &depths_mm {
            let here: Vec<f64> = optical_depths.iter().map(|curve| curve(z)).collect();
            let steps = || here.iter().zip(&before).map(|(b, a)| (b - a).max(0.0));
            least += steps().fold(f64::INFINITY, f64::min);
            most += steps().fold(0.0, f64::max);
            range.push([(-most).exp(), (-least).exp()]);
            before = here;
        }
        Self(vec![Envelope { depths_mm, range }])
    }

    /// Returns the mean of several rounding envelopes, for a pre-filtered shadow map texel that averages several
    /// light rays.
    pub fn mean(all: Vec<Self>) -> Self {
        Self(all.into_iter().flat_map(|n| n.0).collect())
    }

    fn mean_of(&self, of: impl Fn(&Envelope) -> f64) -> f64 {
        self.0.iter().map(of).sum::<f64>() / self.0.len().max(1) as f64
    }

    /// Smallest transmittance in the rounding envelope at depth `z` (mm). It is the value at the next stored depth.
    pub fn least(&self, z: f64) -> f64 {
        self.mean_of(|e| {
            let i = e.depths_mm.partition_point(|d| *d < z);
            e.range.get(i).or(e.range.last()).map_or(0.0, |r| r[0])
        })
    }

    /// Largest transmittance in the rounding envelope at depth `z` (mm). It is the value at the previous stored
    /// depth.
    pub fn most(&self, z: f64) -> f64 {
        self.mean_of(|e| {
            let i = e.depths_mm.partition_point(|d| *d <= z);
            i.checked_sub(1).map_or(1.0, |i| e.range[i][1])
        })
    }
}

/// Exact extinction field of a volume, together with a method's error bound, for computing rounding envelopes of
/// light rays.
pub(super) struct NearbyRays<'a> {
    field: &'a ExactField<'a>,
    bound: Bound,
    /// Transfer functions with their scalar values shifted up and down by the error bound's tolerance in the volume's
    /// values.
    moved: OnceLock<[TransferFunction; 2]>,
}

/// Returns the transfer function shifted along the axis of scalar values: it maps `v` as `tf` maps `v + by`.
fn moved(tf: &TransferFunction, by: f64) -> TransferFunction {
    tf.scale_values(|value| value - by)
}

impl<'a> NearbyRays<'a> {
    pub fn new(field: &'a ExactField<'a>, bound: Bound) -> Self {
        Self { field, bound, moved: OnceLock::new() }
    }

    /// Returns the rounding envelope of transmittance around the light ray from `origin` (world mm, at depth
    /// `start_mm`), with values at least at the depths `known_mm`. Returns `None` where the error bound has neither a
    /// lateral nor a value tolerance.
    pub fn envelope(
        &self,
        origin: DVec3,
        direction: DVec3,
        start_mm: f64,
        known_mm: &[f64],
    ) -> Option<RoundingEnvelope> {
        let Bound { lateral_mm, value, .. } = self.bound;
        if lateral_mm <= 0.0 && value <= 0.0 {
            return None;
        }
        let tf = self.field.transfer_function();
        let moved = self.moved.get_or_init(|| [moved(tf, -value), moved(tf, value)]);
        let fields = moved.each_ref().map(|tf| ExactField::new(self.field.volume(), tf));
        let side = direction.any_orthonormal_vector();
        let up = direction.cross(side);
        let turns = (0..AROUND).map(|i| i as f64 / AROUND as f64 * std::f64::consts::TAU);
        let ring =
            |share: f64| turns.clone().map(move |t| share * lateral_mm * (t.cos() * side + t.sin() * up));
        let offsets: Vec<DVec3> =
            std::iter::once(DVec3::ZERO).chain(RINGS.into_iter().flat_map(ring)).collect();
        let curves: Vec<OpticalDepthCurve<'_>> = [self.field, &fields[0], &fields[1]]
            .into_iter()
            .flat_map(|field| {
                offsets.iter().map(move |o| field.curve_along(origin + *o, direction, f64::INFINITY))
            })
            .collect();
        let mut depths: Vec<f64> = known_mm.to_vec();
        depths.extend(curves.iter().flat_map(OpticalDepthCurve::jumps).map(|z| z + start_mm));
        let (first, last) = depths.iter().fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(*z), b.max(*z)));
        depths.extend((0..REGULAR_DEPTHS).map(|i| first + (last - first) * i as f64 / REGULAR_DEPTHS as f64));
        sort_distinct(&mut depths);
        let along: Vec<_> =
            curves.iter().map(|curve| move |z: f64| curve.optical_depth_at(z - start_mm)).collect();
        Some(RoundingEnvelope::of(&along, depths))
    }
}
