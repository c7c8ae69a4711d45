//! Samples of the exact eye ray of a pixel, for integrals of light along it.

use super::ExactField;
use crate::scene::Scene;
use glam::DVec3;

/// Point on an eye ray that stands for an equal share of the ray's opacity.
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
}

impl ExactField<'_> {
    /// Returns the exact eye ray of a pixel of a scene without meshes, with `n` samples.
    pub fn eye_ray(&self, scene: &Scene, [column, row]: [u32; 2], n: usize) -> EyeRay {
        let eye = scene.camera.eye;
        let direction =
            scene.camera.ray_direction(f64::from(column), f64::from(row), scene.width, scene.height);
        let curve = self.curve_along(eye, direction, f64::INFINITY);
        let opacity = -(-curve.total()).exp_m1();
        let sample = |k: usize| {
            let w = opacity * (k as f64 + 0.5) / n as f64;
            let found = curve.find((-(-w).ln_1p()).min(curve.total()))?;
            let color = self.transfer_function.function(found.function).color(found.value);
            Some(EyeSample { position: eye + direction * found.depth_mm, color })
        };
        let samples = if opacity > 0.0 { (0..n).filter_map(sample).collect() } else { Vec::new() };
        EyeRay { direction, opacity, samples }
    }
}
