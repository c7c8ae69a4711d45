//! View of a camera, which determines the part of a volume in which a picture needs shadows.

use crate::scene::{Camera, Scene};
use glam::{DAffine3, DVec3};

/// Camera with the aspect ratio and the pixel height of its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    camera: Camera,
    /// Width of the picture divided by its height.
    aspect: f64,
    /// Height of the picture in pixels.
    height: u32,
    /// Margin by which a shadow map extends beyond the camera view on each side, as a share of the view. The map then
    /// remains valid while the camera moves slightly.
    pub(super) margin: f64,
}

impl View {
    /// Returns the view of a scene's camera and picture, without a margin.
    pub fn of(scene: &Scene) -> Self {
        let aspect = f64::from(scene.width) / f64::from(scene.height);
        Self { camera: scene.camera, aspect, height: scene.height, margin: 0.0 }
    }

    /// Returns the camera view to which the shadow maps of a scene may be limited; `None` if shadows are needed
    /// everywhere. The latter holds for a scene with a mesh, whose occluders may lie outside the view.
    pub fn of_shadows(scene: &Scene) -> Option<Self> {
        scene.mesh.is_none().then(|| Self::of(scene))
    }

    /// Whether this view contains another one with the same camera.
    pub fn holds(&self, other: &Self) -> bool {
        self.camera == other.camera && self.aspect >= other.aspect
    }

    /// Widens this camera view so that it also contains the picture of another scene with the same camera.
    #[must_use]
    pub fn holding(self, other: &Scene) -> Self {
        Self { aspect: self.aspect.max(Self::of(other).aspect), ..self }
    }

    /// Sets the margin by which a shadow map extends beyond the camera view on each side, as a share of the view.
    #[must_use]
    pub fn with_margin(self, margin: f64) -> Self {
        Self { margin, ..self }
    }

    /// Returns the view frustum of the camera in other coordinates; `world_from` maps these to world coordinates
    /// (mm).
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

    /// Returns unit vectors along eye rays: the view direction, and the rays through the corners of the picture.
    pub fn ray_directions(&self) -> Vec<DVec3> {
        let frame = self.camera.frame();
        let up = (1.0 + self.margin) * (0.5 * self.camera.fov_deg.to_radians()).tan();
        let corner = |x: f64, y: f64| frame.forward + up * (x * self.aspect * frame.right + y * frame.up);
        let corners = [(0.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        corners.map(|(x, y)| corner(x, y).normalize()).to_vec()
    }

    /// Returns the unit vector of the view direction.
    pub(super) fn forward(&self) -> DVec3 {
        self.camera.frame().forward
    }

    /// Returns the width of a picture's pixel at the distance of a world point from the camera, mm.
    pub(super) fn pixel_mm(&self, world: DVec3) -> f64 {
        let distance = (world - self.camera.eye).dot(self.camera.frame().forward);
        2.0 * (0.5 * self.camera.fov_deg.to_radians()).tan() * distance.max(0.0) / f64::from(self.height)
    }
}

/// View frustum of a camera as five planes, each with its outward normal and the distance of the origin along it.
#[derive(Debug, Clone, Copy)]
pub struct Frustum([(DVec3, f64); 5]);

impl Frustum {
    /// Tests conservatively whether a box may intersect the view frustum: `false` only if the whole box lies beyond
    /// one plane.
    pub fn may_intersect(&self, center: DVec3, half: DVec3) -> bool {
        !self.0.iter().any(|plane| is_beyond(plane, center, half))
    }

    /// Whether all points lie inside the view frustum.
    pub fn contains(&self, points: &[DVec3]) -> bool {
        points.iter().all(|p| self.0.iter().all(|(normal, origin)| normal.dot(*p) + origin <= 0.0))
    }

    /// Returns the first and the last box of a row that may intersect the view frustum, given first and last of the row;
    /// `None` if there is none. `at` returns centre and half size of a box; the lower and the upper sides of the boxes
    /// rise along the row.
    pub fn clip_row(&self, row: [u32; 2], at: impl Fn(u32) -> [DVec3; 2]) -> Option<[u32; 2]> {
        let [mut first, mut last] = row;
        for plane in &self.0 {
            let beyond = |i: u32| {
                let [center, half] = at(i);
                is_beyond(plane, center, half)
            };
            match [beyond(first), beyond(last)] {
                [false, false] => {}
                [true, true] => return None,
                [true, false] => first = first_change(first, last, beyond),
                [false, true] => last = first_change(first, last, beyond) - 1,
            }
        }
        (first <= last).then_some([first, last])
    }
}

/// Whether a box lies entirely beyond a plane of a frustum.
fn is_beyond((normal, origin): &(DVec3, f64), center: DVec3, half: DVec3) -> bool {
    normal.dot(center) + origin > normal.abs().dot(half)
}

/// Returns the smallest index above `first` at which a condition differs from that at `first`. It changes once up to
/// `last`.
fn first_change(mut first: u32, mut last: u32, condition: impl Fn(u32) -> bool) -> u32 {
    let before = condition(first);
    while last - first > 1 {
        let middle = first.midpoint(last);
        if condition(middle) == before { first = middle } else { last = middle }
    }
    last
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

    #[test]
    fn a_clipped_row_has_the_boxes_that_may_be_visible() {
        let scene = Scene::framing(&Phantom::Slab.build(8).unwrap());
        let mut random = fastrand::Rng::with_seed(5);
        let mut vector = |scale: f64| DVec3::from_array([0; 3].map(|_| scale * (random.f64() - 0.5)));
        let (mut none, mut part, mut inside) = (0, 0, 0);
        for _ in 0..2000 {
            let camera = Camera { eye: vector(40.0), target: vector(20.0), ..scene.camera };
            let frustum = View::of(&Scene { camera, ..scene.clone() }).frustum(&DAffine3::IDENTITY);
            let (corner, half) = (vector(30.0), DVec3::splat(0.5));
            // The last box is cut, as at the border of a volume.
            let at = |i: u32| {
                let cut = if i == 19 { DVec3::new(0.3, 0.0, 0.0) } else { DVec3::ZERO };
                [corner + DVec3::new(f64::from(i), 0.0, 0.0) - cut, half - cut]
            };
            let visible = |i: &u32| frustum.may_intersect(at(*i)[0], at(*i)[1]);
            let expected: Vec<u32> = (3..20).filter(visible).collect();
            let found = frustum.clip_row([3, 19], at).map_or(Vec::new(), |[a, b]| (a..=b).collect());
            assert_eq!(found, expected);
            none += usize::from(found.is_empty());
            part += usize::from((1..17).contains(&found.len()));
            let corners = [at(3)[0] - half, at(19)[0] + half];
            assert!(!frustum.contains(&corners) || found.len() == 17);
            inside += usize::from(frustum.contains(&corners));
        }
        assert!(none > 100 && part > 100 && inside > 10, "{none} {part} {inside}");
    }
}
