//! Pictures one after another, each as it is drawn alone: a camera that goes around, lights that do. What the next one
//! would make just the same is kept.

use crate::error::Result;
use crate::field::View;
use crate::render::{Picture, Session};
use crate::scene::{Camera, Light, LightSource, Scene};
use crate::shadow::{Method, NoShadows, ShadowMap};
use glam::{DQuat, DVec3};

/// What turns from one picture to the next, around the axis through the camera's target along its `up`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turning {
    /// A turntable: what is seen seems to turn the other way.
    Camera,
    /// Every light: directions turn, points go around the axis.
    Lights,
}

/// A scene of a turn.
#[derive(Debug, Clone, PartialEq)]
pub struct Turned {
    /// How far the camera or the lights have turned, degrees, counterclockwise as seen from the tip of `up`.
    pub angle_deg: f64,
    /// The scene there.
    pub scene: Scene,
}

impl Turning {
    /// The most pictures of a turn: four digits number them.
    pub const MOST: u32 = 10_000;

    /// The scenes of a whole turn in so many equal steps; the first is `scene` itself.
    pub fn scenes(self, scene: &Scene, count: u32) -> impl ExactSizeIterator<Item = Turned> {
        let scene = scene.clone();
        (0..count).map(move |step| {
            let angle_deg = 360.0 * f64::from(step) / f64::from(count);
            Turned { angle_deg, scene: self.turned(&scene, angle_deg) }
        })
    }

    /// Whether the scenes of a turn differ: they do not where every light that shines is on the axis.
    pub fn changes(self, scene: &Scene) -> bool {
        let Camera { target, up, .. } = scene.camera;
        let is_off =
            |from_axis: DVec3| from_axis.cross(up).length() > 1e-9 * from_axis.length() * up.length();
        self == Self::Camera
            || scene.shining().iter().any(|source| match source.light {
                Light::Directional { toward } => is_off(toward),
                Light::Point { position } => is_off(position - target),
            })
    }

    /// The scene with the camera or its lights turned so far, degrees.
    pub fn turned(self, scene: &Scene, angle_deg: f64) -> Scene {
        if angle_deg == 0.0 {
            return scene.clone();
        }
        let Camera { eye, target, up, .. } = scene.camera;
        let turn = DQuat::from_axis_angle(up.normalize(), angle_deg.to_radians());
        let around = |place: DVec3| target + turn * (place - target);
        match self {
            Self::Camera => Scene { camera: Camera { eye: around(eye), ..scene.camera }, ..scene.clone() },
            Self::Lights => {
                let light = |light: Light| match light {
                    Light::Directional { toward } => {
                        Light::Directional { toward: (turn * toward).normalize() }
                    }
                    Light::Point { position } => Light::Point { position: around(position) },
                };
                let turned = |source: &LightSource| LightSource { light: light(source.light), ..*source };
                Scene { lights: scene.lights.iter().map(turned).collect(), ..scene.clone() }
            }
        }
    }
}

/// A picture of a sequence.
pub struct DrawnPicture {
    /// The picture.
    pub picture: Picture,
    /// Shadow structures that were built for it.
    pub built: usize,
    /// Those that were there from the pictures before.
    pub kept: usize,
    /// What those that were built took, ms, by the better clock; 0 where none was.
    pub build_ms: f64,
}

/// A structure that is kept.
struct Held {
    light: Light,
    /// Whether the scene needed it; where none did, an empty structure stands in.
    needed: bool,
    map: ShadowMap,
}

/// Draws scenes of one volume by one method. Where [`ShadowCache`](super::ShadowCache) takes a map that is good enough for what the
/// camera sees now, this takes the one that a picture by itself is drawn with: each has the pixels that it would have alone.
pub struct Sequence<'a> {
    session: &'a Session,
    method: &'a dyn Method,
    held: Vec<Held>,
}

impl<'a> Sequence<'a> {
    /// Nothing yet.
    pub fn new(session: &'a Session, method: &'a dyn Method) -> Self {
        Self { session, method, held: Vec::new() }
    }

