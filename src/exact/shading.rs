//! Exact factor by which shading (surface normals or strand directions) changes the light at a point, in float64.
//!
//! The gradient is the central difference of the trilinear value over one voxel along each index axis, half a voxel
//! to either side. It is clamped at the edge like the value, and transformed to world by the inverse transpose of the
//! affine. The derivative itself jumps at every cell face, and no renderer shades by it.
//!
//! Strands are shaded by their directions (Kajiya and Kay 1989, *Rendering fur with three dimensional textures*: the
//! diffuse and the specular component of a thin cylinder).

use super::ExactField;
use super::voxel_access::{VoxelAccess, with_access};
use crate::scene::{Light, Scene, Shading};
use crate::volume::Voxel;
use glam::{DMat3, DVec3};

/// Strength of the specular highlight of `blinn-phong` and `kajiya-kay` shading.
const HIGHLIGHT: f64 = 0.3;
/// Exponent of the specular highlight of `blinn-phong` and `kajiya-kay` shading.
const GLOSS: i32 = 32;

impl ExactField<'_> {
    /// Returns the gradient of the volume's value at `x` (world mm), per mm, by central differences over one voxel.
    pub fn gradient(&self, x: DVec3) -> DVec3 {
        let to_index = self.volume.index_from_world();
        let p = to_index.transform_point3(x);
        let dims = self.volume.dims();
        let scaling = self.volume.scaling();
        let along = with_access!(self.volume, voxels => DVec3::AXES.map(|axis| {
            stored_at(voxels, dims, p + 0.5 * axis) - stored_at(voxels, dims, p - 0.5 * axis)
        }));
        // With index = M world, the gradient in world is the transpose of M times that in index space.
        to_index.matrix3.transpose() * (DVec3::from_array(along) * scaling.slope)
    }

    /// Returns the shading factor of a scene on the light that reaches the point `x` (world mm), for the unit view direction
    /// `sight` from the eye. It is 1 without shading, where the value is flat, and where no direction of strands is
    /// known. Both sides are lit; shadows decide which one light reaches.
    pub fn shading_factor(&self, x: DVec3, sight: DVec3, light: &Light, scene: &Scene) -> f64 {
        let shading = scene.shading;
        if shading == Shading::None {
            return 1.0;
        }
        if shading == Shading::Phase {
            return henyey_greenstein(light.from_point(x).0.dot(sight), scene.mean_cosine);
        }
        if shading == Shading::KajiyaKay {
            let mean = self.directions.as_ref().and_then(|directions| directions.mean_at(x));
            return mean.map_or(1.0, |mean| strand_factor(&mean, light.from_point(x).0, -sight));
        }
        // Scaled first: gradients of tiny values have squares that vanish.
        let gradient = self.gradient(x);
        let largest = gradient.abs().max_element();
        if largest == 0.0 || !largest.is_finite() {
            return 1.0;
        }
        let n = (gradient / largest).normalize();
        let (l, _) = light.from_point(x);
        let diffuse = n.dot(l).abs();
        match shading {
            Shading::BlinnPhong => {
                let halfway = (l - sight).normalize_or_zero();
                diffuse + HIGHLIGHT * n.dot(halfway).abs().powi(GLOSS)
            }
            _ => diffuse,
        }
    }
}

/// Returns the phase function of Henyey and Greenstein (1941, *Diffuse radiation in the galaxy*), times `4 pi`, so that its
/// mean over all directions is 1. `cosine` is that of the angle by which light is deflected, `mean` its mean.
fn henyey_greenstein(cosine: f64, mean: f64) -> f64 {
    (1.0 - mean * mean) / (1.0 + mean * mean - 2.0 * mean * cosine).powf(1.5)
}

/// Returns Kajiya and Kay's shading factor of strands with the mean `mean` of `u u^T` over their directions `u`. The
/// unit vectors `l` and `e` point to the light and to the eye. The factor is the sine of the angle between strand and
/// light, and a highlight about the cone of mirror directions, where the cosines with `l` and `e` are each other's
/// negatives.
///
/// For a single direction this is the formula of Kajiya and Kay. For several directions the sines are root mean
/// squares and the product of cosines is a mean, which is our extension. By the Cauchy-Schwarz inequality the
/// highlight is still at most 1.
fn strand_factor(mean: &DMat3, l: DVec3, e: DVec3) -> f64 {
    let sine = |v: DVec3| (1.0 - v.dot(*mean * v)).max(0.0).sqrt();
    let mirror = sine(l) * sine(e) - l.dot(*mean * e);
    sine(l) + HIGHLIGHT * mirror.max(0.0).powi(GLOSS)
}

/// Returns the stored voxel value at an index position by trilinear interpolation, clamped at the edge. It
/// interpolates with differences, so that equal voxels give exactly their value.
fn stored_at(voxels: &mut impl VoxelAccess, dims: [usize; 3], at: DVec3) -> f64 {
    let along = |axis: usize| {
        let last = dims[axis] - 1;
        let p = at[axis].clamp(0.0, last as f64);
        let low = (p as usize).min(last);
        (low, p - low as f64)
    };
    let ((i, x), (j, y), (k, z)) = (along(0), along(1), along(2));
    let strides = [1, dims[0], dims[0] * dims[1]];
    let offset = std::array::from_fn(|axis| {
        let low = [i, j, k][axis];
        [low, (low + 1).min(dims[axis] - 1)].map(|n| n * strides[axis])
    });
    let corner = voxels.corners([i, j, k].map(|n| n as i64), &offset).map(|v| v.to_f64());
    let mix = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let row = |jk: usize| mix(corner[2 * jk], corner[2 * jk + 1], x);
    let slice = |k: usize| mix(row(2 * k), row(2 * k + 1), y);
    mix(slice(0), slice(1), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_functions_scatter_all_light() {
        for mean in [-0.9, -0.3, 0.0, 0.5, 0.95] {
            let n = 400_000;
            let cosines = (0..n).map(|i| (2.0 * f64::from(i) + 1.0) / f64::from(n) - 1.0);
            let (all, deflected) = cosines.fold((0.0, 0.0), |(all, deflected), cosine| {
                let density = henyey_greenstein(cosine, mean) / f64::from(n);
                (all + density, deflected + cosine * density)
            });
            assert!(
                (all - 1.0).abs() < 1e-6 && (deflected - mean).abs() < 1e-6,
                "{mean}: {all}, {deflected}"
            );
        }
    }
}
