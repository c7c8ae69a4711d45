//! Flicker of shadows: how much the error of a shadow method at fixed points varies while the light or the camera moves in
//! small steps.

use super::errors::{VisiblePoints, VisiblePointsByLight};
use super::job::Job;
use crate::error::Result;
use crate::exact::ExactField;
use crate::render::Session;
use crate::scene::{Camera, Extent, Light, LightSource, Scene};
use crate::shadow::Method;
use glam::{DQuat, DVec3};

/// Largest number of points at which flicker is measured, over all lights.
pub(super) const FLICKER_POINTS: usize = 2000;
/// Rotation of the light, and of the camera, in each step, degrees.
const STEP_DEG: f64 = 0.1;

/// Points visible to the camera in a scene, with their exact transmittances while the light moves.
pub(super) struct FlickerReference {
    /// Scenes with the light moved, and the exact transmittances of the points of each light.
    light_steps: Vec<(Scene, Vec<Vec<f64>>)>,
    /// Scenes with the camera moved.
    camera_steps: Vec<Scene>,
    /// Whether each point of each light lies in all pictures of the moving camera.
    in_all_pictures: Vec<Vec<bool>>,
}

/// Flicker of a shadow method: root mean square, over points, of the standard deviation of its error over the steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Flicker {
    /// Flicker while the light moves; `None` where no point is visible.
    pub light_rms: Option<f64>,
    /// Flicker while the camera moves; `None` where no point stays in the picture, and for random methods.
    pub camera_rms: Option<f64>,
}

impl FlickerReference {
    /// Computes the exact transmittances at points visible to the camera, for several positions of the light. Light and
    /// camera turn about the middle of the volume and about the camera's target. `progress` is called between steps, and
    /// may end the measurement.
    ///
    /// # Errors
    /// `progress` ends the measurement.
    pub fn new(
        field: &ExactField,
        job: &Job,
        visible: &VisiblePointsByLight,
        progress: &mut dyn FnMut() -> Result<()>,
    ) -> Result<Self> {
        let scene = job.scene;
        let middle_mm = job.volume.center_mm();
        let angles = || (0..job.effort.flicker).map(|step| (step as f64 * STEP_DEG).to_radians());
        let mut light_steps = Vec::new();
        for angle in angles() {
            progress()?;
            let mut moved = scene.clone();
            moved.lights.iter_mut().for_each(|source| *source = turned(source, middle_mm, angle));
            let sources = moved.sources_shining();
            let parts = visible.parts().iter().zip(&sources);
            let exact =
                parts.map(|(part, source)| field.transmittances_from(part.points_mm(), source).0).collect();
            light_steps.push((moved, exact));
        }
        let camera_steps: Vec<Scene> =
            angles().map(|angle| Scene { camera: orbited(&scene.camera, angle), ..scene.clone() }).collect();
        let stays = |point: &DVec3| camera_steps.iter().all(|scene| is_in_picture(scene, *point));
        let of_part = |part: &VisiblePoints| part.points_mm().iter().map(stays).collect();
        let in_all_pictures = visible.parts().iter().map(of_part).collect();
        Ok(Self { light_steps, camera_steps, in_all_pictures })
    }

    /// Measures the flicker of a shadow method. `progress` is called between steps, and may end the measurement.
    ///
    /// # Errors
    /// A map does not fit on the device, the device is lost, or `progress` ends the measurement.
    pub fn measure(
        &self,
        method: &dyn Method,
        session: &Session,
        visible: &VisiblePointsByLight,
        progress: &mut dyn FnMut() -> Result<()>,
    ) -> Result<Flicker> {
        let weights: Vec<f64> =
            visible.parts().iter().flat_map(|part| part.weights().iter().copied()).collect();
        let mut moved_light = Scatter::of(weights.len());
        for (scene, exact) in &self.light_steps {
            progress()?;
            let answers = visible.transmittances(session, &session.shadows_of(method, scene)?)?;
            moved_light.add(answers.iter().zip(exact.iter().flatten()).map(|(t, exact)| t - exact));
        }
        let mut moved_camera = Scatter::of(weights.len());
        // Random numbers depend on the point, and points do not move with the camera.
        let camera_steps = if method.reseeded(0).is_some() { &[][..] } else { &self.camera_steps };
        for scene in camera_steps {
            progress()?;
            let shadows = session.shadows_of(method, scene)?;
            moved_camera.add(visible.weighted(session, &shadows)?.into_iter().map(|(error, _)| error));
        }
        let staying = self
            .in_all_pictures
            .iter()
            .flatten()
            .zip(&weights)
            .map(|(stays, w)| if *stays { *w } else { 0.0 });
        Ok(Flicker {
            light_rms: moved_light.rms(weights.iter().copied()),
            camera_rms: moved_camera.rms(staying),
        })
    }
}