    /// Draws the next scene. Structures are made for each light that shines unless the scene before has had the very same:
    /// under another light, and fitted to another view, they are not. Where nothing can be kept from any light none is made.
    ///
    /// # Errors
    /// As [`Session::shadows_of`] and [`Session::render`].
    pub fn draw(&mut self, scene: &Scene) -> Result<DrawnPicture> {
        let (built, build_ms) = self.prepare(scene)?;
        let picture = self.session.render(self.shadows(), scene)?;
        Ok(DrawnPicture { picture, built, kept: self.held.len() - built, build_ms })
    }

    /// The structures of the scene that was drawn last: one for each light that shines, in their order.
    pub fn shadows(&self) -> Vec<&ShadowMap> {
        self.held.iter().map(|held| &held.map).collect()
    }

    /// Makes the structures of a scene; how many had to be built, and what that took.
    fn prepare(&mut self, scene: &Scene) -> Result<(usize, f64)> {
        let Self { session, method, .. } = *self;
        let needed = session.needs_shadows(scene).is_ok();
        let method = if needed { method } else { &NoShadows };
        let view = View::of_shadows(scene);
        let (volume, active) = (&session.loaded.volume, &session.transfer.active);
        let lights: Vec<Light> = scene.shining().iter().map(|source| source.light).collect();
        // What no longer serves makes room before anything is built.
        self.held.retain(|held| {
            let space = &held.map.light_space;
            held.needed == needed
                && lights.contains(&held.light)
                && space.is_fitted_to(volume, active, held.light, view.as_ref())
        });
        let mut before = std::mem::take(&mut self.held);
        let (mut built, mut build_ms) = (0, 0.0);
        for light in lights {
            let held = match before.iter().position(|held| held.light == light) {
                Some(place) => before.swap_remove(place),
                None => {
                    let map = session.shadow_of(method, scene, light)?;
                    built += 1;
                    build_ms += map.report.build_ms();
                    Held { light, needed, map }
                }
            };
            self.held.push(held);
        }
        Ok((built, build_ms))
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
        let turned: Vec<Turned> = Turning::Camera.scenes(&scene, 8).collect();
        assert_eq!(turned.len(), 8);
        assert_eq!(turned[0], Turned { angle_deg: 0.0, scene: scene.clone() });
        // From the front (-y) counterclockwise to the right (+x).
        assert_eq!(turned[2].angle_deg, 90.0);
        assert!((turned[2].scene.camera.eye - DVec3::new(11.0, 2.0, 4.0)).length() < 1e-12);
        assert!((turned[4].scene.camera.eye - DVec3::new(1.0, 12.0, 4.0)).length() < 1e-12);
        for Turned { scene: other, .. } in &turned {
            assert_eq!(Scene { camera: scene.camera, ..other.clone() }, scene, "nothing else moves");
            let away = other.camera.eye - other.camera.target;
            assert!((away.length() - 101_f64.sqrt()).abs() < 1e-12 && (away.z - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn lights_go_around_the_same_axis() {
        let scene = scene();
        let turned: Vec<Turned> = Turning::Lights.scenes(&scene, 4).collect();
        assert_eq!(turned[0].scene, scene);
        let Turned { angle_deg, scene: quarter } = &turned[1];
        assert_eq!((*angle_deg, quarter.camera, quarter.lights[1].intensity), (90.0, scene.camera, 0.5));
        let [Light::Directional { toward }, Light::Point { position }] =
            [quarter.lights[0].light, quarter.lights[1].light]
        else {
            panic!("they stay what they are")
        };
        assert!((toward - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15);
        assert!((position - DVec3::new(1.0, 12.0, 8.0)).length() < 1e-12);
        assert_eq!(Turning::Lights.scenes(&scene, 1).len(), 1);
        let above = |z| scene.under(Light::Point { position: DVec3::new(1.0, 2.0, z) }.into());
        assert!(Turning::Lights.changes(&scene) && Turning::Camera.changes(&above(90.0)));
        assert!(![90.0, -90.0, 3.0].into_iter().any(|z| Turning::Lights.changes(&above(z))));
    }
}
