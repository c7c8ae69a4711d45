//! Bias and variance of shadow methods with random results, from runs with different seeds.

use super::errors::VisiblePointsByLight;
use crate::error::Result;
use crate::render::Session;
use crate::scene::Scene;
use crate::shadow::Method;

/// Number of runs with different seeds.
const RUNS: u32 = 32;

/// Bias and variance of a shadow method with random results, over the points visible to the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomError {
    /// Mean of the transmittance error `T_method - T_exact` over points and runs.
    pub bias: f64,
    /// Standard error of `bias`, from the means of the runs.
    pub bias_se: f64,
    /// Variance of the transmittance at a point, mean over the points.
    pub variance: f64,
}

impl RandomError {
    /// Measures a shadow method with several seeds at points visible to the camera, weighted by visibility. `None` if its
    /// results are not random, or no point is visible. `progress` is called before each run, and may end the measurement.
    ///
    /// # Errors
    /// The device is lost, a map does not fit on it, or `progress` ends the measurement.
    pub fn of(
        method: &dyn Method,
        session: &Session,
        scene: &Scene,
        visible: &VisiblePointsByLight,
        progress: &mut dyn FnMut() -> Result<()>,
    ) -> Result<Option<Self>> {
        let mut runs = Vec::new();
        for run in 0..RUNS {
            progress()?;
            let Some(method) = method.reseeded(run) else { return Ok(None) };
            let shadows = session.shadows_of(method.as_ref(), scene)?;
            runs.push(visible.weighted(session, &shadows)?);
        }
        Ok(Self::of_runs(&runs))
    }

    /// Returns bias and variance of errors with weights, those of the same points in each run.
    fn of_runs(runs: &[Vec<(f64, f64)>]) -> Option<Self> {
        let first = runs.first().filter(|_| runs.len() > 1)?;
        let (n, weight) = (runs.len() as f64, first.iter().map(|(_, weight)| weight).sum::<f64>());
        if weight <= 0.0 {
            return None;
        }
        let of_run = |run: &Vec<(f64, f64)>| run.iter().map(|(error, w)| error * w).sum::<f64>() / weight;
        let means: Vec<f64> = runs.iter().map(of_run).collect();
        let (bias, of_means) = mean_and_variance(&means);
        let of_point = |(point, (_, w)): (usize, &(f64, f64))| {
            let errors: Vec<f64> = runs.iter().map(|run| run[point].0).collect();
            w * mean_and_variance(&errors).1
        };
        let variance = first.iter().enumerate().map(of_point).sum::<f64>() / weight;
        Some(Self { bias, bias_se: (of_means / n).sqrt(), variance })
    }
}

/// Returns the mean of values and the unbiased estimate of their variance.
fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bias_and_variance_of_three_runs() {
        // Two points, the second with three times the weight.
        let runs = [[0.1, 0.0], [0.3, 0.0], [0.2, 0.4]].map(|[a, b]| vec![(a, 1.0), (b, 3.0)]);
        let found = RandomError::of_runs(&runs).unwrap();
        // Means of the runs: 0.025, 0.075, 0.35. Variances of the points: 0.01 and 0.16 / 3.
        assert!((found.bias - 0.15).abs() < 1e-12);
        assert!((found.variance - (0.01 + 0.16) / 4.0).abs() < 1e-12);
        let of_means: f64 = [0.125_f64, 0.075, -0.2].map(|d| d * d).iter().sum::<f64>() / 2.0;
        assert!((found.bias_se - (of_means / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(RandomError::of_runs(&runs[..1]), None, "one run has no variance");
    }
}
