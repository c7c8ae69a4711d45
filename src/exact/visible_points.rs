//! Random points in the volume that the camera sees, distributed by their contribution to the picture.

use super::ExactField;
use super::picture::first_surface;
use crate::random::{Chance, low_discrepancy, mix_to_unit};
use crate::scene::Scene;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Random point in the volume that the camera sees, with its weight in statistics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisiblePoint {
    /// Position of a random point in the volume that the camera sees, world mm.
    pub position: DVec3,
    /// Weight of a visible sample point in statistics: the opacity of its pixel, in `(0, 1]`.
    pub weight: f64,
}

/// Largest number of pixels that are tried for each requested visible sample point. More would be needed only where
/// the camera sees next to nothing.
const MOST_CANDIDATES_PER_POINT: usize = 64;

impl ExactField<'_> {
    /// Samples `n` points of the volume that the camera sees, or fewer where it sees hardly any. The same `seed`
    /// gives the same points.
    ///
    /// Pixels are drawn uniformly over the picture of `scene.width` x `scene.height`, depths along a pixel's ray
    /// with density `T_eye sigma / opacity`, both from one shifted low-discrepancy sequence in three dimensions.
    /// Pixels without opacity are skipped. With weight = opacity, `sum(weight * g) / sum(weight)` therefore
    /// estimates `sum_pixels integral(T_eye sigma g dt) / sum_pixels opacity`: the mean of `g` over the picture,
    /// weighted by the contribution of each point.
    pub fn visible_points(&self, scene: &Scene, n: usize, seed: u64) -> Vec<VisiblePoint> {
        let shift = [seed, seed ^ 0x5bf0_3635, seed ^ 0xc2b2_ae35].map(mix_to_unit);
        let mut points = Vec::with_capacity(n);
        for batch in 0..MOST_CANDIDATES_PER_POINT {
            let drawn = |number: usize| low_discrepancy((batch * n + number) as u64, shift);
            points.extend(self.points_of_draws(scene, n, drawn).into_iter().flatten());
            if points.len() >= n {
                break;
            }
        }
        points.truncate(n);
        points
    }

    /// Draws `n` pixels of the picture of `scene` at random, and a point behind each with density
    /// `T_eye sigma / opacity`. All draws are independent (pseudo-random); the same `seed` gives the same points. It is
    /// `None` for pixels without opacity.
    pub fn random_visible_points(&self, scene: &Scene, n: usize, seed: u64) -> Vec<Option<VisiblePoint>> {
        let drawn = |number: usize| {
            let mut chance = Chance::new(seed, number as u64);
            [(); 3].map(|()| chance.unit())
        };
        self.points_of_draws(scene, n, drawn)
    }

    /// Returns the visible points of random numbers in `[0, 1)`: the place in the picture, and the fraction of the pixel's
    /// opacity that lies in front.
    fn points_of_draws(
        &self,
        scene: &Scene,
        n: usize,
        drawn: impl Fn(usize) -> [f64; 3] + Sync,
    ) -> Vec<Option<VisiblePoint>> {
        let pixel = |number: usize| {
            let [x, y, quantile] = drawn(number);
            ([x * f64::from(scene.width), y * f64::from(scene.height)].map(f64::floor), quantile)
        };
        let ray = |number: usize| {
            let [column, row] = pixel(number).0;
            let direction = scene.camera.ray_direction(column, row, scene.width, scene.height);
            (scene.camera.eye, direction, f64::INFINITY)
        };
        self.of_rays(n, ray, |number| {
            let (pixel, quantile) = pixel(number);
            self.visible_point_of_pixel(scene, pixel, quantile)
        })
    }

    /// Returns the median visible point behind each pixel in the given rows, row by row: half of the pixel's opacity
    /// lies in front of it. It is `None` for pixels without opacity.
    pub fn visible_points_of_pixels(&self, scene: &Scene, rows: Range<u32>) -> Vec<Option<VisiblePoint>> {
        let width = u64::from(scene.width);
        let pixels = (u64::from(rows.start) * width..u64::from(rows.end) * width).into_par_iter();
        let pixels = pixels.map(|pixel| [pixel % width, pixel / width].map(|n| n as f64));
        pixels.map(|pixel| self.visible_point_of_pixel(scene, pixel, 0.5)).collect()
    }

    fn visible_point_of_pixel(
        &self,
        scene: &Scene,
        [column, row]: [f64; 2],
        quantile: f64,
    ) -> Option<VisiblePoint> {
        let direction = scene.camera.ray_direction(column, row, scene.width, scene.height);
        let eye = scene.camera.eye;
        let length_mm = first_surface(scene, eye, direction).map_or(f64::INFINITY, |hit| hit.depth_mm);
        self.visible_point_along(eye, direction, length_mm, quantile)
    }

    /// Returns the point along a ray from the eye (world mm, unit direction, possibly infinite length) with the
    /// fraction `quantile` of the ray's opacity in front of it. Returns `None` if the ray has no opacity.
    pub fn visible_point_along(
        &self,
        eye: DVec3,
        direction: DVec3,
        length_mm: f64,
        quantile: f64,
    ) -> Option<VisiblePoint> {
        let curve = self.curve_along(eye, direction, length_mm);
        let opacity = -(-curve.total()).exp_m1();
        if opacity <= 0.0 {
            return None;
        }
        // The point lies at least half an f64 step inside the matter.
        let tau = -(-quantile.max(0.5 * f64::EPSILON) * opacity).ln_1p();
        let depth_mm = curve.depth_of_optical_depth(tau.min(curve.total()))?;
        Some(VisiblePoint { position: eye + direction * depth_mm, weight: opacity })
    }
}
