//! Camera, lights and picture settings of a scene.

use crate::files::color;
use crate::mesh::Mesh;
use crate::volume::Volume;
use glam::DVec3;
use serde::{Deserialize, Serialize, Serializer};
use std::sync::Arc;

/// Pinhole camera with positions in world millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Position of the camera, world mm.
    pub eye: DVec3,
    /// Point that the camera looks at, in the centre of the picture, world mm.
    pub target: DVec3,
    /// Up direction of the camera, of any length, not parallel to the view direction.
    pub up: DVec3,
    /// Vertical field of view of the camera, degrees.
    pub fov_deg: f64,
}

/// Orthonormal frame of a camera: `forward` (view direction), `right = forward x up`, `up = right x forward`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    /// View direction of the camera, unit vector.
    pub forward: DVec3,
    /// Camera direction to the right of the picture, unit vector.
    pub right: DVec3,
    /// Camera direction to the top of the picture, unit vector.
    pub up: DVec3,
}

/// Standard camera view along an anatomical axis of the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisView {
    /// Name of the anatomical side from which the camera looks, such as `Anterior`.
    pub name: &'static str,
    /// Letter of the anatomical side from which the camera looks, such as `A`.
    pub mark: &'static str,
    /// Direction from the camera's target to its position, in RAS+ coordinates.
    pub away: DVec3,
    /// Up direction of the camera, in RAS+ coordinates.
    pub up: DVec3,
}

/// Six standard camera views along the anatomical axes.
pub const AXIS_VIEWS: [AxisView; 6] = [
    AxisView { name: "Anterior", mark: "A", away: DVec3::Y, up: DVec3::Z },
    AxisView { name: "Posterior", mark: "P", away: DVec3::NEG_Y, up: DVec3::Z },
    AxisView { name: "Left", mark: "L", away: DVec3::NEG_X, up: DVec3::Z },
    AxisView { name: "Right", mark: "R", away: DVec3::X, up: DVec3::Z },
    AxisView { name: "Superior", mark: "S", away: DVec3::Z, up: DVec3::Y },
    AxisView { name: "Inferior", mark: "I", away: DVec3::NEG_Z, up: DVec3::Y },
];

/// Returns the anatomical letters of a world direction (RAS+), the largest component first: `L`, `PS`, ...
pub fn anatomical_marks(direction: DVec3) -> String {
    let v = direction.normalize_or_zero();
    let mut axes = [(v.x, "R", "L"), (v.y, "A", "P"), (v.z, "S", "I")];
    axes.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    axes.iter().filter(|a| a.0.abs() > 0.4).map(|a| if a.0 > 0.0 { a.1 } else { a.2 }).collect()
}

impl serde::Serialize for AxisView {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.mark)
    }
}

impl Camera {
    /// Default vertical field of view of the camera, degrees.
    pub const DEFAULT_FOV_DEG: f64 = 40.0;

    /// Returns a camera that fits the volume's bounding sphere, from the front and slightly from the side and above
    /// (RAS+: +y is anterior).
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

    /// Returns the camera's orthonormal frame: `forward` towards the target, `right` and `up` in the picture.
    pub fn frame(&self) -> CameraFrame {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        CameraFrame { forward, right, up: right.cross(forward) }
    }

    /// Returns the unit direction of the eye ray through the centre of the pixel in column `i` and row `j` from
    /// the top. The picture has `width x height` pixels.
    pub fn ray_direction(&self, i: f64, j: f64, width: u32, height: u32) -> DVec3 {
        let f = self.frame();
        let (w, h) = (f64::from(width), f64::from(height));
        let tan = (0.5 * self.fov_deg.to_radians()).tan();
        let x = (2.0 * (i + 0.5) / w - 1.0) * (w / h) * tan;
        let y = (1.0 - 2.0 * (j + 0.5) / h) * tan;
        (f.forward + x * f.right + y * f.up).normalize()
    }
}

/// Position of a point light or direction of a directional light, without colour. Lengths are world millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// Directional light, infinitely far away.
    Directional {
        /// Direction towards the directional light, of any length.
        toward: DVec3,
    },
    /// Point light, which shines in all directions from one position.
    Point {
        /// Position of the point light, world mm.
        position: DVec3,
    },
}

impl Light {
    /// Returns the unit direction from point `x` towards the light, and the distance in mm (infinite for a
    /// directional light).
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

    /// Formats the position or direction of a light source in the syntax of `--light`, with four decimals.
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

/// Light source: position or direction, colour and intensity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSource {
    /// Position (point light) or direction (directional light) of the light source, without colour.
    pub light: Light,
    /// Colour of the light source, linear RGB in `[0, 1]`.
    pub color: [f64; 3],
    /// Intensity of the light source: a factor on its colour, 0 or more.
    pub intensity: f64,
}

