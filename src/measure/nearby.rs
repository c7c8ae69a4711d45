//! Curves of the rays and values that float32 cannot tell from the exact ones (`docs/bound.md`).

use super::band::Neighbourhood;
use crate::exact::{ExactField, OpticalDepthCurve};
use crate::shadow::Bound;
use crate::transfer::TransferFunction;
use glam::DVec3;
use std::sync::OnceLock;

/// Rays around one, besides itself.
const AROUND: usize = 8;
/// Shares of the lateral tolerance at which they lie.
const RINGS: [f64; 2] = [0.5, 1.0];
/// Depths, besides those asked for and where curves bend, at which curves may change places.
const REGULAR_DEPTHS: usize = 256;

/// The exact field with the tolerances of a promise.
pub(super) struct Nearby<'a> {
    field: &'a ExactField<'a>,
    bound: Bound,
    /// Functions moved by the value tolerance to both sides.
    moved: OnceLock<[TransferFunction; 2]>,
}

/// A function of values that are all larger by `by`.
fn moved(tf: &TransferFunction, by: f64) -> TransferFunction {
    tf.scale_values(|value| value - by)
}

impl<'a> Nearby<'a> {
    pub fn new(field: &'a ExactField<'a>, bound: Bound) -> Self {
        Self { field, bound, moved: OnceLock::new() }
    }

    /// Surroundings of the ray from `origin` (world mm, at depth `start_mm`), known at the given depths at least;
    /// `None` where the promise has no such tolerance.
    pub fn of_ray(
        &self,
        origin: DVec3,
        direction: DVec3,
        start_mm: f64,
        known_mm: &[f64],
    ) -> Option<Neighbourhood> {
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
        depths.sort_by(f64::total_cmp);
        depths.dedup();
        let along: Vec<_> =
            curves.iter().map(|curve| move |z: f64| curve.optical_depth_at(z - start_mm)).collect();
        Some(Neighbourhood::of(&along, depths))
    }
}
