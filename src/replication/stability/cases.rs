//! The cases of `cases.toml`: what is stiff or extreme in a volume, a transfer function, a light or a setting.

use super::fields::{Field, SIDE};
use crate::error::{Error, Result};
use crate::scene::Light;
use crate::transfer::{Quantity, TransferFunction};
use crate::volume::Volume;
use glam::{DAffine3, DVec3};
use serde::Deserialize;
use std::sync::Arc;

/// The name of the case that the costs of the others are compared with.
pub const ORDINARY: &str = "ordinary";

/// One case: everything but the method.
pub struct Case {
    /// Name of the case, in the form that `--case` takes.
    pub name: String,
    /// Description of the stiff or extreme property that the case tests.
    pub about: String,
    /// The voxels.
    pub volume: Arc<Volume>,
    /// Transfer function from voxel values to colour and extinction.
    pub tf: TransferFunction,
    /// Lights, each tested alone.
    pub lights: Vec<Light>,
    /// Settings, by key, that replace those of the methods.
    pub settings: Vec<(String, String)>,
    /// Whether the case is only for methods that know every key of the settings.
    pub needs_settings: bool,
    /// Eye-ray step, in units of the smallest voxel spacing.
    pub step: f64,
}

/// File with all cases.
#[derive(Deserialize)]
struct CaseFile {
    case: Vec<CaseEntry>,
}

/// One case of the file.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct CaseEntry {
    name: String,
    about: String,
    field: Field,
    /// Values to which 0 and 1 of the field are mapped.
    values: [f64; 2],
    dims: [usize; 3],
    /// World coordinates (mm) of the unit index vectors and of the origin.
    affine: [DVec3; 4],
    /// Extinction (1/mm) by value.
    extinction: Vec<(f64, f64)>,
    /// Opacity by value.
    opacity: Vec<(f64, f64)>,
    /// Number of points of an extinction that follows a sine wave.
    waves: u32,
    reference_length_mm: f64,
    lights: Vec<LightEntry>,
    settings: Vec<(String, String)>,
    needs_settings: bool,
    step: f64,
}

impl Default for CaseEntry {
    fn default() -> Self {
        Self {
            name: String::new(),
            about: String::new(),
            field: Field::default(),
            values: [0.0, 1.0],
            dims: [SIDE; 3],
            affine: [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO],
            extinction: Vec::new(),
            opacity: Vec::new(),
            waves: 0,
            reference_length_mm: 1.0,
            lights: Vec::new(),
            settings: Vec::new(),
            needs_settings: false,
            step: 0.5,
        }
    }
}

/// Direction towards a light, or the position of one, mm.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum LightEntry {
    Dir(DVec3),
    Point(DVec3),
}

/// Every case, the ordinary one first.
///
/// # Errors
/// A malformed built-in file; a test reads it.
pub fn all() -> Result<Vec<Case>> {
    let bad = |e| Error::runtime("cannot read stability cases", "built-in file", e);
    let file: CaseFile = toml::from_str(include_str!("cases.toml")).map_err(bad)?;
    file.case.into_iter().map(CaseEntry::into_case).collect()
}

impl CaseEntry {
    fn into_case(self) -> Result<Case> {
        let [x, y, z, origin] = self.affine;
        let world_from_index = DAffine3::from_cols(x, y, z, origin);
        let volume = self.field.volume(world_from_index, self.dims, self.values)?;
        let lights = match self.lights.is_empty() {
            true => default_lights(&volume).into(),
            false => self.lights.iter().map(LightEntry::light).collect(),
        };
        let tf = self.transfer_function();
        let Self { name, about, settings, needs_settings, step, .. } = self;
        Ok(Case { name, about, volume, tf, lights, settings, needs_settings, step })
    }

    fn transfer_function(&self) -> TransferFunction {
        let wave = |i| f64::from(i) / f64::from(self.waves - 1);
        let waves: Vec<_> = (0..self.waves).map(wave).map(|v| (v, 0.2 + 0.2 * (40.0 * v).sin())).collect();
        let top = self.values[1];
        let haze = vec![(0.1 * top, 0.0), (top, 0.3)];
        let (quantity, points) = match (self.opacity.is_empty(), self.extinction.is_empty()) {
            (false, _) => (Quantity::Opacity, &self.opacity),
            (_, false) => (Quantity::Extinction, &self.extinction),
            _ if self.waves > 0 => (Quantity::Extinction, &waves),
            _ => (Quantity::Extinction, &haze),
        };
        let mut tf = TransferFunction::new(quantity, points);
        tf.name = "stability case".into();
        tf.reference_length_mm = self.reference_length_mm;
        tf.points.iter_mut().for_each(|p| p.color = [1.0, 0.8, 0.6]);
        tf
    }
}

impl LightEntry {
    fn light(&self) -> Light {
        match *self {
            Self::Dir(toward) => Light::Directional { toward },
            Self::Point(position) => Light::Point { position },
        }
    }
}

/// A light at infinity in no special direction, and a point light well outside the volume.
fn default_lights(volume: &Volume) -> [Light; 2] {
    let corners = volume.corners_mm();
    let center = corners.iter().sum::<DVec3>() / 8.0;
    let radius = corners.iter().map(|c| c.distance(center)).fold(0.0, f64::max);
    let position = center + DVec3::new(-0.6, 0.35, 0.7).normalize() * 3.0 * radius;
    [Light::Directional { toward: DVec3::new(0.4, -0.5, 0.75) }, Light::Point { position }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn names_differ_and_can_be_written_on_a_command_line() {
        let cases = all().unwrap();
        assert_eq!(cases[0].name, ORDINARY);
        let names: HashSet<_> = cases.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names.len(), cases.len());
        assert!(names.iter().all(|n| n.chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c))));
    }

    #[test]
    fn volumes_have_the_properties_of_their_names() {
        let cases = all().unwrap();
        let find = |name: &str| cases.iter().find(|c| c.name == name).unwrap();
        assert!(find("nan").volume.provenance.non_finite > 100);
        assert!(find("infinities").volume.provenance.non_finite > 1000);
        let [low, high] = find("values-1e-30").volume.value_range();
        assert!(low == 0.0 && high > 0.9e-30 && high < 1.1e-30);
        assert_eq!(find("outlier").volume.value_range()[1], 1e6);
        assert_eq!(find("grid-one-brick").volume.dims(), [3; 3]);
        assert_eq!(find("uniform-1e6").tf.extinction(0.3), 1e6);
        // Both lights wherever the case is not about the light itself.
        assert!(
            cases
                .iter()
                .filter(|c| c.lights.len() < 2)
                .all(|c| c.name.contains("light-") || c.name == "map-4096")
        );
    }
}
