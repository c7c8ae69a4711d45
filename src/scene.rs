//! Camera, lights and picture settings: plain data.

use crate::files::color;
use crate::mesh::Mesh;
use crate::volume::Volume;
use glam::DVec3;
use serde::{Deserialize, Serialize, Serializer};
use std::sync::Arc;

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

/// A direction to look from, named as a radiologist would.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisView {
    /// Where the eye is, as a word.
    pub name: &'static str,
    /// The same as an anatomical letter.
    pub mark: &'static str,
    /// From the target to the eye, RAS+.
    pub away: DVec3,
    /// What is up in the picture, RAS+.
    pub up: DVec3,
}

/// The six.
pub const AXIS_VIEWS: [AxisView; 6] = [
    AxisView { name: "Anterior", mark: "A", away: DVec3::Y, up: DVec3::Z },
    AxisView { name: "Posterior", mark: "P", away: DVec3::NEG_Y, up: DVec3::Z },
    AxisView { name: "Left", mark: "L", away: DVec3::NEG_X, up: DVec3::Z },
    AxisView { name: "Right", mark: "R", away: DVec3::X, up: DVec3::Z },
    AxisView { name: "Superior", mark: "S", away: DVec3::Z, up: DVec3::Y },
    AxisView { name: "Inferior", mark: "I", away: DVec3::NEG_Z, up: DVec3::Y },
];

impl serde::Serialize for AxisView {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.mark)
    }
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

/// Where a light is; world millimetres.
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

    /// As `--light` takes it, to the last bit.
    fn exact_text(&self) -> String {
        let (kind, v) = self.kind();
        format!("{kind}:{:?},{:?},{:?}", v.x, v.y, v.z)
    }

    fn kind(&self) -> (&'static str, DVec3) {
        match *self {
            Self::Directional { toward } => ("dir", toward),
            Self::Point { position } => ("point", position),
        }
    }

    /// As `--light` takes it, to four decimals.
    pub fn text(&self) -> String {
        let (kind, v) = self.kind();
        // A direction was normalised: its digits beyond these say nothing.
        let [x, y, z] = v.to_array().map(|c| (c * 1e4).round() / 1e4 + 0.0);
        format!("{kind}:{x},{y},{z}")
    }
}

impl Default for Light {
    fn default() -> Self {
        Self::Directional { toward: DVec3::new(0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2) }
    }
}

/// A light: where it is, and how much of each channel it gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSource {
    /// Where it is.
    pub light: Light,
    /// Linear RGB, in `[0, 1]`.
    pub color: [f64; 3],
    /// A factor on the colour, 0 or more.
    pub intensity: f64,
}

impl LightSource {
    /// The colour where none is given.
    pub const WHITE: [f64; 3] = [1.0; 3];

    /// What a lit point gets from it in each channel, linear.
    pub fn radiance(&self) -> [f64; 3] {
        self.color.map(|c| c * self.intensity)
    }

    /// Whether it gives any light.
    pub fn shines(&self) -> bool {
        self.radiance().iter().any(|c| *c > 0.0)
    }

    /// As `--light` takes it; its place to four decimals.
    pub fn text(&self) -> String {
        self.light.text() + &self.factors()
    }

    /// The keys of `--light` that are not at their defaults, each with a comma before it.
    fn factors(&self) -> String {
        let color = (self.color != Self::WHITE).then(|| format!(",color={}", color::to_hex(self.color)));
        let intensity = (self.intensity != 1.0).then(|| format!(",intensity={}", self.intensity));
        color.unwrap_or_default() + &intensity.unwrap_or_default()
    }
}

/// White, of intensity 1.
impl From<Light> for LightSource {
    fn from(light: Light) -> Self {
        Self { light, color: Self::WHITE, intensity: 1.0 }
    }
}

impl Default for LightSource {
    fn default() -> Self {
        Light::default().into()
    }
}

