//! Bound on the mean error of a picture's shadows, from random points, at 99 % confidence. It holds for any shadow method,
//! and assumes nothing about the distribution of its errors.
//!
//! A pixel, a point that it sees, and a light are drawn at random, each light with a probability in proportion to its
//! largest channel. Let `r` be the sum of these channels times `1 - ambient`, and `opacity` that of the pixel. The product
//! `r opacity |T_method - T_exact|` has the mean
//! `mean over pixels of sum over lights of (1 - ambient) light integral(T_eye sigma |T_method - T_exact| dt)`. No channel
//! of a picture without shading errs by more than this on average; with a phase function, `r` has its largest value as a
//! factor. The products lie in `[0, r]`, so that the empirical
//! Bernstein inequality bounds their mean (Maurer and Pontil 2009, *Empirical Bernstein bounds and sample variance
//! penalization*, Theorem 4).

use super::errors::mean_of_maps;
use crate::error::Result;
use crate::exact::ExactField;
use crate::random::Chance;
use crate::scene::{LightSource, Scene};
use crate::shadow::{ShadowMap, split_samples};
use glam::DVec3;
use serde::Serialize;

/// Probability with which the bound is too small.
const RISK: f64 = 0.01;
/// Seed of the random points. It is fixed; every run and method draws the same points.
const SEED: u64 = 0x0001_5eed;
/// Number of random points. With none of them in error, the bound for one white light without ambient light is 0.0012.
pub const MEAN_ERROR_POINTS: usize = 10_000;

/// Random points of a picture with the exact transmittance from one light to each, drawn once for all methods.
pub struct MeanErrorSample {
    /// Points drawn for each light.
    lights: Vec<LightSample>,
    /// Largest possible error of a pixel.
    range: f64,
    /// Number of draws, also of pixels without opacity.
    draws: usize,
}

/// Random points of one light.
#[derive(Default)]
struct LightSample {
    /// Number of samples of the light, for which its shadow maps answer.
    samples: usize,
    points_mm: Vec<DVec3>,
    /// Opacity of the pixel that sees each point.
    opacities: Vec<f64>,
    exact: Vec<f64>,
}

/// Mean error of a picture's shadows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeanError {
    /// Mean over the random points: an estimate.
    pub estimate: f64,
    /// Upper bound on the mean error of the picture, wrong with a probability of 1 %.
    pub bound: f64,
}

impl MeanErrorSample {
    /// Draws `draws` random points of the picture of a scene.
    pub fn new(field: &ExactField, scene: &Scene, draws: usize) -> Self {
        let shining = scene.sources_shining();
        let sample =
            |source: &LightSource| LightSample { samples: source.sample_count(), ..LightSample::default() };
        let mut lights: Vec<LightSample> = shining.iter().map(sample).collect();
        let channel = |source: &LightSource| source.radiance().into_iter().fold(0.0, f64::max);
        let channels: Vec<f64> = shining.iter().map(channel).collect();
        let sum = sum_of(&channels);
        let range = (1.0 - scene.ambient) * sum * scene.largest_phase();
        // Nothing errs where light does not depend on shadows.
        let points = if range > 0.0 { field.random_visible_points(scene, draws, SEED) } else { Vec::new() };
        for (i, point) in points.into_iter().enumerate() {
            let drawn = sum * Chance::new(SEED + 1, i as u64).unit();
            let mut end = 0.0;
            let light = channels.iter().position(|channel| {
                end += channel;
                drawn < end
            });
            let k = light.unwrap_or(channels.len() - 1);
            if let Some(point) = point {
                lights[k].points_mm.push(point.position);
                lights[k].opacities.push(point.weight);
            }
        }
        for (sample, source) in lights.iter_mut().zip(&shining) {
            sample.exact = field.transmittances_from(&sample.points_mm, source).0;
        }
        Self { lights, range, draws }
    }

    /// Returns the mean error of the shadow maps of all lights, in order. `query` returns the transmittance of a map at
    /// points.
    ///
    /// # Errors
    /// The query of a map fails.
    pub fn of(
        &self,
        shadows: &[&ShadowMap],
        query: impl Fn(&ShadowMap, &[DVec3]) -> Result<Vec<f32>>,
    ) -> Result<MeanError> {
        let mut values = Vec::with_capacity(self.draws);
        let mut rest = shadows;
        for sample in &self.lights {
            let (maps, others) = split_samples(rest, sample.samples);
            rest = others;
            let found = mean_of_maps(maps, &sample.points_mm, &query)?;
            let error = |(t, exact): (&f64, &f64)| match (t - exact).abs() {
                error if error <= 1.0 => error,
                // Also NaN.
                _ => 1.0,
            };
            let errors = found.iter().zip(&sample.exact).map(error);
            values.extend(errors.zip(&sample.opacities).map(|(error, opacity)| error * opacity));
        }
        let MeanError { estimate, bound } = MeanError::of_values(&values, self.draws, RISK);
        Ok(MeanError { estimate: self.range * estimate, bound: self.range * bound })
    }
}

impl MeanError {
    /// Returns the empirical Bernstein bound for the mean of independent draws from `[0, 1]`, of which all but `values`
    /// are 0. The bound is wrong with probability `risk`.
    fn of_values(values: &[f64], draws: usize, risk: f64) -> Self {
        let n = draws.max(2) as f64;
        let estimate = sum_of(values) / n;
        let squares = values.iter().map(|v| (v - estimate).powi(2)).sum::<f64>();
        let variance = (squares + (n - values.len() as f64) * estimate * estimate) / (n - 1.0);
        let log = (2.0 / risk).ln();
        let bound = estimate + (2.0 * variance * log / n).sqrt() + 7.0 * log / (3.0 * (n - 1.0));
        Self { estimate, bound: bound.min(1.0) }
    }
}

/// Returns a sum that is 0 for no values; that of the standard library is -0.
fn sum_of(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |sum, value| sum + value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_that_of_the_theorem() {
        // Few draws say nothing.
        assert_eq!(MeanError::of_values(&[1.0, 1.0], 4, 0.01), MeanError { estimate: 0.5, bound: 1.0 });
        let found = MeanError::of_values(&[1.0; 200], 40_000, 0.01);
        let (n, p, log) = (40_000.0, 0.005, 200f64.ln());
        let variance = p * (1.0 - p) * n / (n - 1.0);
        let expected = p + (2.0 * variance * log / n).sqrt() + 7.0 * log / (3.0 * (n - 1.0));
        assert!((found.bound - expected).abs() < 1e-12, "{} {expected}", found.bound);
    }

    /// Fewer samples than the stated part have a bound below the true mean. The errors are rare and large, the worst case
    /// of an estimate.
    #[test]
    fn the_bound_is_seldom_below_the_mean() {
        let mut rng = fastrand::Rng::with_seed(7);
        let (rare, large, risk) = (0.01, 0.8, 0.1);
        let mut sample = || {
            let values: Vec<f64> = (0..500).filter(|_| rng.f64() < rare).map(|_| large).collect();
            MeanError::of_values(&values, 500, risk)
        };
        let bounds: Vec<MeanError> = (0..4000).map(|_| sample()).collect();
        let missed = bounds.iter().filter(|e| e.bound < rare * large).count();
        assert!((missed as f64) < risk * 4000.0, "{missed} of 4000");
        // The estimate itself is often below the mean.
        assert!(bounds.iter().filter(|e| e.estimate < rare * large).count() > 1000);
    }
}
