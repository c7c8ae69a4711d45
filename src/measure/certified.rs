//! Certified pictures: a picture with a bound on the error of every pixel.
//!
//! Eye rays are exact, in float64: each has samples in the middles of equal parts of its opacity. At each sample the
//! enclosure of a shadow map (`enclose=on`) gives a lower and an upper bound on the transmittance from a light. The
//! picture takes the middle between them, and half their difference is the error. Where that is too wide, a shadow ray
//! is cast.
//!
//! The integral over the samples has an error of its own. If the light is monotone between neighbouring samples, it is at
//! most half a sample's share of the sum of their differences in light and in its error. Otherwise it is estimated by the
//! change of the picture if only every third sample is taken. The larger of both is an estimate, not a bound.

use crate::error::{Error, Result};
use crate::exact::{ExactField, EyeRay};
use crate::field::{DeviceTransfer, LoadedVolume};
use crate::render::Renderer;
use crate::scene::{LightSource, Scene};
use crate::shadow::{Lookups, MARCH_ERROR, ShadowMap, ShadowRays};
use glam::DVec3;
use ndarray::{Array2, Array3};
use rayon::prelude::*;
use serde::Serialize;

/// Number of samples of an eye ray: a power of 3, so that every third is in the middle of a part three times as large.
const SAMPLES: usize = 81;
/// Number of pixels whose samples are in memory at the same time.
const PIXELS_AT_ONCE: usize = 1 << 10;
/// Factor on the change of a picture with a third of the samples, as an estimate of the error with all of them.
const SAFETY: f64 = 2.0;
/// Error of float32 pixels, of the exact picture with which they are compared, and of the ends of eye rays, for colours
/// up to 1. Brighter light has a larger one.
const ROUNDING: f32 = 5e-4;

/// Picture with a bound on the error of every pixel.
pub struct CertifiedPicture {
    /// Pixels as `height x width x 4` floats: linear RGB over the background, and opacity.
    pub pixels: Array3<f32>,
    /// Bound on the error of each pixel in any colour channel, linear.
    pub error: Array2<f32>,
    /// Share of the lookups of light that shadow rays answered.
    pub share_of_rays: f64,
}

/// Summary of the bounds of a certified picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Certificate {
    /// Largest bound on the error of a pixel.
    pub largest: f64,
    /// Mean bound on the error over all pixels.
    pub mean: f64,
    /// Share of the lookups of light that shadow rays answered.
    pub share_of_rays: f64,
}

impl CertifiedPicture {
    /// Returns the summary of the bounds of all pixels.
    pub fn certificate(&self) -> Certificate {
        let largest = self.error.iter().copied().fold(0.0, f32::max).into();
        let sum: f64 = self.error.iter().copied().map(f64::from).sum();
        let mean = sum / self.error.len().max(1) as f64;
        Certificate { largest, mean, share_of_rays: self.share_of_rays }
    }

    /// Returns the largest excess of a pixel's error over its bound, in any colour channel, against the exact picture;
    /// negative where all errors are within their bounds.
    pub fn excess(&self, exact: &Array3<f32>) -> f32 {
        let error = |at: (usize, usize)| {
            let channels = (0..3).map(|c| (self.pixels[[at.0, at.1, c]] - exact[[at.0, at.1, c]]).abs());
            // NaN is in excess of every bound.
            channels.fold(0.0f32, |a, b| if a.is_nan() || b.is_nan() { f32::INFINITY } else { a.max(b) })
        };
        self.error.indexed_iter().map(|(at, bound)| error(at) - bound).fold(f32::NEG_INFINITY, f32::max)
    }

    /// Returns the bounds as an opaque grey picture, `height x width x 4`.
    pub fn error_pixels(&self) -> Array3<f32> {
        let (height, width) = self.error.dim();
        Array3::from_shape_fn((height, width, 4), |(y, x, c)| if c < 3 { self.error[[y, x]] } else { 1.0 })
    }
}

/// ETA of the certified pictures in tables and in the window: largest error of a transmittance that no shadow ray
/// answers.
pub const DEFAULT_ETA: f64 = 0.03;

