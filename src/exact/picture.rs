//! Exact rendering of small pictures in float64. The colour of a pixel is `C = ∫ T_eye sigma c (ambient + (1 -
//! ambient) sum_i L_i T_i f_i) dt + T_eye background` along its ray. Here `sigma` is extinction, `c` colour, `L_i`
//! the radiance of light `i`, `T_i` its exact transmittance and `f_i` its shading factor. The integral is computed by
//! adaptive quadrature, with exact shadow rays at each node.
//!
//! For a light with a size, `T_i f_i` is the mean over its points or directions. Then depths along the ray and positions on
//! the light are sampled together, by a low-discrepancy sequence: a nested quadrature would meet the edges of shadows of
//! every sample.

use super::{ExactField, OPAQUE};
use crate::mesh::{Hit, SURFACE_GAP};
use crate::random::low_discrepancy;
use crate::scene::{AmbientOcclusion, Extent, Light, LightSource, Scene};
use glam::DVec3;
use ndarray::Array3;
use rayon::prelude::*;
use std::ops::Range;

/// Accuracy settings of the adaptive quadrature that integrates the colour of a pixel.
#[derive(Debug, Clone, Copy)]
struct Rule {
    /// Largest estimated error of a pixel's colour channel (colours in `[0, 1]`).
    tolerance: f64,
    /// Number of intervals with which the adaptive quadrature along a camera ray starts, enough not to miss a narrow
    /// shadow.
    first_panels: usize,
    /// Largest number of intervals into which the adaptive quadrature divides a camera ray.
    most_panels: usize,
    /// Number of samples of a pixel under lights with a size.
    soft_samples: usize,
}

const RULE: Rule = Rule { tolerance: 5e-5, first_panels: 6, most_panels: 200, soft_samples: 4096 };
/// Finer settings of the quadrature of a pixel's colour, by which the error of the normal settings is estimated.
const FINER: Rule = Rule {
    tolerance: RULE.tolerance / 16.0,
    first_panels: 24,
    most_panels: 800,
    soft_samples: 8 * RULE.soft_samples,
};

/// Gauss-Kronrod rule with 15 nodes on `[-1, 1]`: node, its Kronrod weight, and its weight in the 7-point Gauss rule.
const KRONROD: [(f64, f64, f64); 8] = [
    (0.991_455_371_120_812_6, 0.022_935_322_010_529_224, 0.0),
    (0.949_107_912_342_758_5, 0.063_092_092_629_978_56, 0.129_484_966_168_869_7),
    (0.864_864_423_359_769_1, 0.104_790_010_322_250_19, 0.0),
    (0.741_531_185_599_394_4, 0.140_653_259_715_525_92, 0.279_705_391_489_276_64),
    (0.586_087_235_467_691_1, 0.169_004_726_639_267_9, 0.0),
    (0.405_845_151_377_397_2, 0.190_350_578_064_785_4, 0.381_830_050_505_118_9),
    (0.207_784_955_007_898_47, 0.204_432_940_075_298_9, 0.0),
    (0.0, 0.209_482_141_084_727_82, 0.417_959_183_673_469_4),
];

