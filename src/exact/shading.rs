//! The shading factor `f` of the model, in float64.
//!
//! The gradient is the central difference of the trilinear value over one voxel along each index axis, half a voxel
//! either side, clamped at the edge as the value is, taken to world by the inverse transpose of the affine. The
//! derivative itself would jump at every cell face, and no renderer shades by it.

use super::{ExactField, contiguous};
use crate::scene::{Light, Shading};
use crate::volume::Voxel;
use crate::with_voxels;
use glam::DVec3;

/// Strength and exponent of the highlight of `blinn-phong`.
const HIGHLIGHT: f64 = 0.3;
const GLOSS: i32 = 32;

impl ExactField<'_> {
    /// Gradient of the value at `x` (world mm), per mm, by differences over one voxel.
    pub fn gradient(&self, x: DVec3) -> DVec3 {
        let to_index = self.volume.index_from_world();
        let p = to_index.transform_point3(x);
        let dims = self.volume.dims();
        let scaling = self.volume.scaling();
        let along = with_voxels!(self.volume.voxels(), array => {
            let voxels = contiguous(array);
            DVec3::AXES.map(|axis| stored_at(voxels, dims, p + 0.5 * axis) - stored_at(voxels, dims, p - 0.5 * axis))
        });
        // With index = M world, the gradient in world is the transpose of M times that in index space.
        to_index.matrix3.transpose() * (DVec3::from_array(along) * scaling.slope)
    }

    /// The factor on the light that reaches `x` (world mm), seen along the unit `sight` from the eye: 1 without shading
    /// and where the value is flat. Lit from both sides: shadows decide which one light reaches.
    pub fn shading_factor(&self, x: DVec3, sight: DVec3, light: &Light, shading: Shading) -> f64 {
        if shading == Shading::None {
            return 1.0;
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

/// Stored value at an index position: trilinear, clamped at the edge. Made of differences, so that it is exactly flat
/// where the voxels are.
fn stored_at<V: Voxel>(voxels: &[V], dims: [usize; 3], at: DVec3) -> f64 {
    let along = |axis: usize| {
        let last = dims[axis] - 1;
        let p = at[axis].clamp(0.0, last as f64);
        let low = (p as usize).min(last);
        ([low, (low + 1).min(last)], p - low as f64)
    };
    let (([i0, i1], x), ([j0, j1], y), ([k0, k1], z)) = (along(0), along(1), along(2));
    let value = |i: usize, j: usize, k: usize| voxels[i + dims[0] * (j + dims[1] * k)].to_f64();
    let mix = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let row = |j, k| mix(value(i0, j, k), value(i1, j, k), x);
    let slice = |k| mix(row(j0, k), row(j1, k), y);
    mix(slice(k0), slice(k1), z)
}
