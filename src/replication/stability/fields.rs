//! Scalar fields that fill the volumes of the stability cases.

use crate::error::Result;
use crate::volume::{Provenance, Scaling, Volume, Voxels};
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use serde::Deserialize;
use std::sync::Arc;

/// Number of voxels along each side of the volume, in most stability cases.
pub const SIDE: usize = 24;

/// Scalar field that fills the volume of a stability case, as a function of voxel indices. Values lie in `[0, 1]`,
/// except in the three fields with spikes, NaN or infinities.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Field {
    /// Field of a ball: value 1 at its centre, 0 at a radius of 11 voxels, with a few percent of irregularity.
    #[default]
    Ball,
    /// Uniform scalar field with the value 0.5.
    Constant,
    /// Rough scalar field whose values vary irregularly from voxel to voxel.
    Rough,
    /// Half space as a scalar field: 1 where z < 12 voxels, 0 elsewhere.
    HalfSpace,
    /// Scalar field of alternating layers of 0 and 1 along x, each one voxel thick.
    LayersX,
    /// Scalar field of alternating layers of 0 and 1 along z, each one voxel thick.
    LayersZ,
    /// Scalar field of a spherical shell with a radius of 9 voxels and a wall of one voxel.
    Shell,
    /// Scalar field of a solid ball with a radius of 8 voxels.
    SolidBall,
    /// Scalar field of two square columns along z that meet only at the edge x = y = 3 voxels.
    Columns,
    /// Scalar field with rough values in two opposite corners of a grid of 48 voxels per side, 0 elsewhere.
    Corners,
    /// Scalar field of an oblique plane sheet, one voxel thick.
    Sheet,
    /// Scalar field of a column of 8 x 8 voxels below z = 12 voxels.
    Block,
    /// Scalar field of isolated voxels of value 1, each surrounded by 0.
    LoneVoxels,
    /// Scalar field of a ball with a single voxel of value 1e6 at its centre.
    Outlier,
    /// Scalar field of a ball in which some voxels are NaN.
    Nan,
    /// Scalar field of a ball in which some voxels are positive or negative infinity.
    Infinities,
}

impl Field {
    /// Returns the value of the scalar field at a voxel index.
    fn at(self, p: DVec3) -> f64 {
        let middle = DVec3::splat(0.5 * (SIDE as f64 - 1.0));
        let from_middle = p.distance(middle);
        let ball = || {
            let uneven = (1.7 * p.x).sin() * (2.3 * p.y).cos() * (1.3 * p.z).sin();
            ((1.0 - from_middle / 11.0) + 0.06 * uneven).clamp(0.0, 1.0)
        };
        let rough = (p.x * 37.0 + p.y * 11.0 + p.z * 23.0) % 101.0 / 100.0;
        let with_holes = |bad: [f64; 2]| match (p.x * 5.0 + p.y * 3.0 + p.z) as usize % 17 {
            0 => bad[0],
            8 => bad[1],
            _ => ball(),
        };
        let flag = |inside: bool| f64::from(u8::from(inside));
        let column = |low: f64| (low..=low + 1.0).contains(&p.x) && (low..=low + 1.0).contains(&p.y);
        match self {
            Self::Ball => ball(),
            Self::Constant => 0.5,
            Self::Rough => rough,
            Self::HalfSpace => flag(p.z < 12.0),
            Self::LayersX => p.x % 2.0,
            Self::LayersZ => p.z % 2.0,
            Self::Shell => (1.0 - (from_middle - 9.0).abs()).max(0.0),
            Self::SolidBall => flag(from_middle < 8.0),
            Self::Columns => flag(column(1.0) || column(4.0)),
            Self::Corners if p.max_element() <= 2.0 || p.min_element() >= 45.0 => 0.5 + 0.5 * rough,
            Self::Corners => 0.0,
            Self::Sheet => flag(p.x + p.y + p.z == 37.0),
            Self::Block => flag(p.x.min(p.y) >= 8.0 && p.x.max(p.y) < 16.0 && p.z < 12.0),
            Self::LoneVoxels => flag(p.x % 2.0 + p.y % 2.0 + p.z % 2.0 == 3.0),
            Self::Outlier if p == DVec3::splat(12.0) => 1e6,
            Self::Outlier => ball(),
            Self::Nan => with_holes([f64::NAN; 2]),
            Self::Infinities => with_holes([f64::INFINITY, f64::NEG_INFINITY]),
        }
    }

    /// Creates a float32 volume of `dims` voxels from the scalar field. The field's values 0 and 1 become the voxel
    /// values `low` and `high`.
    pub fn volume(
        self,
        world_from_index: DAffine3,
        [nx, ny, nz]: [usize; 3],
        [low, high]: [f64; 2],
    ) -> Result<Arc<Volume>> {
        let value = |(k, j, i)| low + (high - low) * self.at(DVec3::new(i as f64, j as f64, k as f64));
        let voxels = Array3::from_shape_fn((nz, ny, nx), |index: (usize, usize, usize)| value(index) as f32);
        let provenance = Provenance::new("stability case", "phantom", "float32");
        Ok(Arc::new(Volume::new(Voxels::F32(voxels), Scaling::IDENTITY, world_from_index, provenance)?))
    }
}
