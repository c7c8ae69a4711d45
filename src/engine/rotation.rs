//! Scenes of a full rotation of the camera (turntable) or of the lights (light sweep).

use crate::scene::{Camera, Extent, Light, LightSource, Scene};
use glam::{DQuat, DVec3};

/// Object that rotates from one picture to the next: the camera or the lights. The rotation axis passes through the
/// camera's target along the camera's `up` vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rotation {
    /// Turntable: the camera rotates around its target.
    Camera,
    /// Light sweep: all lights rotate. Directional lights turn, and point lights move on circles around the axis.
    Lights,
}

impl Rotation {
    /// Maximum number of pictures in a full rotation, since their file names have four digits.
    pub const MAX_PICTURES: u32 = 10_000;

    /// Whether the rotation changes the scene. A light sweep changes nothing if every light lies on the rotation
    /// axis.
    pub fn changes(self, scene: &Scene) -> bool {
        let Camera { target, up, .. } = scene.camera;
        let is_off =
            |from_axis: DVec3| from_axis.cross(up).length() > 1e-9 * from_axis.length() * up.length();
        self == Self::Camera
            || scene.sources_shining().iter().filter(|source| source.extent != Extent::SKY).any(|source| {
                match (&source.extent, source.light) {
                    // A map turns about the z axis alone.
                    (Extent::Map(_), _) => up.z.abs() > 1e-9 * up.length(),
                    (_, Light::Directional { toward }) => is_off(toward),
                    (_, Light::Point { position }) => is_off(position - target),
                }
            })
    }

    /// Returns the scene with the camera or the lights rotated by an angle, degrees, counterclockwise as seen from the
    /// tip of the camera's `up` vector.
    pub fn rotated(self, scene: &Scene, angle_deg: f64) -> Scene {
        if angle_deg == 0.0 {
            return scene.clone();
        }
        let Camera { eye, target, up, .. } = scene.camera;
        let turn = DQuat::from_axis_angle(up.normalize(), angle_deg.to_radians());
        let around = |place: DVec3| target + turn * (place - target);
        match self {
            Self::Camera => Scene { camera: Camera { eye: around(eye), ..scene.camera }, ..scene.clone() },
            Self::Lights => {
                let turned = |source: &LightSource| source.clone().turned(turn, target);
                Scene { lights: scene.lights.iter().map(turned).collect(), ..scene.clone() }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;

    fn scene() -> Scene {
        let volume = Phantom::Slab.build(8).unwrap();
        let light = |light| LightSource { light, intensity: 0.5, ..LightSource::default() };
        let lights = [
            Light::Directional { toward: DVec3::new(0.6, 0.0, 0.8) },
            Light::Point { position: DVec3::new(11.0, 2.0, 8.0) },
        ];
        let camera = Camera {
            eye: DVec3::new(1.0, -8.0, 4.0),
            target: DVec3::new(1.0, 2.0, 3.0),
            up: DVec3::new(0.0, 0.0, 2.0),
            fov_deg: 30.0,
        };
        Scene { camera, lights: lights.map(light).to_vec(), ..Scene::framing(&volume) }
    }

    #[test]
    fn a_camera_goes_around_its_target_at_one_height_and_distance() {
        let scene = scene();
        let turned: Vec<Scene> =
            (0..8).map(|step| Rotation::Camera.rotated(&scene, 45.0 * f64::from(step))).collect();
        assert_eq!(turned[0], scene);
        // From the front (-y) counterclockwise to the right (+x).
        assert!((turned[2].camera.eye - DVec3::new(11.0, 2.0, 4.0)).length() < 1e-12);
        assert!((turned[4].camera.eye - DVec3::new(1.0, 12.0, 4.0)).length() < 1e-12);
        for other in &turned {
            assert_eq!(Scene { camera: scene.camera, ..other.clone() }, scene, "nothing else moves");
            let away = other.camera.eye - other.camera.target;
            assert!((away.length() - 101_f64.sqrt()).abs() < 1e-12 && (away.z - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn lights_go_around_the_same_axis() {
        let scene = scene();
        assert_eq!(Rotation::Lights.rotated(&scene, 0.0), scene);
        let quarter = Rotation::Lights.rotated(&scene, 90.0);
        assert_eq!((quarter.camera, quarter.lights[1].intensity), (scene.camera, 0.5));
        let [Light::Directional { toward }, Light::Point { position }] =
            [quarter.lights[0].light, quarter.lights[1].light]
        else {
            panic!("they stay what they are")
        };
        assert!((toward - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15);
        assert!((position - DVec3::new(1.0, 12.0, 8.0)).length() < 1e-12);
        let above = |z| scene.under(Light::Point { position: DVec3::new(1.0, 2.0, z) }.into());
        assert!(Rotation::Lights.changes(&scene) && Rotation::Camera.changes(&above(90.0)));
        assert!(![90.0, -90.0, 3.0].into_iter().any(|z| Rotation::Lights.changes(&above(z))));
    }
}