/// Returns whether pictures of a scene can be certified.
///
/// # Errors
/// The scene has opaque objects, a light with a size, or ambient occlusion.
pub fn check(scene: &Scene) -> Result<()> {
    let refuse = |why: &str| Err(Error::input("cannot certify", "picture", why));
    if scene.mesh.is_some() {
        return refuse("opaque objects hide light, of which the shadow map knows nothing");
    }
    if scene.occlusion().is_some() {
        return refuse("the error of ambient occlusion is not bounded");
    }
    if scene.has_soft_light() {
        return refuse("the bound is that of lights without a size");
    }
    Ok(())
}

/// Returns the largest channel of light that a point receives without shadows and shading.
fn brightness(scene: &Scene) -> f64 {
    let channel = |c: usize| scene.shining().iter().map(|source| source.radiance()[c]).sum::<f64>();
    let largest = (0..3).map(channel).fold(0.0, f64::max);
    scene.ambient + (1.0 - scene.ambient) * largest * scene.largest_phase()
}

/// Renderer with the volume, the transfer function and the shadow maps of a scene.
pub struct CertifiedScene<'a> {
    /// Renderer that queries the shadow maps.
    pub renderer: &'a Renderer,
    /// Volume on the device.
    pub loaded: &'a LoadedVolume,
    /// Transfer function on the device.
    pub transfer: &'a DeviceTransfer,
    /// Shadow maps of all lights, with their enclosures.
    pub shadows: &'a [&'a ShadowMap],
    /// Exact field of the volume.
    pub field: &'a ExactField<'a>,
}

/// Light that reaches the samples of some eye rays from one source, without its colour.
struct SourceLight {
    source: LightSource,
    /// Transmittance times shading factor of each sample.
    light: Vec<f64>,
    /// Bound on the error of each value of `light`.
    error: Vec<f64>,
}

/// Pixel of a certified picture.
struct Pixel {
    /// Linear RGB over the background, and opacity.
    rgba: [f32; 4],
    /// Largest bound on the error of a channel from shadows.
    shadow_error: f32,
    /// Estimated error of the integral over the samples, in any channel.
    sample_error: f32,
}

