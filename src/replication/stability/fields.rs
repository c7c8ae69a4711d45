//! Building blocks of the stability cases: small scalar fields, transfer functions and lights.

use crate::error::Result;
use crate::scene::Light;
use crate::transfer::{Quantity, TransferFunction};
use crate::volume::{Provenance, Scaling, Volume, Voxels};
use glam::{DAffine3, DMat3, DVec3};
use ndarray::Array3;
use std::sync::Arc;

/// A volume of float32 values `f(i, j, k)` of `dims` voxels.
pub fn volume_under(
    world_from_index: DAffine3,
    dims: [usize; 3],
    f: impl Fn(DVec3) -> f64,
) -> Result<Arc<Volume>> {
    let [nx, ny, nz] = dims;
    let voxels =
        Array3::from_shape_fn((nz, ny, nx), |(k, j, i)| f(DVec3::new(i as f64, j as f64, k as f64)) as f32);
    let provenance = Provenance::new("stability case", "phantom", "float32");
    Ok(Arc::new(Volume::new(Voxels::F32(voxels), Scaling::IDENTITY, world_from_index, provenance)?))
}

/// A volume of float32 values `f(i, j, k)` with voxels of 1 mm.
pub fn volume(dims: [usize; 3], f: impl Fn(DVec3) -> f64) -> Result<Arc<Volume>> {
    volume_under(DAffine3::IDENTITY, dims, f)
}

/// Voxels of the given spacing, mm.
pub fn spacing(mm: [f64; 3]) -> DAffine3 {
    DAffine3::from_mat3(DMat3::from_diagonal(DVec3::from_array(mm)))
}

/// Voxels a side of most cases.
pub const SIDE: usize = 24;

pub fn middle() -> DVec3 {
    DVec3::splat(0.5 * (SIDE as f64 - 1.0))
}

/// A ball whose value falls from 1 in the middle to 0 at 11 voxels, uneven by some percent.
pub fn ball(p: DVec3) -> f64 {
    let uneven = (1.7 * p.x).sin() * (2.3 * p.y).cos() * (1.3 * p.z).sin();
    ((1.0 - p.distance(middle()) / 11.0) + 0.06 * uneven).clamp(0.0, 1.0)
}

/// Values of no order, in `[0, 1]`.
pub fn rough(p: DVec3) -> f64 {
    (p.x * 37.0 + p.y * 11.0 + p.z * 23.0) % 101.0 / 100.0
}

/// A ball of radius 9 voxels whose wall is one voxel thick.
pub fn shell(p: DVec3) -> f64 {
    (1.0 - (p.distance(middle()) - 9.0).abs()).max(0.0)
}

/// Extinction (1/mm) by value.
pub fn extinction(points: &[(f64, f64)]) -> TransferFunction {
    transfer(Quantity::Extinction, points)
}

/// Opacity a mm by value.
pub fn opacity(points: &[(f64, f64)]) -> TransferFunction {
    transfer(Quantity::Opacity, points)
}

fn transfer(quantity: Quantity, points: &[(f64, f64)]) -> TransferFunction {
    let mut tf =
        TransferFunction { name: "stability case".into(), ..TransferFunction::new(quantity, points) };
    tf.points.iter_mut().for_each(|p| p.color = [1.0, 0.8, 0.6]);
    tf
}

/// The transfer function of the ordinary case, for values from 0 to `top`.
pub fn haze(top: f64) -> TransferFunction {
    extinction(&[(0.1 * top, 0.0), (top, 0.3)])
}

/// A light at infinity, in no special direction.
pub fn directional() -> Light {
    Light::Directional { toward: DVec3::new(0.4, -0.5, 0.75) }
}

/// Lights along a direction of world space.
pub fn along(x: f64, y: f64, z: f64) -> Light {
    Light::Directional { toward: DVec3::new(x, y, z) }
}

/// A point light at a world position, mm.
pub fn point(position: DVec3) -> Light {
    Light::Point { position }
}

/// Both kinds of light, the point light well outside the volume.
pub fn both(volume: &Volume) -> Vec<(&'static str, Light)> {
    let corners = volume.corners_mm();
    let center = corners.iter().sum::<DVec3>() / 8.0;
    let radius = corners.iter().map(|c| c.distance(center)).fold(0.0, f64::max);
    let position = center + DVec3::new(-0.6, 0.35, 0.7).normalize() * 3.0 * radius;
    vec![("directional light", directional()), ("point light", point(position))]
}
