//! Samples of the exact eye ray of a pixel, for integrals of light along it.

use super::ExactField;
use crate::scene::Scene;
use glam::DVec3;

/// Distance of the first and the last sample from the ends of an eye ray, as a fraction of its opacity.
const END: f64 = 1e-4;

/// Point on an eye ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EyeSample {
    /// Position of the sample on an eye ray, world mm.
    pub position: DVec3,
    /// Colour of the transfer function at the sample, linear RGB.
    pub color: [f64; 3],
}

/// Exact eye ray of a pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct EyeRay {
    /// Unit direction of the eye ray.
    pub direction: DVec3,
    /// Exact opacity of the eye ray.
    pub opacity: f64,
    /// Samples in the middles of equal parts of the opacity, from the eye on; none where there is no opacity.
    pub samples: Vec<EyeSample>,
    /// Samples at both ends of the ray, at 1e-4 of its opacity and as much before all of it.
    pub ends: Option<[EyeSample; 2]>,
}

impl EyeRay {
    /// Returns the samples from the eye on, between those at the ends.
    pub fn all_samples(&self) -> impl Iterator<Item = &EyeSample> {
        let [first, last] = self.ends.as_ref().map_or([None; 2], |ends| ends.each_ref().map(Some));
        first.into_iter().chain(&self.samples).chain(last)
    }
}

impl ExactField<'_> {
    /// Returns the exact eye ray of a pixel of a scene without meshes, with `n` samples.
    pub fn eye_ray(&self, scene: &Scene, [column, row]: [u32; 2], n: usize) -> EyeRay {
        let eye = scene.camera.eye;
        let direction =
            scene.camera.ray_direction(f64::from(column), f64::from(row), scene.width, scene.height);
        let curve = self.curve_along(eye, direction, f64::INFINITY);
        let opacity = -(-curve.total()).exp_m1();
        let sample = |share: f64| {
            let found = curve.find((-(-share * opacity).ln_1p()).min(curve.total()))?;
            let color = self.transfer_function.function(found.function).color(found.value);
            Some(EyeSample { position: eye + direction * found.depth_mm, color })
        };
        let found = || -> Option<(Vec<EyeSample>, [EyeSample; 2])> {
            let samples = (0..n).map(|k| sample((k as f64 + 0.5) / n as f64)).collect::<Option<_>>()?;
            Some((samples, [sample(END)?, sample(1.0 - END)?]))
        };
        match if opacity > 0.0 { found() } else { None } {
            Some((samples, ends)) => EyeRay { direction, opacity, samples, ends: Some(ends) },
            None => EyeRay { direction, opacity, samples: Vec::new(), ends: None },
        }
    }
}
