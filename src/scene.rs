//! Camera, lights and picture settings of a scene.

mod light;
mod sky_map;

pub use self::light::{Extent, Light, LightSource};
pub use self::sky_map::{SkyMap, SkyRadiance};

use crate::mesh::Mesh;
use crate::volume::Volume;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;
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
        let center = volume.center_mm();
        let radius = volume.corners_mm().iter().map(|c| c.distance(center)).fold(0.0, f64::max);
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

/// Shading model for the light that reaches a point: none, from the gradient of the voxel values, from the direction of
/// strands (curves such as hair), or by a phase function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "a comment would be a line of `--help`")]
pub enum Shading {
    #[default]
    None,
    Lambert,
    BlinnPhong,
    KajiyaKay,
    Phase,
}

impl Shading {
    /// All shading models that a scene can select.
    pub const ALL: [Self; 5] = [Self::None, Self::Lambert, Self::BlinnPhong, Self::KajiyaKay, Self::Phase];

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

/// Occlusion of ambient light by matter near a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AmbientOcclusion {
    /// Distance within which matter occludes ambient light, mm.
    pub radius_mm: f64,
    /// Number of rays around a point, from 1 to [`LightSource::MOST_SAMPLES`].
    pub samples: u32,
}

impl AmbientOcclusion {
    /// Default number of rays around a point.
    pub const DEFAULT_SAMPLES: u32 = 32;

    /// Returns the directions of the rays around a point: a Fibonacci lattice over the sphere, of unit vectors.
    pub fn directions(self) -> Vec<DVec3> {
        let toward = DVec3::Z;
        let sky = LightSource { extent: Extent::SKY, ..Light::Directional { toward }.into() };
        let lattice = sky.lattice(self.samples as usize, [0.0; 2]);
        lattice.map(|sample| sample.light.from_point(DVec3::ZERO).0).collect()
    }
}

/// Writes the radius in mm and, where it is not the default, the number of rays: the syntax of `--ambient-occlusion`.
impl fmt::Display for AmbientOcclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.radius_mm)?;
        match self.samples {
            Self::DEFAULT_SAMPLES => Ok(()),
            samples => write!(f, ",samples={samples}"),
        }
    }
}

impl Serialize for AmbientOcclusion {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
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
    /// Occlusion of ambient light by matter near a point; `None`: nothing occludes it.
    pub ambient_occlusion: Option<AmbientOcclusion>,
    /// Shading model for the light that reaches each sample of the volume.
    pub shading: Shading,
    /// Mean cosine `g` of the phase function of Henyey and Greenstein, in `(-1, 1)`, for [`Shading::Phase`]: positive
    /// for forward scattering, 0 for light that is scattered equally in all directions.
    pub mean_cosine: f64,
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

    /// Largest number of shadow maps of a scene: lights without a size, and samples of lights with one.
    pub const MOST_SHADOW_MAPS: usize = 256;

    /// Returns the scene's light sources that are not black, in order. If all are black, it returns only the first one,
    /// since a picture needs one render pass.
    pub fn sources_shining(&self) -> Vec<LightSource> {
        let shining: Vec<_> = self.lights.iter().filter(|source| source.shines()).cloned().collect();
        if shining.is_empty() { self.lights.iter().take(1).cloned().collect() } else { shining }
    }

    /// Returns the lights without size that shadow methods render, one for each shadow map: [`Self::sources_shining`],
    /// with a light that has a size replaced by its samples.
    pub fn shining(&self) -> Vec<LightSource> {
        self.sources_shining().iter().flat_map(LightSource::samples).collect()
    }

    /// Whether a light of the scene that is not black has a size.
    pub fn has_soft_light(&self) -> bool {
        self.sources_shining().iter().any(LightSource::is_soft)
    }

    /// Decides whether errors of transmittance bound the mean error of a picture of the scene.
    ///
    /// # Errors
    /// The reason why they do not.
    pub fn bounds_mean_error(&self) -> Result<(), &'static str> {
        if self.occlusion().is_some() {
            Err("ambient occlusion has errors that shadows do not have")
        } else if self.sources_shining().iter().any(|source| matches!(source.extent, Extent::Map(_))) {
            Err("under the map of a sky, transmittance counts by luminance, which bounds no single colour")
        } else if self.has_soft_light() && self.shading == Shading::Phase {
            Err("a phase function differs over a light with a size")
        } else {
            Ok(())
        }
    }

    /// Ambient occlusion that a picture of the scene has: `None` without ambient light, and with opaque objects, whose
    /// occlusion is not computed.
    pub fn occlusion(&self) -> Option<AmbientOcclusion> {
        self.ambient_occlusion.filter(|_| self.ambient > 0.0 && self.mesh.is_none())
    }

    /// Largest factor by which a phase function increases the light that is scattered to the eye; 1 without one.
    pub fn largest_phase(&self) -> f64 {
        let g = if self.shading == Shading::Phase { self.mean_cosine.abs() } else { 0.0 };
        (1.0 + g) / ((1.0 - g) * (1.0 - g))
    }

    /// Number of lights of the scene that are not black.
    pub fn lights_shining(&self) -> u32 {
        self.lights.iter().filter(|source| source.shines()).count() as u32
    }

    /// Returns the scene's lights that are not black, each with its index from 1 in the scene. The list is empty if
    /// there are fewer than two.
    pub fn lights_apart(&self) -> Vec<(u32, LightSource)> {
        let numbered = (1..).zip(self.lights.iter().cloned()).filter(|(_, source)| source.shines());
        let lights: Vec<_> = numbered.collect();
        if lights.len() > 1 { lights } else { Vec::new() }
    }

    /// Position or direction of the centre of the scene's first light.
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
            ambient_occlusion: None,
            shading: Shading::None,
            mean_cosine: 0.0,
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
    fn dark_lights_are_left_out_and_one_is_always_left() {
        let volume = crate::phantom::Phantom::Slab.build(8).unwrap();
        let [a, dark, black] = [(1.0, 0.25), (1.0, 0.0), (0.0, 3.0)].map(|(grey, intensity)| LightSource {
            color: [grey; 3],
            intensity,
            ..LightSource::default()
        });
        let scene = |lights: &[&LightSource]| Scene {
            lights: lights.iter().copied().cloned().collect(),
            ..Scene::framing(&volume)
        };
        assert_eq!(scene(&[&dark, &a, &black, &a]).shining(), [a.clone(), a.clone()]);
        assert_eq!(scene(&[&dark, &black]).shining(), std::slice::from_ref(&dark));
        let apart = scene(&[&dark, &a, &black, &a]).lights_apart();
        assert_eq!(apart, [(2, a.clone()), (4, a.clone())]);
        assert_eq!(scene(&[&dark, &a]).lights_apart(), []);
        assert_eq!(a.radiance(), [0.25; 3]);
    }
}
