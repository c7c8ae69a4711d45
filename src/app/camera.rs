//! Converts pointer drags in the viewer to movements of the camera and the edited light.

use crate::scene::{AxisView, Camera, Light};
use glam::{DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Mode of camera rotation when the user drags the pointer over the picture: turntable or trackball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Orbit {
    /// Turntable rotation of the camera: about the up axis and in elevation, so that the horizon stays level.
    Turntable,
    /// Trackball rotation of the camera: free rotation about the horizontal and vertical axes of the picture.
    Trackball,
}

/// Minimum angle between the camera's view direction and the up axis in turntable rotation, radians.
const POLE_MARGIN: f64 = 0.01;

/// Rotates the camera about its target when the user drags the pointer. `right` and `down` are the rotation angles,
/// radians.
pub fn orbit(camera: &mut Camera, how: Orbit, right: f64, down: f64) {
    let frame = camera.frame();
    let offset = camera.eye - camera.target;
    match how {
        Orbit::Turntable => {
            let axis = camera.up.normalize_or(DVec3::Z);
            let height = (offset.normalize().dot(axis)).clamp(-1.0, 1.0).asin();
            let limit = FRAC_PI_2 - POLE_MARGIN;
            let tilt = (height + down).clamp(-limit, limit) - height;
            let turn = DQuat::from_axis_angle(axis, -right) * DQuat::from_axis_angle(frame.right, -tilt);
            camera.eye = camera.target + turn * offset;
        }
        Orbit::Trackball => {
            let turn = DQuat::from_axis_angle(frame.up, -right) * DQuat::from_axis_angle(frame.right, -down);
            camera.eye = camera.target + turn * offset;
            camera.up = (turn * frame.up).normalize_or(DVec3::Z);
        }
    }
}

/// Pans the camera parallel to the picture plane. Distances are in picture heights at the depth of the camera's
/// target.
pub fn pan(camera: &mut Camera, right: f64, down: f64) {
    let frame = camera.frame();
    let height = 2.0 * camera.eye.distance(camera.target) * (0.5 * camera.fov_deg.to_radians()).tan();
    let shift = height * (-right * frame.right + down * frame.up);
    camera.eye += shift;
    camera.target += shift;
}

/// Zooms the camera in (`factor` below 1) or out, about the point under the cursor at the depth of the camera's
/// target. `cursor` is relative to the picture centre, in half picture heights, y up.
pub fn zoom(camera: &mut Camera, factor: f64, cursor: [f64; 2], radius_mm: f64) {
    let frame = camera.frame();
    let distance = camera.eye.distance(camera.target);
    // Keeps the camera from reaching the target, and from moving too far away to see the volume.
    let factor = (distance * factor).clamp(1e-3 * radius_mm, 1e3 * radius_mm) / distance;
    let half = distance * (0.5 * camera.fov_deg.to_radians()).tan();
    let fixed = camera.target + half * (cursor[0] * frame.right + cursor[1] * frame.up);
    camera.eye = fixed + factor * (camera.eye - fixed);
    camera.target = fixed + factor * (camera.target - fixed);
}

/// Moves the camera to one of the six axis views (anterior, left, ...), at the current distance from its target.
pub fn look_from(camera: &mut Camera, view: &AxisView) {
    look_along(camera, view.away, view.up);
}

/// Moves the camera so that it lies in the unit direction `away` from its target, at the current distance.
pub fn look_along(camera: &mut Camera, away: DVec3, up: DVec3) {
    let distance = camera.eye.distance(camera.target);
    camera.eye = camera.target + distance * away;
    camera.up = up;
}

/// Moves a light by a pointer drag: rotates a directional light, or moves a point light parallel to the picture
/// plane.
pub fn drag_light(light: &mut Light, camera: &Camera, right: f64, down: f64) {
    let frame = camera.frame();
    match light {
        Light::Directional { toward } => {
            let turn = DQuat::from_axis_angle(frame.up, right) * DQuat::from_axis_angle(frame.right, down);
            *toward = (turn * *toward).normalize_or(DVec3::Z);
        }
        Light::Point { position } => {
            let depth = (*position - camera.eye).dot(frame.forward).abs().max(1e-3);
            *position += depth * (right * frame.right - down * frame.up);
        }
    }
}

/// Position in the unit-disc control of the viewer that shows a light direction. Centre: light behind the camera.
/// Half the radius: light perpendicular to the view. Rim: light behind the volume. `None` if `toward` is zero.
pub fn disc_from_direction(camera: &Camera, toward: DVec3) -> Option<[f64; 2]> {
    let frame = camera.frame();
    let v = toward.try_normalize()?;
    let (x, y, z) = (v.dot(frame.right), v.dot(frame.up), -v.dot(frame.forward));
    let angle = z.clamp(-1.0, 1.0).acos() / std::f64::consts::PI;
    let across = x.hypot(y);
    Some(if across < 1e-9 { [angle, 0.0] } else { [angle * x / across, angle * y / across] })
}

/// Light direction that a position in the viewer's unit-disc control stands for; the inverse of
/// [`disc_from_direction`].
pub fn direction_from_disc(camera: &Camera, [x, y]: [f64; 2]) -> DVec3 {
    let frame = camera.frame();
    let radius = x.hypot(y).min(1.0);
    let angle = radius * std::f64::consts::PI;
    let (x, y) = if radius < 1e-9 { (0.0, 0.0) } else { (x / x.hypot(y), y / x.hypot(y)) };
    let toward = angle.sin() * (x * frame.right + y * frame.up) - angle.cos() * frame.forward;
    toward.normalize_or(DVec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{AXIS_VIEWS, anatomical_marks};

    fn camera() -> Camera {
        Camera {
            eye: DVec3::new(3.0, 9.0, 4.0),
            target: DVec3::new(1.0, 1.0, 1.0),
            up: DVec3::Z,
            fov_deg: 40.0,
        }
    }

    #[test]
    fn turning_keeps_the_distance_and_a_turntable_its_horizon() {
        for how in [Orbit::Turntable, Orbit::Trackball] {
            let mut moved = camera();
            for _ in 0..500 {
                orbit(&mut moved, how, 0.3, 0.2);
                assert!(moved.frame().right.is_finite(), "{how:?}");
            }
            let distance = camera().eye.distance(camera().target);
            assert!((moved.eye.distance(moved.target) - distance).abs() < 1e-9);
            if how == Orbit::Turntable {
                assert_eq!(moved.up, DVec3::Z);
                assert!(moved.frame().right.z.abs() < 1e-12);
            }
        }
        // The picture follows the pointer.
        let mut moved = camera();
        orbit(&mut moved, Orbit::Turntable, 0.1, 0.0);
        let front = camera().target + 0.5 * (camera().eye - camera().target);
        let frame = moved.frame();
        assert!((front - moved.eye).dot(frame.right) > 0.0);
    }

    #[test]
    fn zoom_keeps_the_point_under_the_cursor() {
        let before = camera();
        let place = |c: &Camera, [x, y]: [f64; 2]| {
            let frame = c.frame();
            let half = c.eye.distance(c.target) * (0.5 * c.fov_deg.to_radians()).tan();
            c.target + half * (x * frame.right + y * frame.up)
        };
        let mut after = before;
        zoom(&mut after, 0.7, [0.4, -0.8], 5.0);
        assert!((place(&before, [0.4, -0.8]) - place(&after, [0.4, -0.8])).length() < 1e-9);
        assert!((after.eye.distance(after.target) / before.eye.distance(before.target) - 0.7).abs() < 1e-9);
    }

    #[test]
    fn the_disc_reaches_every_direction() {
        let camera = camera();
        for v in [
            DVec3::X,
            DVec3::NEG_Y,
            DVec3::new(1.0, -2.0, 0.3),
            camera.frame().forward,
            -camera.frame().forward,
        ] {
            let disc = disc_from_direction(&camera, v).unwrap();
            assert!((direction_from_disc(&camera, disc) - v.normalize()).length() < 1e-6, "{v}");
        }
        assert!(disc_from_direction(&camera, DVec3::ZERO).is_none());
    }

    #[test]
    fn orientation_letters_follow_ras() {
        assert_eq!((anatomical_marks(DVec3::X), anatomical_marks(DVec3::NEG_X)), ("R".into(), "L".into()));
        assert_eq!(anatomical_marks(DVec3::new(0.1, -1.0, 0.6)), "PS");
        let mut front = camera();
        look_from(&mut front, &AXIS_VIEWS[0]);
        // From the front, the patient's right is on the left.
        assert_eq!(anatomical_marks(front.frame().right), "L");
    }
}
