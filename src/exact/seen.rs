//! Points that the camera sees, distributed as it sees them.

use super::ExactField;
use super::picture::first_surface;
use crate::scene::Scene;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// A point of the volume that the camera sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenPoint {
    /// World mm.
    pub position: DVec3,
    /// Share that the point stands for: the opacity of its pixel, in `(0, 1]`.
    pub weight: f64,
}

/// Candidates are given up after this many per point asked for: the camera then sees next to nothing.
const MOST_CANDIDATES_PER_POINT: usize = 64;

impl ExactField<'_> {
    /// `n` points that the camera sees, or fewer where it hardly sees any; the same for the same `seed`.
    ///
    /// Pixels are drawn uniformly over the picture of `scene.width` x `scene.height`, depths along a pixel's ray
    /// with density `T_eye sigma / opacity`, both from one shifted low-discrepancy sequence in three dimensions.
    /// Pixels without opacity are passed over. With weight = opacity, `sum(weight * g) / sum(weight)` therefore
    /// estimates `sum_pixels integral(T_eye sigma g dt) / sum_pixels opacity`: the mean of `g` over the picture,
    /// each point counting as much as it contributes to it.
    pub fn seen_points(&self, scene: &Scene, n: usize, seed: u64) -> Vec<SeenPoint> {
        let shift = [seed, seed ^ 0x5bf0_3635, seed ^ 0xc2b2_ae35].map(unit_hash);
        let mut points = Vec::with_capacity(n);
        for batch in 0..MOST_CANDIDATES_PER_POINT {
            let candidates = (batch * n) as u64..((batch + 1) * n) as u64;
            let seen: Vec<_> = candidates
                .into_par_iter()
                .filter_map(|index| self.seen_point(scene, low_discrepancy(index, shift)))
                .collect();
            points.extend(seen);
            if points.len() >= n {
                break;
            }
        }
        points.truncate(n);
        points
    }

    /// What each pixel of some rows sees, row by row: the point that half of its opacity lies in front of; `None` where
    /// it sees nothing.
    pub fn seen_by_pixels(&self, scene: &Scene, rows: Range<u32>) -> Vec<Option<SeenPoint>> {
        let width = u64::from(scene.width);
        (u64::from(rows.start) * width..u64::from(rows.end) * width)
            .into_par_iter()
            .map(|pixel| self.seen_by_pixel(scene, [pixel % width, pixel / width].map(|n| n as f64), 0.5))
            .collect()
    }

    /// The point for a place `[x, y, quantile]` in the unit cube, if that pixel sees any.
    fn seen_point(&self, scene: &Scene, place: [f64; 3]) -> Option<SeenPoint> {
        let column = (place[0] * f64::from(scene.width)).floor();
        let row = (place[1] * f64::from(scene.height)).floor();
        self.seen_by_pixel(scene, [column, row], place[2])
    }

    fn seen_by_pixel(&self, scene: &Scene, [column, row]: [f64; 2], quantile: f64) -> Option<SeenPoint> {
        let direction = scene.camera.ray_direction(column, row, scene.width, scene.height);
        let eye = scene.camera.eye;
        let length_mm = first_surface(scene, eye, direction).map_or(f64::INFINITY, |hit| hit.depth_mm);
        self.seen_within(eye, direction, length_mm, quantile)
    }

    /// The point along a ray from the eye (world mm, unit direction) that this quantile of the ray's opacity lies in
    /// front of; `None` where there is no opacity.
    pub fn seen_along(&self, eye: DVec3, direction: DVec3, quantile: f64) -> Option<SeenPoint> {
        self.seen_within(eye, direction, f64::INFINITY, quantile)
    }

    /// The same of a ray that ends.
    fn seen_within(&self, eye: DVec3, direction: DVec3, length_mm: f64, quantile: f64) -> Option<SeenPoint> {
        let curve = self.curve_along(eye, direction, length_mm);
        let opacity = -(-curve.total()).exp_m1();
        if opacity <= 0.0 {
            return None;
        }
        // At least half a step of f64 inside.
        let tau = -(-quantile.max(0.5 * f64::EPSILON) * opacity).ln_1p();
        let depth_mm = curve.depth_of_optical_depth(tau.min(curve.total()))?;
        Some(SeenPoint { position: eye + direction * depth_mm, weight: opacity })
    }
}

/// The `index`-th point of the additive recurrence whose steps are powers of the root of `x^4 = x + 1`.
fn low_discrepancy(index: u64, shift: [f64; 3]) -> [f64; 3] {
    const ROOT: f64 = 1.220_744_084_605_759_5;
    let mut step = 1.0;
    shift.map(|s| {
        step /= ROOT;
        (s + step * (index + 1) as f64).fract()
    })
}

/// A number in `[0, 1)` from a seed (the finaliser of SplitMix64).
fn unit_hash(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