impl ExactField<'_> {
    /// Renders the exact picture of `scene` as `[row, column, channel]`: linear RGB and opacity, to about 1e-4
    /// (1e-3 under lights with a size).
    ///
    /// Rendering takes seconds at 48 x 32 pixels; it is meant for small pictures.
    pub fn picture(&self, scene: &Scene) -> Array3<f32> {
        self.picture_rows(scene, 0..scene.height)
    }

    /// Renders only the given rows of pixels of the exact picture ([`Self::picture`]).
    pub fn picture_rows(&self, scene: &Scene, rows: Range<u32>) -> Array3<f32> {
        let (width, height) = (scene.width as usize, rows.len());
        let first = f64::from(rows.start);
        let pixel =
            |index: usize| self.pixel(scene, (index % width) as f64, first + (index / width) as f64, RULE);
        let pixels: Vec<_> = (0..width * height).into_par_iter().map(pixel).collect();
        Array3::from_shape_fn((height, width, 4), |(row, column, channel)| {
            pixels[row * width + column][channel] as f32
        })
    }

    /// Returns an error estimate of the exact picture ([`Self::picture`]). It is the largest change of a channel if
    /// the quadrature has a sixteenth of the tolerance and starts with intervals a quarter as wide, over about
    /// `count` evenly spread pixels.
    ///
    /// Under lights with a size, it is the change with eight times as many samples.
    ///
    /// All other parts of a pixel are exact to 1e-12: the optical depth of its ray and of each shadow ray. One ray
    /// per pixel is part of the model, not an approximation.
    pub fn picture_change(&self, scene: &Scene, picture: &Array3<f32>, count: usize) -> f64 {
        let (height, width, _) = picture.dim();
        let step = spread_step(width, height, count);
        (0..width * height)
            .into_par_iter()
            .step_by(step)
            .map(|index| {
                let (row, column) = (index / width, index % width);
                let finer = self.pixel(scene, column as f64, row as f64, FINER);
                (0..4).map(|c| (finer[c] - f64::from(picture[[row, column, c]])).abs()).fold(0.0, f64::max)
            })
            .reduce(|| 0.0, f64::max)
    }

    /// Returns the light that reaches a point (world mm) in each colour channel: ambient light, and the attenuated
    /// light of each light source times its shading `factor`. A light source with a size lights from one `position` within
    /// it ([`LightSource::sample`]).
    ///
    /// [`LightSource::sample`]: crate::scene::LightSource::sample
    fn lit(&self, scene: &Scene, x: DVec3, position: [f64; 2], factor: impl Fn(&Light) -> f64) -> [f64; 3] {
        let mut lit = [scene.ambient * self.ambient_transmittance(scene, x, position); 3];
        for source in scene.lights.iter().filter(|source| source.shines()) {
            let sample = source.sample(position);
            let share = (1.0 - scene.ambient)
                * factor(&sample.light)
                * self.transmittance_past_mesh(scene, x, &sample.light);
            let radiance = sample.radiance();
            (0..3).for_each(|c| lit[c] += share * radiance[c]);
        }
        lit
    }

    /// Returns the transmittance of ambient light to a point (world mm) from one direction, within the radius of the
    /// ambient occlusion; 1 without. `position` chooses the direction, as on a sky ([`LightSource::sample`]).
    fn ambient_transmittance(&self, scene: &Scene, x: DVec3, position: [f64; 2]) -> f64 {
        let Some(AmbientOcclusion { radius_mm, .. }) = scene.occlusion() else { return 1.0 };
        let sky = LightSource { extent: Extent::SKY, ..LightSource::default() };
        let (toward, _) = sky.sample(position).light.from_point(x);
        (-self.optical_depth_along(x, toward, radius_mm, OPAQUE)).exp()
    }

    /// Returns the exact linear RGB and opacity of one pixel, along the camera ray through its centre.
    fn pixel(&self, scene: &Scene, column: f64, row: f64, rule: Rule) -> [f64; 4] {
        let eye = scene.camera.eye;
        let direction = scene.camera.ray_direction(column, row, scene.width, scene.height);
        let surface = first_surface(scene, eye, direction);
        let curve = self.curve_along(eye, direction, surface.map_or(f64::INFINITY, |hit| hit.depth_mm));
        let opacity = -(-curve.total()).exp_m1();
        // With w = 1 - T_eye as the variable, T_eye sigma dt = dw: the weight is 1 and empty space has no share.
        let light_at = |w: f64, position: [f64; 2]| {
            let tau = (-(-w).ln_1p()).min(curve.total());
            let Some(found) = curve.find(tau) else { return [0.0; 3] };
            let x = eye + direction * found.depth_mm;
            let lit = match scene.ambient >= 1.0 && scene.occlusion().is_none() {
                true => [1.0; 3],
                false => {
                    self.lit(scene, x, position, |light| self.shading_factor(x, direction, light, scene))
                }
            };
            let color = self.transfer_function.function(found.function).color(found.value);
            std::array::from_fn(|c| color[c] * lit[c])
        };
        let is_soft = (scene.has_soft_light() && scene.ambient < 1.0) || scene.occlusion().is_some();
        let color = match opacity > 0.0 {
            true if is_soft => {
                let mean = mean_of_samples(rule, |[share, u, v]| light_at(share * opacity, [u, v]));
                mean.map(|c| c * opacity)
            }
            true => integrate(|w| light_at(w, [0.0; 2]), opacity, rule),
            false => [0.0; 3],
        };
        let behind =
            surface.map_or(scene.background, |hit| self.surface_color(scene, (eye, direction), hit, rule));
        let [r, g, b] = std::array::from_fn(|c| color[c] + (1.0 - opacity) * behind[c]);
        [r, g, b, if surface.is_some() { 1.0 } else { opacity }]
    }

    /// Returns the linear RGB of the mesh at the point where a camera ray hits it. The mesh shows its colour in
    /// ambient light, and in the light of each source by Lambert's law on the visible side.
    fn surface_color(
        &self,
        scene: &Scene,
        (eye, direction): (DVec3, DVec3),
        hit: Hit,
        rule: Rule,
    ) -> [f64; 3] {
        let Some(mesh) = &scene.mesh else { return scene.background };
        let x = eye + direction * hit.depth_mm;
        let normal = mesh.normal(hit.triangle);
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let lit_from =
            |position| self.lit(scene, x, position, |light| normal.dot(light.from_point(x).0).max(0.0));
        let lit = match scene.has_soft_light() {
            true => mean_of_samples(rule, |[_, u, v]| lit_from([u, v])),
            false => lit_from([0.0; 2]),
        };
        let color = mesh.color(hit.triangle);
        std::array::from_fn(|c| color[c] * lit[c])
    }

    /// Returns the exact transmittance from a light to a point (world mm), through the volume; 0 if the mesh hides
    /// the light.
    fn transmittance_past_mesh(&self, scene: &Scene, x: DVec3, light: &Light) -> f64 {
        let (toward, distance_mm) = light.from_point(x);
        // Nearer hits belong to the surface that the point lies on.
        let from_mm = SURFACE_GAP * self.volume.min_spacing_mm();
        let hidden = scene.mesh.as_ref().is_some_and(|mesh| mesh.is_hit(x, toward, [from_mm, distance_mm]));
        if hidden { 0.0 } else { self.transmittance_to_light(x, light) }
    }
}