impl CertifiedScene<'_> {
    /// Renders a picture whose transmittances err by at most `eta` at each sample of an eye ray, or are those of shadow
    /// rays.
    ///
    /// # Errors
    /// The scene has a mesh, a shadow map has no enclosure, the device is lost, or `go_on` returns an error, which
    /// is called every thousand pixels with the share of the picture that is done.
    pub fn render(
        &self,
        scene: &Scene,
        eta: f64,
        go_on: &dyn Fn(f32) -> Result<()>,
    ) -> Result<CertifiedPicture> {
        check(scene)?;
        let rays = self.renderer.shadows_in(
            self.loaded,
            self.transfer,
            &ShadowRays { lookup: Lookups::Each, ..ShadowRays::default() },
            scene,
            None,
        )?;
        let (width, count) = (scene.width, scene.width as usize * scene.height as usize);
        let (mut pixels, mut lookups) = (Vec::with_capacity(count), [0usize; 2]);
        for first in (0..count).step_by(PIXELS_AT_ONCE) {
            go_on(first as f32 / count as f32)?;
            let some = first as u32..(first + PIXELS_AT_ONCE).min(count) as u32;
            let eye_rays: Vec<EyeRay> = some
                .into_par_iter()
                .map(|i| self.field.eye_ray(scene, [i % width, i / width], SAMPLES))
                .collect();
            let mut lights = Vec::new();
            for ((source, map), rays) in scene.shining().into_iter().zip(self.shadows).zip(&rays) {
                lights.push(self.light_of(scene, source, [map, rays], &eye_rays, eta, &mut lookups)?);
            }
            let mut start = 0;
            for ray in &eye_rays {
                pixels.push(Pixel::of(scene, ray, &lights, start));
                start += ray.all_samples().count();
            }
        }
        let size = (scene.height as usize, width as usize);
        let at = |y: usize, x: usize| y * size.1 + x;
        let rounding = ROUNDING * brightness(scene).max(1.0) as f32;
        let error = Array2::from_shape_fn(size, |(y, x)| {
            let around = (y.saturating_sub(1)..(y + 2).min(size.0))
                .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(size.1)).map(move |x| at(y, x)));
            let sample_error = around.map(|i| pixels[i].sample_error).fold(0.0, f32::max);
            pixels[at(y, x)].shadow_error + sample_error + rounding
        });
        let pixels = Array3::from_shape_fn((size.0, size.1, 4), |(y, x, c)| pixels[at(y, x)].rgba[c]);
        Ok(CertifiedPicture { pixels, error, share_of_rays: lookups[0] as f64 / lookups[1].max(1) as f64 })
    }

    /// Returns the light of one source at the samples of eye rays, from its shadow map or from shadow rays. Adds the
    /// number of lookups by rays, and of all, to `lookups`.
    fn light_of(
        &self,
        scene: &Scene,
        source: LightSource,
        [map, rays]: [&ShadowMap; 2],
        eye_rays: &[EyeRay],
        eta: f64,
        lookups: &mut [usize; 2],
    ) -> Result<SourceLight> {
        let query =
            |map: &ShadowMap, points: &[DVec3]| self.renderer.query(self.loaded, self.transfer, map, points);
        let points: Vec<DVec3> = eye_rays.iter().flat_map(|r| r.all_samples().map(|s| s.position)).collect();
        let (mut light, mut error): (Vec<f64>, Vec<f64>) = match (&map.enclosure, &map.lookup) {
            (Some(enclosure), _) => {
                let [lower, upper] = [&enclosure.lower, &enclosure.upper].map(|map| query(map, &points));
                let bounds = lower?.into_iter().zip(upper?).map(|(l, u)| [l, u].map(f64::from));
                bounds.map(|[l, u]| (0.5 * (l + u), 0.5 * (u - l))).unzip()
            }
            (None, None) => (vec![1.0; points.len()], vec![0.0; points.len()]),
            (None, Some(_)) => {
                let why = "its shadow map stores no bounds on the exact transmittance";
                return Err(Error::runtime("cannot certify", "picture", why));
            }
        };
        // Neither NaN nor an upper bound below the lower one is a bound.
        let is_wide = |i: &usize| !(0.0..=eta.max(MARCH_ERROR)).contains(&error[*i]);
        let wide: Vec<usize> = (0..points.len()).filter(is_wide).collect();
        let far: Vec<DVec3> = wide.iter().map(|i| points[*i]).collect();
        for (i, t) in wide.iter().zip(query(rays, &far)?) {
            (light[*i], error[*i]) = (f64::from(t), MARCH_ERROR);
        }
        *lookups = [lookups[0] + wide.len(), lookups[1] + points.len()];
        let directions = eye_rays.iter().flat_map(|r| r.all_samples().map(|_| r.direction));
        let directions: Vec<DVec3> = directions.collect();
        let factor = |(point, direction): (&DVec3, &DVec3)| {
            self.field.shading_factor(*point, *direction, &source.light, scene)
        };
        let factors: Vec<f64> = points.par_iter().zip(&directions).map(factor).collect();
        for (i, factor) in factors.into_iter().enumerate() {
            light[i] *= factor;
            error[i] *= factor;
        }
        Ok(SourceLight { source, light, error })
    }
}

