//! Lights of a scene: without a size (hard shadows), or with one (soft shadows).

use crate::files::color;
use glam::{DQuat, DVec3};
use serde::{Serialize, Serializer};
use std::f64::consts::TAU;

/// Step of the second coordinate of a Fibonacci lattice: the inverse of the golden ratio.
const INVERSE_GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;

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
        LightSource::from(*self).text()
    }

    /// Returns the light turned about a point (world mm).
    #[must_use]
    pub fn turned(self, turn: DQuat, about_mm: DVec3) -> Self {
        match self {
            Self::Directional { toward } => Self::Directional { toward: (turn * toward).normalize() },
            Self::Point { position } => Self::Point { position: about_mm + turn * (position - about_mm) },
        }
    }
}

impl Default for Light {
    fn default() -> Self {
        Self::Directional { toward: DVec3::new(0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2) }
    }
}

/// Size of a light source. Equal shares of its area or of its solid angle contribute equal light.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Extent {
    /// The light has no size, and casts hard shadows.
    #[default]
    None,
    /// Disc about the position of a point light.
    Disc {
        /// Radius of the disc, mm.
        radius_mm: f64,
        /// Point that the disc faces, world mm: the centre of the volume in an opened scene.
        facing_mm: DVec3,
    },
    /// Cone of directions about that of a directional light, such as the sun. 360 degrees are all directions: a sky.
    Cone {
        /// Angular diameter of the light source, degrees, in `(0, 360]`.
        angle_deg: f64,
    },
}

impl Extent {
    /// All directions: a uniform sky.
    pub const SKY: Self = Self::Cone { angle_deg: 360.0 };
}

/// Light source: position or direction, size, colour and intensity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSource {
    /// Position (point light) or direction (directional light) of the light source's centre, without colour.
    pub light: Light,
    /// Size of the light source.
    pub extent: Extent,
    /// Number of lights without size by which shadow methods represent a light with a size: each has a shadow map.
    pub samples: u32,
    /// Colour of the light source, linear RGB in `[0, 1]`.
    pub color: [f64; 3],
    /// Intensity of the light source: a factor on its colour, 0 or more.
    pub intensity: f64,
}

impl LightSource {
    /// Default colour of a light source: white, linear RGB.
    pub const WHITE: [f64; 3] = [1.0; 3];
    /// Default number of lights without size that represent a light with a size.
    pub const DEFAULT_SAMPLES: u32 = 16;
    /// Largest number of lights without size that represent a light with a size.
    pub const MOST_SAMPLES: u32 = 256;

    /// Whether the light source has a size, and so casts soft shadows.
    pub fn is_soft(&self) -> bool {
        self.extent != Extent::None
    }

    /// Number of shadow maps of the light source.
    pub fn sample_count(&self) -> usize {
        if self.is_soft() { self.samples.max(1) as usize } else { 1 }
    }

    /// Returns lights without size that represent the light source: `count` equal shares of its area or directions, in a
    /// Fibonacci lattice shifted by `shift` (two numbers in `[0, 1)`). For a light without a size it returns that light.
    pub fn lattice(&self, count: usize, shift: [f64; 2]) -> impl Iterator<Item = Light> + use<> {
        let source = *self;
        let count = if self.is_soft() { count } else { 1 };
        (0..count).map(move |i| {
            let area = ((i as f64 + 0.5) / count as f64 + shift[0]).fract();
            source.sample([area, (i as f64 * INVERSE_GOLDEN_RATIO + shift[1]).fract()])
        })
    }

    /// Returns the light without size at a position within the light source: the share of the area or of the solid angle
    /// that is nearer to the centre, and the angle about the centre in turns.
    pub fn sample(&self, [area, turns]: [f64; 2]) -> Light {
        let (sin, cos) = (TAU * turns).sin_cos();
        match (self.extent, self.light) {
            (Extent::Cone { angle_deg }, Light::Directional { toward }) => {
                // The solid angle of a cone is proportional to the squared sine of a quarter of its opening angle.
                let half_sine = (0.25 * angle_deg).to_radians().sin() * area.sqrt();
                let across = 2.0 * half_sine * (1.0 - half_sine * half_sine).max(0.0).sqrt();
                let axis = toward.normalize();
                let (u, v) = axis.any_orthonormal_pair();
                let toward = (1.0 - 2.0 * half_sine * half_sine) * axis + across * (cos * u + sin * v);
                Light::Directional { toward: toward.normalize() }
            }
            (Extent::Disc { radius_mm, facing_mm }, Light::Point { position }) => {
                let (u, v) = (facing_mm - position).normalize_or(DVec3::Z).any_orthonormal_pair();
                Light::Point { position: position + radius_mm * area.sqrt() * (cos * u + sin * v) }
            }
            (_, light) => light,
        }
    }

    /// Returns the lights without size by which shadow methods represent the light source, each with its share of the
    /// radiance.
    pub fn samples(&self) -> impl Iterator<Item = Self> + use<> {
        let (count, source) = (self.sample_count(), *self);
        let intensity = self.intensity / count as f64;
        self.lattice(count, [0.0; 2]).map(move |light| Self {
            light,
            extent: Extent::None,
            intensity,
            ..source
        })
    }

