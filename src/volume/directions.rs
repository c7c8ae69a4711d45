//! Second moments of strand directions on the voxel grid of a volume.

use super::trilinear;
use crate::error::{Error, Result};
use glam::{DAffine3, DMat3, DVec3};

/// Weighted sums of `u u^T` over the unit directions `u` of the strands in each voxel of a volume.
///
/// A strand has no sign: `u` and `-u` are the same direction, and `u u^T` does not depend on the sign. Divided by its
/// trace, the sum is the mean `m` of `u u^T`, and `l^T m l` is the mean squared cosine between the strands and a unit
/// vector `l`.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionMoments {
    dims: [usize; 3],
    index_from_world: DAffine3,
    values: Vec<[f32; 6]>,
}

impl DirectionMoments {
    /// Stores the second moments `xx, yy, zz, xy, xz, yz` of the strand directions in each voxel, in world axes, x
    /// fastest. The trace is the total weight of the directions; for strands it is the extinction in 1/mm.
    ///
    /// # Errors
    /// There are no moments, or their number differs from the number of voxels.
    pub fn new(dims: [usize; 3], world_from_index: DAffine3, values: Vec<[f32; 6]>) -> Result<Self> {
        let [nx, ny, nz] = dims;
        if values.is_empty() || values.len() != nx * ny * nz {
            let why = format!("{} values for {nx}x{ny}x{nz} voxels", values.len());
            return Err(Error::runtime("cannot store directions", "directions of strands", why));
        }
        Ok(Self { dims, index_from_world: world_from_index.inverse(), values })
    }

    /// Returns the number of voxels along x, y and z of the grid that stores the strand directions.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Returns the second moments `xx, yy, zz, xy, xz, yz` of the strand directions in each voxel, x fastest.
    pub fn values(&self) -> &[[f32; 6]] {
        &self.values
    }

    /// Returns the largest trace of the second moments of strand directions in any voxel, which is the largest
    /// extinction of the strands, 1/mm.
    pub fn largest_trace(&self) -> f64 {
        self.values.iter().map(trace).fold(0.0, f64::max)
    }

    /// Returns the mean of `u u^T` over the unit strand directions `u` at position `x` (world mm). Second moments are
    /// interpolated trilinearly and clamped at the edge; `None` without strands there.
    pub fn mean_at(&self, x: DVec3) -> Option<DMat3> {
        let mut sum = [0.0; 6];
        for ([i, j, k], weight) in trilinear(self.index_from_world.transform_point3(x), self.dims) {
            let moments = &self.values[i + self.dims[0] * (j + self.dims[1] * k)];
            sum.iter_mut().zip(moments).for_each(|(s, m)| *s += weight * f64::from(*m));
        }
        let [xx, yy, zz, xy, xz, yz] = sum;
        let trace = xx + yy + zz;
        let rows = [DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz)];
        let [a, b, c] = rows.map(|row| row / trace);
        (trace > 0.0).then(|| DMat3::from_cols(a, b, c))
    }
}

/// Returns the trace of the second moments of strand directions in a voxel: the total weight of the directions.
fn trace([xx, yy, zz, ..]: &[f32; 6]) -> f64 {
    f64::from(*xx) + f64::from(*yy) + f64::from(*zz)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(u: DVec3, weight: f64) -> [f32; 6] {
        [u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z].map(|m| (weight * m) as f32)
    }

    #[test]
    fn means_are_weighted_and_clamped_at_the_edge() {
        let affine = DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            glam::DQuat::IDENTITY,
            DVec3::new(5.0, 6.0, 7.0),
        );
        let values = vec![of(DVec3::X, 3.0), of(DVec3::Y, 1.0), [0.0; 6]];
        let moments = DirectionMoments::new([3, 1, 1], affine, values).unwrap();
        let at = |i: f64| moments.mean_at(affine.transform_point3(DVec3::new(i, 0.3, -0.4)));
        let diagonal = |x: f64, y: f64| DMat3::from_diagonal(DVec3::new(x, y, 0.0));
        assert_eq!(at(-0.5), Some(diagonal(1.0, 0.0)));
        assert_eq!(at(0.5), Some(diagonal(0.75, 0.25)));
        assert_eq!(at(1.75), Some(diagonal(0.0, 1.0)));
        assert_eq!((at(2.0), at(2.5)), (None, None));
        assert_eq!(moments.largest_trace(), 3.0);
        assert!(DirectionMoments::new([3, 1, 2], affine, moments.values().to_vec()).is_err());
        assert!(DirectionMoments::new([0, 1, 2], affine, Vec::new()).is_err());
    }
}