impl Pixel {
    /// Adds up the light of the samples of an eye ray, of which the first is number `start` in `lights`.
    fn of(scene: &Scene, ray: &EyeRay, lights: &[SourceLight], start: usize) -> Self {
        let share = ray.opacity / ray.samples.len().max(1) as f64;
        let direct = 1.0 - scene.ambient;
        let [mut color, mut coarse, mut error, mut variation] = [[0.0; 3]; 4];
        let mut before: Option<[[f64; 2]; 3]> = None;
        for (k, sample) in ray.all_samples().enumerate() {
            // Light of each channel, and the bound on its error.
            let lit: [[f64; 2]; 3] = std::array::from_fn(|c| {
                let of = |values: fn(&SourceLight) -> &Vec<f64>| -> f64 {
                    let light = |l: &SourceLight| l.source.radiance()[c] * values(l)[start + k];
                    direct * lights.iter().map(light).sum::<f64>()
                };
                [scene.ambient + of(|l| &l.light), of(|l| &l.error)].map(|light| sample.color[c] * light)
            });
            for c in 0..3 {
                let [light, own] = lit[c];
                if let Some([last, last_own]) = before.map(|before| before[c]) {
                    variation[c] += (light - last).abs() + (own - last_own).abs();
                }
                // The first and the last sample are those at the ends.
                if (1..=ray.samples.len()).contains(&k) {
                    color[c] += share * light;
                    error[c] += share * own;
                    // The middle of three samples stands for them all.
                    if k % 3 == 2 {
                        coarse[c] += 3.0 * share * light;
                    }
                }
            }
            before = Some(lit);
        }
        // NaN is in excess of every bound.
        let larger = |a: f64, b: f64| if a.is_nan() || b.is_nan() { f64::INFINITY } else { a.max(b) };
        let largest = |values: [f64; 3]| values.into_iter().fold(0.0, larger);
        let change = largest(std::array::from_fn(|c| (color[c] - coarse[c]).abs()));
        let sample_error = larger(0.5 * share * largest(variation), SAFETY * change) as f32;
        let [red, green, blue] =
            std::array::from_fn(|c| (color[c] + (1.0 - ray.opacity) * scene.background[c]) as f32);
        let rgba = [red, green, blue, ray.opacity as f32];
        Self { rgba, shadow_error: largest(error) as f32, sample_error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::EyeSample;
    use crate::phantom::Phantom;

    fn ray_of(sample: EyeSample) -> EyeRay {
        EyeRay { direction: DVec3::X, opacity: 1.0, samples: vec![sample; SAMPLES], ends: Some([sample; 2]) }
    }

    /// A band of light begins and ends between samples. All places between the same two samples give the same pixel.
    #[test]
    fn jumps_between_two_samples_are_within_the_bound() {
        let scene = Scene { ambient: 0.0, ..Scene::framing(&Phantom::Slab.build(8).unwrap()) };
        let ray = ray_of(EyeSample { position: DVec3::ZERO, color: [1.0, 0.5, 0.0] });
        let middles = || (0..SAMPLES).map(|k| (k as f64 + 0.5) / SAMPLES as f64);
        let places: Vec<f64> = std::iter::once(0.0).chain(middles()).chain([1.0]).collect();
        let mut worst = 0.0;
        // Narrower bands may lie between two samples, which do not show them.
        for i in 20..=1000 {
            let [from, to] = [0.3, 1.0].map(|end| end * f64::from(i) / 1000.0);
            let light: Vec<f64> =
                places.iter().map(|at| f64::from(u8::from(*at >= from && *at < to))).collect();
            let error = vec![0.0; light.len()];
            let lights = [SourceLight { source: scene.light().into(), light, error }];
            let pixel = Pixel::of(&scene, &ray, &lights, 0);
            let off = (f64::from(pixel.rgba[0]) - (to - from)).abs();
            assert!(off < f64::from(pixel.sample_error) + 1e-6, "{from} {to}: {off} {}", pixel.sample_error);
            worst = f64::max(worst, off / f64::from(pixel.sample_error).max(1e-6));
        }
        assert!(worst > 0.8, "the bound is far too large: {worst}");
    }

    /// Bounds are wide at every other sample, and the light is at their lower end everywhere between the narrow ones.
    #[test]
    fn uneven_bounds_contain_the_light_between_samples() {
        let scene = Scene { ambient: 0.0, ..Scene::framing(&Phantom::Slab.build(8).unwrap()) };
        let ray = ray_of(EyeSample { position: DVec3::ZERO, color: [1.0; 3] });
        let error: Vec<f64> = (0..SAMPLES + 2).map(|k| if k % 2 == 1 { 0.03 } else { 0.0 }).collect();
        let of = |light: Vec<f64>, error: Vec<f64>| {
            Pixel::of(&scene, &ray, &[SourceLight { source: scene.light().into(), light, error }], 0)
        };
        let pixel = of(vec![0.5; SAMPLES + 2], error.clone());
        assert!((pixel.rgba[0] - 0.5).abs() < 1e-6);
        let bound = pixel.shadow_error + pixel.sample_error;
        assert!(bound > 0.03 - 1e-6 && bound < 0.04, "{bound}");
        // A light without a number has no bound.
        let mut light = vec![0.5; SAMPLES + 2];
        light[7] = f64::NAN;
        assert_eq!(of(light, error).sample_error, f32::INFINITY);
    }
}