/// Sums of the errors at points over several steps.
struct Scatter {
    steps: f64,
    /// Mean and sum of squared differences from it, for each point (Welford 1962).
    of_points: Vec<[f64; 2]>,
}

impl Scatter {
    fn of(points: usize) -> Self {
        Self { steps: 0.0, of_points: vec![[0.0; 2]; points] }
    }

    fn add(&mut self, errors: impl Iterator<Item = f64>) {
        self.steps += 1.0;
        for ([mean, squares], error) in self.of_points.iter_mut().zip(errors) {
            let deviation = error - *mean;
            *mean += deviation / self.steps;
            *squares += deviation * (error - *mean);
        }
    }

    /// Returns the root of the weighted mean of the variances of the points; `None` without weight or with one step.
    fn rms(&self, weights: impl Iterator<Item = f64>) -> Option<f64> {
        let (sum, all) =
            self.of_points.iter().zip(weights).fold((0.0, 0.0), |(sum, all), ([_, squares], weight)| {
                (sum + weight * squares, all + weight)
            });
        (all > 0.0 && self.steps > 1.0).then(|| (sum / (all * (self.steps - 1.0))).sqrt())
    }
}

/// Returns a light turned about the middle of the volume. A point light in the middle itself stays.
fn turned(source: &LightSource, middle_mm: DVec3, angle: f64) -> LightSource {
    let axis = match (&source.extent, source.light) {
        (Extent::Map(_), _) => Some(DVec3::Z),
        (_, Light::Directional { toward }) => across(toward),
        (_, Light::Point { position }) => across(position - middle_mm),
    };
    let turn = axis.map_or(DQuat::IDENTITY, |axis| DQuat::from_axis_angle(axis, angle));
    source.clone().turned(turn, middle_mm)
}

/// Returns a unit vector that is orthogonal to a direction, unless its length is 0.
fn across(direction: DVec3) -> Option<DVec3> {
    direction.try_normalize().map(|unit| unit.any_orthonormal_vector())
}

/// Returns a camera turned about its target, to the side.
fn orbited(camera: &Camera, angle: f64) -> Camera {
    let turn = DQuat::from_axis_angle(camera.frame().up, angle);
    Camera { eye: camera.target + turn * (camera.eye - camera.target), ..*camera }
}

/// Whether a point lies in the picture of a scene's camera.
fn is_in_picture(scene: &Scene, point: DVec3) -> bool {
    let frame = scene.camera.frame();
    let to = point - scene.camera.eye;
    let half = (0.5 * scene.camera.fov_deg).to_radians().tan() * to.dot(frame.forward);
    let aspect = f64::from(scene.width) / f64::from(scene.height);
    half > 0.0 && to.dot(frame.up).abs() <= half && to.dot(frame.right).abs() <= half * aspect
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flicker_is_the_deviation_over_the_steps() {
        let mut scatter = Scatter::of(3);
        for errors in [[0.1, 0.5, 0.0], [0.3, 0.5, 9.0], [0.2, 0.5, 1.0]] {
            scatter.add(errors.into_iter());
        }
        // Variances 0.01 and 0; the third point has no weight.
        let rms = scatter.rms([1.0, 3.0, 0.0].into_iter()).unwrap();
        assert!((rms - (0.01_f64 / 4.0).sqrt()).abs() < 1e-12);
        assert_eq!(scatter.rms([0.0; 3].into_iter()), None);
        assert_eq!(Scatter::of(3).rms([1.0; 3].into_iter()), None);
    }

    #[test]
    fn lights_turn_by_the_angle() {
        let middle = DVec3::new(1.0, 2.0, 3.0);
        let angle = 0.01_f64;
        let toward = DVec3::new(0.3, -0.4, 0.5);
        let turned = |light: Light| turned(&light.into(), middle, angle).light;
        let Light::Directional { toward: turned_to } = turned(Light::Directional { toward }) else {
            panic!("directional")
        };
        assert!((turned_to.angle_between(toward) - angle).abs() < 1e-9);
        let position = DVec3::new(9.0, 2.0, -3.0);
        let Light::Point { position: moved } = turned(Light::Point { position }) else { panic!("point") };
        assert!(((moved - middle).angle_between(position - middle) - angle).abs() < 1e-9);
        assert!((moved.distance(middle) - position.distance(middle)).abs() < 1e-9);
        assert_eq!(turned(Light::Point { position: middle }), Light::Point { position: middle });
    }
}