    /// Returns the light source with its disc facing a point (world mm), if it is one.
    #[must_use]
    pub fn facing(mut self, point_mm: DVec3) -> Self {
        if let Extent::Disc { facing_mm, .. } = &mut self.extent {
            *facing_mm = point_mm;
        }
        self
    }

    /// Returns the light source turned about a point (world mm). A sky has no direction, and stays.
    #[must_use]
    pub fn turned(self, turn: DQuat, about_mm: DVec3) -> Self {
        if self.extent == Extent::SKY {
            self
        } else {
            Self { light: self.light.turned(turn, about_mm), ..self }
        }
    }

    /// Returns the light source without colour: white, of intensity 1.
    #[must_use]
    pub fn uncolored(self) -> Self {
        Self { color: Self::WHITE, intensity: 1.0, ..self }
    }

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
        // Further digits of a normalised direction carry no information.
        self.written(|v| (v * 1e4).round() / 1e4 + 0.0, |x| format!("{x}"))
    }

    /// Formats a light source in the syntax of `--light`, with coordinates changed by `rounded` and written by `number`.
    fn written(&self, rounded: impl Fn(f64) -> f64, number: impl Fn(f64) -> String) -> String {
        let (kind, v) = self.light.kind();
        let [x, y, z] = v.to_array().map(|c| number(rounded(c)));
        let place = format!("{x},{y},{z}");
        let samples = match self.samples {
            Self::DEFAULT_SAMPLES => String::new(),
            samples => format!(",samples={samples}"),
        };
        let light = match self.extent {
            Extent::None => format!("{kind}:{place}"),
            Extent::SKY if v == DVec3::Z => format!("sky{samples}"),
            Extent::Cone { angle_deg } => format!("sun:{place},angle={angle_deg}{samples}"),
            Extent::Disc { radius_mm, .. } => format!("disc:{place},radius={radius_mm}{samples}"),
        };
        light + &self.factors()
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
        let samples = Self::DEFAULT_SAMPLES;
        Self { light, extent: Extent::None, samples, color: Self::WHITE, intensity: 1.0 }
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
        serializer.serialize_str(&self.written(|v| v, |x| format!("{x:?}")))
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
        let disc = LightSource { extent: disc(20.5), samples: 4, ..source };
        assert_eq!(disc.text(), "disc:0,2,-300.25,radius=20.5,samples=4,color=#ff0000,intensity=2.5");
    }

    fn disc(radius_mm: f64) -> Extent {
        Extent::Disc { radius_mm, facing_mm: DVec3::ZERO }
    }

    #[test]
    fn samples_are_uniform_over_the_light() {
        let position = DVec3::new(0.0, 30.0, 40.0);
        let source = LightSource { extent: disc(2.0), ..Light::Point { position }.into() };
        let count = 4096;
        let (mut mean, mut squares) = (DVec3::ZERO, 0.0);
        for light in source.lattice(count, [0.3, 0.8]) {
            let Light::Point { position: p } = light else { panic!("point") };
            assert!((p - position).dot(position).abs() < 1e-9 && (p - position).length() <= 2.0);
            mean += (p - position) / count as f64;
            squares += (p - position).length_squared() / count as f64;
        }
        assert!(mean.length() < 2e-3 && (squares - 2.0).abs() < 1e-3, "{mean} {squares}");
        for (angle_deg, expected) in
            [(60.0, 0.5 * (1.0 + 30_f64.to_radians().cos())), (180.0, 0.5), (360.0, 0.0)]
        {
            let toward = DVec3::new(0.0, 0.6, 0.8);
            let source =
                LightSource { extent: Extent::Cone { angle_deg }, ..Light::Directional { toward }.into() };
            let directions = source.lattice(count, [0.0; 2]).map(|light| light.from_point(DVec3::ZERO).0);
            let mean = directions.sum::<DVec3>() / count as f64;
            assert!((mean - expected * toward).length() < 2e-3, "{angle_deg}: {mean}");
        }
    }

    #[test]
    fn samples_share_the_radiance() {
        let hard = LightSource::default();
        assert_eq!(hard.samples().collect::<Vec<_>>(), [hard]);
        let sky = LightSource { extent: Extent::SKY, intensity: 2.0, samples: 8, ..hard };
        assert_eq!(sky.turned(DQuat::from_rotation_x(1.0), DVec3::ZERO), sky);
        let samples: Vec<_> = sky.samples().collect();
        assert_eq!(samples.len(), 8);
        assert!(samples.iter().all(|s| !s.is_soft() && s.intensity == 0.25));
        // A single sample is within the light, at the middle of its area.
        let sun = LightSource { extent: Extent::Cone { angle_deg: 1e-5 }, samples: 1, ..hard };
        let only: Vec<_> = sun.samples().collect();
        assert_eq!(only.len(), 1);
        assert!(
            only[0].light.from_point(DVec3::ZERO).0.distance(hard.light.from_point(DVec3::ZERO).0) < 1e-7
        );
    }
}
