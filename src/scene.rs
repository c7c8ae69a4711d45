//! Camera, light and picture settings: plain data.

use crate::volume::Volume;
use glam::DVec3;
use serde::{Deserialize, Serialize, Serializer};

/// A pinhole camera; world millimetres, vertical field of view in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Where it stands, world mm.
    pub eye: DVec3,
    /// What it looks at, world mm.
    pub target: DVec3,
    /// What is up in the picture; of any length, not along the view.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov_deg: f64,
}

/// The camera's orthonormal frame: `forward`, `right = forward x up`, `up = right x forward`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    /// Along the view.
    pub forward: DVec3,
    /// To the right in the picture.
    pub right: DVec3,
    /// Up in the picture.
    pub up: DVec3,
}

impl Camera {
    /// Vertical field of view where none is given.
    pub const DEFAULT_FOV_DEG: f64 = 40.0;

    /// Frames the volume's bounding sphere from the front, a little from the side and above (RAS+: +y is anterior).
    pub fn framing(volume: &Volume, up: DVec3, fov_deg: f64) -> Self {
        let corners = volume.corners_mm();
        let center = corners.iter().sum::<DVec3>() / 8.0;
        let radius = corners.iter().map(|c| c.distance(center)).fold(0.0, f64::max);
        let distance = radius / (0.5 * fov_deg.to_radians()).sin();
        let mut away = DVec3::new(0.5, 0.8, 0.35).normalize();
        if away.cross(up).length() < 1e-3 * up.length() {
            away = DVec3::Y;
        }
        Self { eye: center + away * distance, target: center, up, fov_deg }
    }

    /// The orthonormal frame: `forward` towards the target, `right` and `up` of the picture.
    pub fn frame(&self) -> CameraFrame {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        CameraFrame { forward, right, up: right.cross(forward) }
    }

    /// Unit direction through the centre of pixel (column `i`, row `j` from the top) of a `width x height` picture.
    pub fn ray_direction(&self, i: f64, j: f64, width: u32, height: u32) -> DVec3 {
        let f = self.frame();
        let (w, h) = (f64::from(width), f64::from(height));
        let tan = (0.5 * self.fov_deg.to_radians()).tan();
        let x = (2.0 * (i + 0.5) / w - 1.0) * (w / h) * tan;
        let y = (1.0 - 2.0 * (j + 0.5) / h) * tan;
        (f.forward + x * f.right + y * f.up).normalize()
    }
}

/// The one light; world millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// At infinity.
    Directional {
        /// Towards the light; need not be normalised.
        toward: DVec3,
    },
    /// At a point.
    Point {
        /// Where, mm.
        position: DVec3,
    },
}

impl Light {
    /// Unit direction from `x` towards the light and the distance to it (infinite for a directional one), mm.
    pub fn from_point(&self, x: DVec3) -> (DVec3, f64) {
        match *self {
            Self::Directional { toward } => (toward.normalize(), f64::INFINITY),
            Self::Point { position } => {
                let d = position - x;
                let length = d.length();
                (if length > 0.0 { d / length } else { DVec3::Z }, length)
            }
        }
    }

    /// As `--light` takes it, to four decimals.
    pub fn text(&self) -> String {
        let (kind, v) = match self {
            Self::Directional { toward } => ("dir", toward),
            Self::Point { position } => ("point", position),
        };
        // A direction was normalised: its digits beyond these say nothing.
        let [x, y, z] = v.to_array().map(|c| (c * 1e4).round() / 1e4 + 0.0);
        format!("{kind}:{x},{y},{z}")
    }
}

/// As `--light` takes it, to the last bit.
impl Serialize for Light {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (kind, v) = match self {
            Self::Directional { toward } => ("dir", toward),
            Self::Point { position } => ("point", position),
        };
        serializer.collect_str(&format_args!("{kind}:{:?},{:?},{:?}", v.x, v.y, v.z))
    }
}

impl Default for Light {
    fn default() -> Self {
        Self::Directional { toward: DVec3::new(0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2) }
    }
}

/// The factor on light that reaches a point: 1, or by the angle between the light and the gradient of the value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "a comment would be a line of `--help`")]
pub enum Shading {
    #[default]
    None,
    Lambert,
    BlinnPhong,
}

/// How empty space is passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Skip {
    /// Leap over bricks without extinction.
    #[default]
    Bricks,
    /// Sample everywhere.
    None,
}

/// Everything about a picture but the volume, the transfer function and the shadow method.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Where it is seen from.
    pub camera: Camera,
    /// The one light.
    pub light: Light,
    /// Share of the light that shadows do not touch, in `[0, 1]`.
    pub ambient: f64,
    /// How surfaces are shaded.
    pub shading: Shading,
    /// Linear RGB.
    pub background: [f64; 3],
    /// Eye-ray step in units of the smallest voxel spacing.
    pub step: f64,
    /// How empty space is passed over.
    pub skip: Skip,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Scene {
    /// What every command starts from where nothing is asked for, framing `volume`.
    pub fn framing(volume: &Volume) -> Self {
        Self {
            camera: Camera::framing(volume, DVec3::Z, Camera::DEFAULT_FOV_DEG),
            light: Light::default(),
            ambient: 0.1,
            shading: Shading::None,
            background: [0.0; 3],
            step: 0.5,
            skip: Skip::Bricks,
            width: 512,
            height: 512,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_said_as_they_are_asked_for() {
        let light = Light::Directional { toward: DVec3::new(0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2) };
        assert_eq!(light.text(), "dir:0.5,0.5,0.7071");
        let light = Light::Point { position: DVec3::new(-0.0, 2.0, -300.25) };
        assert_eq!(light.text(), "point:0,2,-300.25");
    }
}