/// Returns the mean of a function over the unit cube, at the points of a low-discrepancy sequence.
fn mean_of_samples(rule: Rule, f: impl Fn([f64; 3]) -> [f64; 3]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for i in 0..rule.soft_samples {
        let value = f(low_discrepancy(i as u64, [0.0; 3]));
        (0..3).for_each(|c| sum[c] += value[c]);
    }
    sum.map(|c| c / rule.soft_samples as f64)
}

/// Returns the first hit of a ray from the eye (world mm) with the scene's mesh.
pub(super) fn first_surface(scene: &Scene, eye: DVec3, direction: DVec3) -> Option<Hit> {
    scene.mesh.as_ref()?.first_hit(eye, direction, [0.0, f64::INFINITY])
}

/// Returns the step, in pixels counted row by row, between evenly spread sample pixels. It is coprime to the width,
/// so that the pixels do not stay in a few columns.
fn spread_step(width: usize, height: usize, count: usize) -> usize {
    fn gcd(a: usize, b: usize) -> usize {
        if b == 0 { a } else { gcd(b, a % b) }
    }
    let least = (width * height / count.max(1)).max(1);
    (least..).find(|step| gcd(*step, width.max(1)) == 1).unwrap_or(least)
}

/// Interval (panel) of the adaptive quadrature, with the integral over it and an error estimate.
struct Panel {
    from: f64,
    to: f64,
    integral: [f64; 3],
    error: f64,
}

impl Panel {
    fn new(f: &impl Fn(f64) -> [f64; 3], from: f64, to: f64) -> Self {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let (mut kronrod, mut gauss) = ([0.0; 3], [0.0; 3]);
        let mut add = |value: [f64; 3], k: f64, g: f64| {
            for c in 0..3 {
                kronrod[c] += half * k * value[c];
                gauss[c] += half * g * value[c];
            }
        };
        for (x, k, g) in KRONROD {
            add(f(middle + half * x), k, g);
            if x > 0.0 {
                add(f(middle - half * x), k, g);
            }
        }
        let error = (0..3).map(|c| (kronrod[c] - gauss[c]).abs()).fold(0.0, f64::max);
        Self { from, to, integral: kronrod, error }
    }
}

/// Returns the integral of `f` over `[0, end]` by adaptive quadrature. The interval with the largest error is
/// bisected until the sum of the errors is below the tolerance.
fn integrate(f: impl Fn(f64) -> [f64; 3], end: f64, rule: Rule) -> [f64; 3] {
    let at = |i: usize| end * i as f64 / rule.first_panels as f64;
    let mut panels: Vec<_> = (0..rule.first_panels).map(|i| Panel::new(&f, at(i), at(i + 1))).collect();
    while panels.len() < rule.most_panels && panels.iter().map(|p| p.error).sum::<f64>() > rule.tolerance {
        let Some(worst) = (0..panels.len()).max_by(|&a, &b| panels[a].error.total_cmp(&panels[b].error))
        else {
            break;
        };
        let Panel { from, to, .. } = panels[worst];
        let middle = 0.5 * (from + to);
        panels[worst] = Panel::new(&f, from, middle);
        panels.push(Panel::new(&f, middle, to));
    }
    std::array::from_fn(|c| panels.iter().map(|p| p.integral[c]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_smooth_and_broken_functions() {
        let f = |x: f64| [x.exp(), (20.0 * x).sin(), f64::from(u8::from(x > 0.3))];
        for rule in [RULE, FINER] {
            let got = integrate(f, 0.9, rule);
            assert!((got[0] - 0.9f64.exp_m1()).abs() < 1e-12, "{got:?}");
            assert!((got[1] - (1.0 - 18f64.cos()) / 20.0).abs() < 1e-6, "{got:?}");
            assert!((got[2] - 0.6).abs() < rule.tolerance, "{got:?}");
        }
    }
}