/// As `--light` takes it, to the last bit of its place and its intensity; colours are of 8 bits a channel.
impl Serialize for LightSource {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{}{}", self.light.exact_text(), self.factors()))
    }
}

/// The factor on light that reaches a point: 1, or by the angle between the light and the gradient of the value, or the
/// strands that the volume was made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "a comment would be a line of `--help`")]
pub enum Shading {
    #[default]
    None,
    Lambert,
    BlinnPhong,
    KajiyaKay,
}

impl Shading {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::None, Self::Lambert, Self::BlinnPhong, Self::KajiyaKay];

    /// Whether it needs a volume that was made from strands.
    pub fn is_of_strands(self) -> bool {
        self == Self::KajiyaKay
    }
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
    /// The lights, at least one.
    pub lights: Vec<LightSource>,
    /// Share of the light that shadows do not touch, in `[0, 1]`.
    pub ambient: f64,
    /// How surfaces are shaded.
    pub shading: Shading,
    /// Opaque things in the volume.
    pub mesh: Option<Arc<Mesh>>,
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
    /// Lights that a scene may have: each is a shadow structure and a pass over the picture.
    pub const MOST_LIGHTS: usize = 16;

    /// The lights that shine, in their order. Where none does it is the first one, which stands for the ambient light alone:
    /// a picture is drawn once at least.
    pub fn shining(&self) -> Vec<LightSource> {
        let shining: Vec<_> = self.lights.iter().copied().filter(LightSource::shines).collect();
        if shining.is_empty() { self.lights.iter().copied().take(1).collect() } else { shining }
    }

    /// How many lights shine.
    pub fn lights_shining(&self) -> u32 {
        self.lights.iter().filter(|source| source.shines()).count() as u32
    }

    /// The lights that shine by their places from 1, where there are several.
    pub fn lights_apart(&self) -> Vec<(u32, LightSource)> {
        let numbered = (1..).zip(self.lights.iter().copied()).filter(|(_, source)| source.shines());
        let lights: Vec<_> = numbered.collect();
        if lights.len() > 1 { lights } else { Vec::new() }
    }

    /// Where the first light is: all that there is to say of a scene with one.
    pub fn light(&self) -> Light {
        self.lights.first().map_or_else(Light::default, |source| source.light)
    }

    /// The same scene under one of its lights, or another.
    #[must_use]
    pub fn under(&self, light: LightSource) -> Self {
        Self { lights: vec![light], ..self.clone() }
    }

    /// What every command starts from where nothing is asked for, framing `volume`.
    pub fn framing(volume: &Volume) -> Self {
        Self {
            camera: Camera::framing(volume, DVec3::Z, Camera::DEFAULT_FOV_DEG),
            lights: vec![LightSource::default()],
            ambient: 0.1,
            shading: Shading::None,
            mesh: None,
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
        let source = LightSource::from(light);
        assert_eq!(source.text(), light.text());
        let source = LightSource { color: [1.0, 0.0, 0.0], intensity: 2.5, ..source };
        assert_eq!(source.text(), "point:0,2,-300.25,color=#ff0000,intensity=2.5");
    }

    #[test]
    fn dark_lights_are_left_out_and_one_is_always_left() {
        let volume = crate::phantom::Phantom::Slab.build(8).unwrap();
        let [a, dark, black] = [(1.0, 0.25), (1.0, 0.0), (0.0, 3.0)].map(|(grey, intensity)| LightSource {
            color: [grey; 3],
            intensity,
            ..LightSource::default()
        });
        let scene = |lights: &[LightSource]| Scene { lights: lights.to_vec(), ..Scene::framing(&volume) };
        assert_eq!(scene(&[dark, a, black, a]).shining(), [a, a]);
        assert_eq!(scene(&[dark, black]).shining(), [dark]);
        assert_eq!(scene(&[dark, a, black, a]).lights_apart(), [(2, a), (4, a)]);
        assert_eq!(scene(&[dark, a]).lights_apart(), []);
        assert_eq!(a.radiance(), [0.25; 3]);
    }
}
