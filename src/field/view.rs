//! View of a camera: the part of a volume in which a picture needs shadows.

use crate::scene::{Camera, Scene};
use glam::{DAffine3, DVec3};

/// Camera with the shape and size of its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    camera: Camera,
    /// Width of the picture by its height.
    aspect: f64,
    /// Rows of the picture.
    height: u32,
    /// Margin that a map covers on each side, as a share of the view: a camera that moves slightly stays within it.
    pub(super) margin: f64,
}

impl View {
    /// View of a scene's picture, without a margin.
    pub fn of(scene: &Scene) -> Self {
        let aspect = f64::from(scene.width) / f64::from(scene.height);
        Self { camera: scene.camera, aspect, height: scene.height, margin: 0.0 }
    }

    /// View in which the shadows of a scene's picture are needed; `None`: everywhere. Lookups on a mesh lie
    /// outside the active bricks, and their occluders need not be in the view.
    pub fn of_shadows(scene: &Scene) -> Option<Self> {
        scene.mesh.is_none().then(|| Self::of(scene))
    }

    /// Widens the view so that it contains another picture of the same camera.
    #[must_use]
    pub fn holding(self, other: &Scene) -> Self {
        Self { aspect: self.aspect.max(Self::of(other).aspect), ..self }
    }

    /// Sets the margin.
    #[must_use]
    pub fn with_margin(self, margin: f64) -> Self {
        Self { margin, ..self }
    }

    /// Frustum of the view in coordinates that `world_from` maps to world mm.
    pub fn frustum(&self, world_from: &DAffine3) -> Frustum {
        let frame = self.camera.frame();
        // Rounding on the device moves rays slightly.
        let up = 1.001 * (0.5 * self.camera.fov_deg.to_radians()).tan();
        let right = up * self.aspect;
        let outwards = [
            -frame.forward,
            frame.right - right * frame.forward,
            -frame.right - right * frame.forward,
            frame.up - up * frame.forward,
            -frame.up - up * frame.forward,
        ];
        let m = world_from.matrix3.transpose();
        let from_eye = world_from.translation - self.camera.eye;
        Frustum(outwards.map(|n| (m * n, n.dot(from_eye))))
    }

    /// Unit direction of the view.
    pub(super) fn forward(&self) -> DVec3 {
        self.camera.frame().forward
    }

    /// Width of a pixel on a plane through a world point, mm.
    pub(super) fn pixel_mm(&self, world: DVec3) -> f64 {
        let distance = (world - self.camera.eye).dot(self.camera.frame().forward);
        2.0 * (0.5 * self.camera.fov_deg.to_radians()).tan() * distance.max(0.0) / f64::from(self.height)
    }
}

/// View frustum as planes: outward normal, and distance of the origin along it.
#[derive(Debug, Clone, Copy)]
pub struct Frustum([(DVec3, f64); 5]);

impl Frustum {
    /// Tests a box conservatively: `false` if it lies beyond one plane as a whole.
    pub fn may_intersect(&self, center: DVec3, half: DVec3) -> bool {
        !self.0.iter().any(|(normal, origin)| normal.dot(center) + origin > normal.abs().dot(half))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;

    #[test]
    fn boxes_beyond_a_side_are_not_visible() {
        let volume = Phantom::Slab.build(8).unwrap();
        let camera = Camera { eye: DVec3::ZERO, target: DVec3::Y, up: DVec3::Z, fov_deg: 90.0 };
        let scene = Scene { camera, width: 200, height: 100, ..Scene::framing(&volume) };
        let view = View::of(&scene);
        let frustum = view.frustum(&DAffine3::IDENTITY);
        let shows = |x: f64, y: f64, z: f64| frustum.may_intersect(DVec3::new(x, y, z), DVec3::splat(0.5));
        assert!(shows(0.0, 10.0, 0.0) && shows(19.0, 10.0, 9.0) && shows(0.0, 0.0, 0.0));
        assert!(!shows(0.0, -10.0, 0.0) && !shows(23.0, 10.0, 0.0) && !shows(0.0, 10.0, -12.0));
        // 100 rows span twice the distance.
        assert!((view.pixel_mm(DVec3::new(5.0, 50.0, 5.0)) - 1.0).abs() < 1e-12);
        // The same boxes are visible in other coordinates.
        let moved = view.frustum(&DAffine3::from_translation(DVec3::new(0.0, -20.0, 0.0)));
        assert!(moved.may_intersect(DVec3::new(0.0, 30.0, 0.0), DVec3::ONE));
        assert!(!moved.may_intersect(DVec3::new(0.0, 10.0, 0.0), DVec3::ONE));
    }
}
