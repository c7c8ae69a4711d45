//! Camera, lights and picture settings.

use crate::files::color;
use crate::mesh::Mesh;
use crate::volume::Volume;
use glam::DVec3;
use serde::{Deserialize, Serialize, Serializer};
use std::sync::Arc;

/// Pinhole camera; world millimetres, vertical field of view in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Position, world mm.
    pub eye: DVec3,
    /// Point at the centre of the picture, world mm.
    pub target: DVec3,
    /// Up direction of the picture; of any length, not along the view.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov_deg: f64,
}

/// Orthonormal frame of a camera: `forward`, `right = forward x up`, `up = right x forward`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    /// Along the view.
    pub forward: DVec3,
    /// To the right in the picture.
    pub right: DVec3,
    /// Up in the picture.
    pub up: DVec3,
}

/// View along an anatomical axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisView {
    /// Name of the side on which the eye is.
    pub name: &'static str,
    /// Anatomical letter of that side.
    pub mark: &'static str,
    /// Direction from the target to the eye, RAS+.
    pub away: DVec3,
    /// Up direction of the picture, RAS+.
    pub up: DVec3,
}

/// All views along anatomical axes.
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
    /// Default vertical field of view, degrees.
    pub const DEFAULT_FOV_DEG: f64 = 40.0;

    /// Camera that frames the volume's bounding sphere from the front, a little from the side and above (RAS+: +y is anterior).
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

    /// Orthonormal frame: `forward` towards the target, `right` and `up` of the picture.
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

/// Position or direction of a light; world millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// Light at infinity.
    Directional {
        /// Direction towards the light, of any length.
        toward: DVec3,
    },
    /// Light at a point.
    Point {
        /// Position, mm.
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

    fn kind(&self) -> (&'static str, DVec3) {
        match *self {
            Self::Directional { toward } => ("dir", toward),
            Self::Point { position } => ("point", position),
        }
    }

    /// Text for `--light` with four decimals.
    pub fn text(&self) -> String {
        let (kind, v) = self.kind();
        // Further digits of a normalised direction carry no information.
        let [x, y, z] = v.to_array().map(|c| (c * 1e4).round() / 1e4 + 0.0);
        format!("{kind}:{x},{y},{z}")
    }
}

impl Default for Light {
    fn default() -> Self {
        Self::Directional { toward: DVec3::new(0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2) }
    }
}

/// Light with its colour and intensity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSource {
    /// Position or direction.
    pub light: Light,
    /// Linear RGB, in `[0, 1]`.
    pub color: [f64; 3],
    /// Factor on the colour, 0 or more.
    pub intensity: f64,
}

impl LightSource {
    /// Default colour.
    pub const WHITE: [f64; 3] = [1.0; 3];

    /// Linear RGB of the light that reaches an unshadowed point.
    pub fn radiance(&self) -> [f64; 3] {
        self.color.map(|c| c * self.intensity)
    }

    /// Whether the light is not black.
    pub fn shines(&self) -> bool {
        self.radiance().iter().any(|c| *c > 0.0)
    }

    /// Text for `--light`; the position has four decimals.
    pub fn text(&self) -> String {
        self.light.text() + &self.factors()
    }

    /// Keys of `--light` that differ from their defaults, each after a comma.
    fn factors(&self) -> String {
        let color = (self.color != Self::WHITE).then(|| format!(",color={}", color::to_hex(self.color)));
        let intensity = (self.intensity != 1.0).then(|| format!(",intensity={}", self.intensity));
        color.unwrap_or_default() + &intensity.unwrap_or_default()
    }
}

/// White light of intensity 1.
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

/// Serializes the text for `--light`, exact to the last bit except for colours, which have 8 bits a channel.
impl Serialize for LightSource {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (kind, DVec3 { x, y, z }) = self.light.kind();
        serializer.collect_str(&format_args!("{kind}:{x:?},{y:?},{z:?}{}", self.factors()))
    }
}

/// Shading of the light that reaches a point: none, by the gradient of the value, or by the direction of the strands from which
/// the volume was made.
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
    /// All kinds of shading.
    pub const ALL: [Self; 4] = [Self::None, Self::Lambert, Self::BlinnPhong, Self::KajiyaKay];

    /// Whether the shading needs a volume made from strands.
    pub fn is_of_strands(self) -> bool {
        self == Self::KajiyaKay
    }
}

/// Skipping of empty space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Skip {
    /// Skip bricks without extinction.
    #[default]
    Bricks,
    /// Sample everywhere.
    None,
}

/// Settings of a picture apart from the volume, the transfer function and the shadow method.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Camera.
    pub camera: Camera,
    /// Lights, at least one.
    pub lights: Vec<LightSource>,
    /// Share of the light that shadows do not affect, in `[0, 1]`.
    pub ambient: f64,
    /// Shading.
    pub shading: Shading,
    /// Opaque mesh in the volume.
    pub mesh: Option<Arc<Mesh>>,
    /// Background, linear RGB.
    pub background: [f64; 3],
    /// Eye-ray step in units of the smallest voxel spacing.
    pub step: f64,
    /// Skipping of empty space.
    pub skip: Skip,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Scene {
    /// Limit on the lights: each needs a shadow structure and a pass over the picture.
    pub const MOST_LIGHTS: usize = 16;

    /// Lights that are not black, in their order; the first light if all are black, since a picture needs one pass.
    pub fn shining(&self) -> Vec<LightSource> {
        let shining: Vec<_> = self.lights.iter().copied().filter(LightSource::shines).collect();
        if shining.is_empty() { self.lights.iter().copied().take(1).collect() } else { shining }
    }

    /// Number of lights that are not black.
    pub fn lights_shining(&self) -> u32 {
        self.lights.iter().filter(|source| source.shines()).count() as u32
    }

    /// Lights that are not black with their numbers from 1; empty if there are fewer than two.
    pub fn lights_apart(&self) -> Vec<(u32, LightSource)> {
        let numbered = (1..).zip(self.lights.iter().copied()).filter(|(_, source)| source.shines());
        let lights: Vec<_> = numbered.collect();
        if lights.len() > 1 { lights } else { Vec::new() }
    }

    /// Position or direction of the first light.
    pub fn light(&self) -> Light {
        self.lights.first().map_or_else(Light::default, |source| source.light)
    }

    /// Replaces all lights by one.
    #[must_use]
    pub fn under(&self, light: LightSource) -> Self {
        Self { lights: vec![light], ..self.clone() }
    }

    /// Default scene that frames `volume`.
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
    fn lights_have_the_text_of_their_flag() {
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