impl LightSource {
    /// Default colour of a light source: white, linear RGB.
    pub const WHITE: [f64; 3] = [1.0; 3];

    /// Returns the linear RGB of the light that reaches an unshadowed point: colour times intensity.
    pub fn radiance(&self) -> [f64; 3] {
        self.color.map(|c| c * self.intensity)
    }

    /// Returns whether the light source emits light: colour and intensity are not 0.
    pub fn shines(&self) -> bool {
        self.radiance().iter().any(|c| *c > 0.0)
    }

    /// Formats a light source in the syntax of `--light`; its position has four decimals.
    pub fn text(&self) -> String {
        self.light.text() + &self.factors()
    }

    /// Formats colour and intensity of a light source in the syntax of `--light`: each after a comma, and only if it
    /// differs from the default.
    fn factors(&self) -> String {
        let color = (self.color != Self::WHITE).then(|| format!(",color={}", color::to_hex(self.color)));
        let intensity = (self.intensity != 1.0).then(|| format!(",intensity={}", self.intensity));
        color.unwrap_or_default() + &intensity.unwrap_or_default()
    }
}

/// Creates a white light source of intensity 1.
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

/// Serializes the light source in the syntax of `--light`: exact to the last bit, except colours, which have 8 bits
/// per channel.
impl Serialize for LightSource {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (kind, DVec3 { x, y, z }) = self.light.kind();
        serializer.collect_str(&format_args!("{kind}:{x:?},{y:?},{z:?}{}", self.factors()))
    }
}

/// Shading model for the light that reaches a point: none, from the gradient of the voxel values, or from the
/// direction of strands (curves such as hair).
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
    /// All shading models that a scene can select.
    pub const ALL: [Self; 4] = [Self::None, Self::Lambert, Self::BlinnPhong, Self::KajiyaKay];

    /// Returns whether the shading model needs a volume made from strands (curves such as hair or fibres).
    pub fn is_of_strands(self) -> bool {
        self == Self::KajiyaKay
    }
}

/// Empty-space skipping of eye rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Skip {
    /// Skip bricks (blocks of voxels) without extinction along eye rays.
    #[default]
    Bricks,
    /// Sample eye rays everywhere, also in empty space.
    None,
}

/// Settings of a picture apart from volume, transfer function and shadow method: camera, lights, shading and size.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Camera from which the scene is drawn.
    pub camera: Camera,
    /// Light sources of the scene, at least one.
    pub lights: Vec<LightSource>,
    /// Ambient fraction of the light, in `[0, 1]`: the part that shadows do not affect.
    pub ambient: f64,
    /// Shading model for the light that reaches each sample of the volume.
    pub shading: Shading,
    /// Opaque triangle mesh drawn inside the volume, if any.
    pub mesh: Option<Arc<Mesh>>,
    /// Background colour of the picture, linear RGB.
    pub background: [f64; 3],
    /// Step length along eye rays, in units of the smallest voxel spacing.
    pub step: f64,
    /// Empty-space skipping of eye rays.
    pub skip: Skip,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
}

impl Scene {
    /// Largest number of lights in a scene. It is limited because each light needs a shadow map and a render pass.
    pub const MOST_LIGHTS: usize = 16;

    /// Returns the scene's lights that are not black, in order. If all are black, it returns only the first one,
    /// since a picture needs one render pass.
    pub fn shining(&self) -> Vec<LightSource> {
        let shining: Vec<_> = self.lights.iter().copied().filter(LightSource::shines).collect();
        if shining.is_empty() { self.lights.iter().copied().take(1).collect() } else { shining }
    }

    /// Number of lights of the scene that are not black.
    pub fn lights_shining(&self) -> u32 {
        self.lights.iter().filter(|source| source.shines()).count() as u32
    }

    /// Returns the scene's lights that are not black, each with its index from 1 in the scene. The list is empty if
    /// there are fewer than two.
    pub fn lights_apart(&self) -> Vec<(u32, LightSource)> {
        let numbered = (1..).zip(self.lights.iter().copied()).filter(|(_, source)| source.shines());
        let lights: Vec<_> = numbered.collect();
        if lights.len() > 1 { lights } else { Vec::new() }
    }

    /// Position or direction of the scene's first light.
    pub fn light(&self) -> Light {
        self.lights.first().map_or_else(Light::default, |source| source.light)
    }

    /// Returns a copy of the scene whose only light is `light`.
    #[must_use]
    pub fn under(&self, light: LightSource) -> Self {
        Self { lights: vec![light], ..self.clone() }
    }

    /// Returns a scene with default settings and a camera that fits `volume`.
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
