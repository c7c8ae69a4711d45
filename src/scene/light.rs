//! Lights of a scene: without a size (hard shadows), or with one (soft shadows).

use super::sky_map::SkyMap;
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

/// Size of a light source. Without a map, equal shares of its area or of its solid angle contribute equal light.
#[derive(Debug, Clone, PartialEq, Default)]
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
    /// All directions, with the radiance of a map. Equal shares of its luminance are sampled.
    Map(SkyMap),
}

impl Extent {
    /// All directions: a uniform sky.
    pub const SKY: Self = Self::Cone { angle_deg: 360.0 };
}

/// Light source: position or direction, size, colour and intensity.
#[derive(Debug, Clone, PartialEq)]
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

    /// Returns lights without size that represent the light source: `count` equal shares of its area or directions, in
    /// a Fibonacci lattice shifted by `shift` (two numbers in `[0, 1)`). Each has the radiance of the whole light
    /// source. For a light without a size it returns that light.
    pub fn lattice(&self, count: usize, shift: [f64; 2]) -> impl Iterator<Item = Self> {
        let count = if self.is_soft() { count } else { 1 };
        (0..count).map(move |i| {
            let area = ((i as f64 + 0.5) / count as f64 + shift[0]).fract();
            self.sample([area, (i as f64 * INVERSE_GOLDEN_RATIO + shift[1]).fract()])
        })
    }

    /// Returns the light without size at a position within the light source: the share of the area or of the solid
    /// angle that is nearer to the centre, and the angle about the centre in turns. It has the radiance of the whole
    /// light source, as if all of it shone from there: under a map it depends on the position, with the mean of
    /// [`Self::radiance`].
    pub fn sample(&self, position: [f64; 2]) -> Self {
        let mut color = self.color;
        let light = match &self.extent {
            Extent::Map(map) => match map.sample(position) {
                Some((toward, radiance)) => {
                    (0..3).for_each(|c| color[c] *= radiance[c]);
                    Light::Directional { toward }
                }
                None => uniform(&Extent::SKY, self.light, position),
            },
            extent => uniform(extent, self.light, position),
        };
        // Colours are written with 8 bits, up to 1.
        let scale = color.into_iter().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        let (color, intensity) = match self.extent {
            Extent::Map(_) => (color.map(|c| c / scale), self.intensity * scale),
            _ => (color, self.intensity),
        };
        Self { light, extent: Extent::None, samples: self.samples, color, intensity }
    }

    /// Returns the lights without size by which shadow methods represent the light source, each with its share of the
    /// radiance.
    pub fn samples(&self) -> impl Iterator<Item = Self> {
        let count = self.sample_count();
        self.lattice(count, [0.0; 2])
            .map(move |source| Self { intensity: source.intensity / count as f64, ..source })
    }

    /// Returns the light source with its disc facing a point (world mm), if it is one.
    #[must_use]
    pub fn facing(mut self, point_mm: DVec3) -> Self {
        if let Extent::Disc { facing_mm, .. } = &mut self.extent {
            *facing_mm = point_mm;
        }
        self
    }

    /// Returns the light source turned about a point (world mm). A sky has no direction, and stays; one with a map
    /// turns about the z axis only.
    #[must_use]
    pub fn turned(mut self, turn: DQuat, about_mm: DVec3) -> Self {
        match &mut self.extent {
            Extent::Map(map) => {
                map.turn_deg = (map.turn_deg + 2.0 * turn.z.atan2(turn.w).to_degrees()) % 360.0;
                self.light = Light::Directional { toward: map.mean_direction() };
                self
            }
            extent if *extent == Extent::SKY => self,
            _ => Self { light: self.light.turned(turn, about_mm), ..self },
        }
    }

    /// Returns the light source without colour: white, of intensity 1.
    #[must_use]
    pub fn uncolored(self) -> Self {
        Self { color: Self::WHITE, intensity: 1.0, ..self }
    }

    /// Returns the linear RGB of the light that reaches an unshadowed point: colour times intensity, times the mean of
    /// its map.
    pub fn radiance(&self) -> [f64; 3] {
        let mean = match &self.extent {
            Extent::Map(SkyMap { radiance: Some(radiance), .. }) => radiance.mean(),
            _ => Self::WHITE,
        };
        std::array::from_fn(|c| self.color[c] * self.intensity * mean[c])
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

    /// Formats a light source in the syntax of `--light`, with coordinates changed by `rounded` and written by
    /// `number`.
    fn written(&self, rounded: impl Fn(f64) -> f64, number: impl Fn(f64) -> String) -> String {
        let (kind, v) = self.light.kind();
        let [x, y, z] = v.to_array().map(|c| number(rounded(c)));
        let place = format!("{x},{y},{z}");
        let samples = match self.samples {
            Self::DEFAULT_SAMPLES => String::new(),
            samples => format!(",samples={samples}"),
        };
        let light = match &self.extent {
            Extent::None => format!("{kind}:{place}"),
            Extent::Map(map) if map.turn_deg == 0.0 => format!("sky:{}{samples}", map.path),
            Extent::Map(map) => format!("sky:{},turn={}{samples}", map.path, map.turn_deg),
            sky if *sky == Extent::SKY && v == DVec3::Z => format!("sky{samples}"),
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

/// Returns the light without size at a position within a light with a size of equal radiance ([`LightSource::sample`]).
fn uniform(extent: &Extent, light: Light, [area, turns]: [f64; 2]) -> Light {
    let (sin, cos) = (TAU * turns).sin_cos();
    match (extent, light) {
        (Extent::Cone { angle_deg }, Light::Directional { toward }) => {
            // The solid angle of a cone is proportional to the squared sine of a quarter of its opening angle.
            let half_sine = (0.25 * angle_deg).to_radians().sin() * area.sqrt();
            let across = 2.0 * half_sine * (1.0 - half_sine * half_sine).max(0.0).sqrt();
            let axis = toward.normalize();
            let [u, v] = basis(axis);
            let toward = (1.0 - 2.0 * half_sine * half_sine) * axis + across * (cos * u + sin * v);
            Light::Directional { toward: toward.normalize() }
        }
        (Extent::Disc { radius_mm, facing_mm }, Light::Point { position }) => {
            let [u, v] = basis((position - facing_mm).normalize_or(DVec3::Z));
            Light::Point { position: position + radius_mm * area.sqrt() * (cos * u + sin * v) }
        }
        _ => light,
    }
}

/// Returns two unit vectors that are orthogonal to a unit vector and to each other (Frisvad 2012, *Building an
/// Orthonormal Basis from a 3D Unit Vector Without Normalization*). They depend smoothly on it, except near -z.
fn basis(axis: DVec3) -> [DVec3; 2] {
    let DVec3 { x, y, z } = axis;
    if z < -0.999_999 {
        return axis.any_orthonormal_pair().into();
    }
    let a = 1.0 / (1.0 + z);
    [DVec3::new(1.0 - x * x * a, -x * y * a, -x), DVec3::new(-x * y * a, 1.0 - y * y * a, -y)]
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
        for sample in source.lattice(count, [0.3, 0.8]) {
            let Light::Point { position: p } = sample.light else { panic!("point") };
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
            let directions =
                source.lattice(count, [0.0; 2]).map(|sample| sample.light.from_point(DVec3::ZERO).0);
            let mean = directions.sum::<DVec3>() / count as f64;
            assert!((mean - expected * toward).length() < 2e-3, "{angle_deg}: {mean}");
        }
    }

    #[test]
    fn samples_move_smoothly_with_the_light() {
        for (toward, step) in [(DVec3::X, DVec3::Z), (DVec3::new(0.3, -0.5, -0.7).normalize(), DVec3::Y)] {
            let samples = |toward: DVec3| {
                let light = Light::Directional { toward: toward.normalize() };
                let sun = LightSource { extent: Extent::Cone { angle_deg: 40.0 }, ..light.into() };
                sun.lattice(16, [0.0; 2]).map(|s| s.light.from_point(DVec3::ZERO).0).collect::<Vec<_>>()
            };
            let [before, after] = [-1e-3, 1e-3].map(|move_by| samples(toward + move_by * step));
            let moved = before.iter().zip(&after).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            assert!(moved < 4e-3, "{toward}: {moved}");
            assert!(before.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
        }
    }

    #[test]
    fn samples_share_the_radiance() {
        let hard = LightSource::default();
        assert_eq!(hard.samples().collect::<Vec<_>>(), std::slice::from_ref(&hard));
        let sky = LightSource { extent: Extent::SKY, intensity: 2.0, samples: 8, ..hard.clone() };
        assert_eq!(sky.clone().turned(DQuat::from_rotation_x(1.0), DVec3::ZERO), sky);
        let samples: Vec<_> = sky.samples().collect();
        assert_eq!(samples.len(), 8);
        assert!(samples.iter().all(|s| !s.is_soft() && s.intensity == 0.25));
        // A single sample is within the light, at the middle of its area.
        let sun = LightSource { extent: Extent::Cone { angle_deg: 1e-5 }, samples: 1, ..hard.clone() };
        let only: Vec<_> = sun.samples().collect();
        assert_eq!(only.len(), 1);
        assert!(
            only[0].light.from_point(DVec3::ZERO).0.distance(hard.light.from_point(DVec3::ZERO).0) < 1e-7
        );
    }
}
