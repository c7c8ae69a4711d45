//! Projection of bricks (blocks of voxel cells) into a picture, as spheres.

use crate::field::{ActiveBricks, grid_from_world};
use crate::scene::Scene;
use crate::volume::{BRICK_CELLS, Volume};
use glam::{DMat3, DVec3};

/// Factor by which the bounding spheres of bricks (blocks of voxel cells) are enlarged, for the float32 errors of eye
/// rays and of the projection on the device.
const ROUNDING: f64 = 1.01;
/// Margin around the projection of a brick (block of voxel cells) into the picture, in pixels.
pub const PIXELS_AROUND: f64 = 1.0;

/// Projection of the bricks of a volume into the picture of a camera. Each brick is replaced by a sphere around it.
#[derive(Debug, Clone, Copy)]
pub struct BrickProjection {
    /// Sides of a brick (block of voxel cells) in the camera's axes (right, up, forward), mm.
    pub brick: DMat3,
    /// Centre of the first brick (block of voxel cells), from the eye in the camera's axes, mm.
    pub first_center: DVec3,
    /// Radius of the sphere around a brick (block of voxel cells), mm.
    pub radius_mm: f64,
    /// Whether the eye lies in or next to an active brick (block of cells with extinction): it then sees inner bricks
    /// as well.
    pub inside: bool,
    /// Number of pixels along each axis for a tangent of 1.
    pub pixels_per_tangent: [f64; 2],
    /// Width and height of the picture in pixels.
    pub size: [f64; 2],
}

impl BrickProjection {
    /// Returns the projection of a volume's bricks into the picture of a scene.
    pub fn of(scene: &Scene, volume: &Volume, active: &ActiveBricks) -> Self {
        let frame = scene.camera.frame();
        let grid_from_world = grid_from_world(volume);
        let world_from_grid = grid_from_world.inverse();
        // World vectors in the camera's axes, mm.
        let axes = DMat3::from_cols(frame.right, frame.up, frame.forward).transpose();
        let brick = axes * world_from_grid.matrix3 * BRICK_CELLS as f64;
        let first = world_from_grid.transform_point3(DVec3::splat(0.5 * BRICK_CELLS as f64));
        let diagonals = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
        let radius =
            diagonals.map(|[y, z]| (brick * DVec3::new(1.0, y, z)).length()).into_iter().fold(0.0, f64::max);
        let eye = grid_from_world.transform_point3(scene.camera.eye) / BRICK_CELLS as f64;
        let up = (0.5 * scene.camera.fov_deg.to_radians()).tan();
        let [width, height] = [scene.width, scene.height].map(f64::from);
        Self {
            brick,
            first_center: axes * (first - scene.camera.eye),
            radius_mm: 0.5 * ROUNDING * radius,
            inside: active.distance_at(eye.floor().as_ivec3()).is_some_and(|d| d <= 1),
            pixels_per_tangent: [0.5 * width / (up * width / height), 0.5 * height / up],
            size: [width, height],
        }
    }
}
