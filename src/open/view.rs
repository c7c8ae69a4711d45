//! Computes the camera of a scene from position and target in its settings. By default the camera frames the visible
//! part of the volume.

use super::SceneSettings;
use super::values::Size;
use crate::error::{Error, Result};
use crate::render::VisibleBounds;
use crate::scene::Camera;
use glam::DVec3;

/// Default direction from the camera's target to the eye: in front, a little to the side and above (RAS+: +y is
/// anterior).
const AWAY: DVec3 = DVec3::new(0.5, 0.8, 0.35);

/// Sine of the angle between the camera's view and up directions below which they count as parallel, due to 32-bit
/// rounding.
const MIN_SINE: f64 = 1e-5;

impl SceneSettings {
    /// Computes the camera of a scene for a given picture size.
    ///
    /// # Errors
    /// The camera has no direction, or both `--eye` and `--view` give its position.
    pub(super) fn camera(&self, bounds: &VisibleBounds, size: Size) -> Result<Camera> {
        let side = self.view;
        if side.is_some() && self.eye.is_some() {
            let why = "--eye and --view exclude each other";
            return Err(Error::input("bad camera", "--view", why));
        }
        let up = self.up.or(side.map(|s| s.up)).unwrap_or(DVec3::Z);
        let fov_deg = self.fov.unwrap_or(Camera::DEFAULT_FOV_DEG);
        let half = (0.5 * fov_deg).to_radians().tan();
        let along_up = AWAY.normalize().cross(up).length() < 1e-3 * up.length();
        let away = side.map_or(if along_up { DVec3::Y } else { AWAY }, |s| s.away);
        let aspect = f64::from(size.width) / f64::from(size.height);
        let (target, eye) = match (self.target, self.eye) {
            (Some(target), Some(eye)) => (target, eye),
            (None, Some(eye)) => (bounds.center_mm(), eye),
            (target, None) => {
                let framed = bounds.framed(away, up, fov_deg, aspect);
                let target = target.unwrap_or(framed.target);
                (target, target + framed.eye - framed.target)
            }
        };
        // Zooming does not move the eye, so that the camera cannot enter the volume.
        let fov_deg = self.zoom.map_or(fov_deg, |zoom| 2.0 * (half / zoom).atan().to_degrees());
        let view = target - eye;
        // If the eye is closer, rounding of float32 positions loses the direction.
        if view.length() <= 1e-6 * eye.abs().max_element().max(1.0) {
            return Err(Error::input("bad camera", "--eye, --target", "the eye is at the target"));
        }
        if view.normalize().cross(up).length() < MIN_SINE {
            let other = if up.y.abs() < 0.9 { "--up 0,1,0" } else { "--up 0,0,1" };
            return Err(Error::input("bad camera", "--up", "up is along the direction of view")
                .hint(format!("give another, e.g. {other}")));
        }
        Ok(Camera { eye, target, up, fov_deg })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;
    use crate::scene::AXIS_VIEWS;
    use std::sync::Arc;

    #[test]
    fn sides_are_looked_from_and_zoom_enlarges() {
        let volume = Arc::new(Phantom::Thorax.build(16).unwrap());
        let size = Size { width: 100, height: 100 };
        let seen = VisibleBounds::whole(&volume);
        let of = |settings: SceneSettings| settings.camera(&seen, size).unwrap();
        for side in AXIS_VIEWS {
            let seen = of(SceneSettings { view: Some(side), ..SceneSettings::default() });
            let forward = seen.frame().forward;
            assert!((forward + side.away).length() < 1e-12, "{}", side.name);
            assert!((seen.frame().up - side.up).length() < 1e-12, "{}", side.name);
        }
        let plain = of(SceneSettings::default());
        let near = of(SceneSettings { zoom: Some(2.5), ..SceneSettings::default() });
        let half = |camera: &Camera| (0.5 * camera.fov_deg.to_radians()).tan();
        assert!((half(&plain) / half(&near) - 2.5).abs() < 1e-12 && plain.eye == near.eye);
        let both =
            SceneSettings { view: Some(AXIS_VIEWS[0]), eye: Some(DVec3::ONE), ..SceneSettings::default() };
        assert!(both.camera(&seen, size).is_err());
    }
}
