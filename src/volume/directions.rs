//! Which way strands run through a volume: second moments of their directions on its grid.

use crate::error::{Error, Result};
use glam::{DAffine3, DMat3, DVec3};

/// Sums of `u u^T` over unit directions `u`, a voxel each, on the grid of a volume.
///
/// A strand has no sign: `u` and `-u` are one direction. Their sum vanishes, that of `u u^T` does not, and so it is this
/// symmetric matrix that is kept and interpolated. Divided by its trace it is the mean of `u u^T` there: `l^T m l` is the
/// mean square of the cosine between the strands and a unit `l`.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionMoments {
    dims: [usize; 3],
    index_from_world: DAffine3,
    values: Vec<[f32; 6]>,
}

impl DirectionMoments {
    /// Of `xx, yy, zz, xy, xz, yz` in world axes for each voxel, x fastest; the trace is what the directions weigh there, for
    /// strands their extinction in 1/mm.
    ///
    /// # Errors
    /// Another number of values than of voxels, or none.
    pub fn new(dims: [usize; 3], world_from_index: DAffine3, values: Vec<[f32; 6]>) -> Result<Self> {
        let [nx, ny, nz] = dims;
        if values.is_empty() || values.len() != nx * ny * nz {
            let why = format!("{} values for {nx}x{ny}x{nz} voxels", values.len());
            return Err(Error::runtime("cannot keep directions", "directions of strands", why));
        }
        Ok(Self { dims, index_from_world: world_from_index.inverse(), values })
    }

    /// Voxels along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// `xx, yy, zz, xy, xz, yz` of each voxel, x fastest.
    pub fn values(&self) -> &[[f32; 6]] {
        &self.values
    }

    /// The largest trace of a voxel.
    pub fn largest_trace(&self) -> f64 {
        self.values.iter().map(trace).fold(0.0, f64::max)
    }

    /// The mean of `u u^T` at `x` (world mm): moments trilinear between voxel centres and clamped at the edge, as the volume's
    /// value is, divided by their trace. `None` where there are no strands.
    pub fn mean_at(&self, x: DVec3) -> Option<DMat3> {
        let p = self.index_from_world.transform_point3(x);
        let along = |axis: usize| {
            let last = self.dims[axis] - 1;
            let p = p[axis].clamp(0.0, last as f64);
            let low = (p as usize).min(last);
            let w = p - low as f64;
            [(low, 1.0 - w), ((low + 1).min(last), w)]
        };
        let mut sum = [0.0; 6];
        for (k, wz) in along(2) {
            for (j, wy) in along(1) {
                for (i, wx) in along(0) {
                    let moments = &self.values[i + self.dims[0] * (j + self.dims[1] * k)];
                    let weight = wx * wy * wz;
                    sum.iter_mut().zip(moments).for_each(|(s, m)| *s += weight * f64::from(*m));
                }
            }
        }
        let [xx, yy, zz, xy, xz, yz] = sum;
        let trace = xx + yy + zz;
        let rows = [DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz)];
        let [a, b, c] = rows.map(|row| row / trace);
        (trace > 0.0).then(|| DMat3::from_cols(a, b, c))
    }
}

/// What the directions of a voxel weigh together.
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
    fn means_are_weighed_and_clamped_at_the_edge() {
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
