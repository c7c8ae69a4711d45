//! Stability cases of `cases.toml`: volumes, transfer functions, lights and settings with extreme or ill-conditioned
//! properties.

use super::fields::{Field, SIDE};
use crate::error::{Error, Result};
use crate::scene::Light;
use crate::transfer::{Quantity, TransferFunction};
use crate::volume::Volume;
use glam::{DAffine3, DVec3};
use serde::Deserialize;
use std::sync::Arc;

/// Name of the ordinary stability case. Time and memory of a method in this case are the baseline for all others.
pub const ORDINARY: &str = "ordinary";

/// Stability case: a volume, transfer function, lights and settings on which every shadow method is tested.
pub struct Case {
    /// Name of the stability case, as the option `--case` takes it.
    pub name: String,
    /// Description of the extreme property that the stability case tests.
    pub about: String,
    /// Volume of the stability case, on which every shadow method is tested.
    pub volume: Arc<Volume>,
    /// Transfer function of the stability case, from voxel values to colour and extinction.
    pub tf: TransferFunction,
    /// Lights of the stability case. Shadow methods are tested with each light alone.
    pub lights: Vec<Light>,
    /// Settings that the stability case imposes on the tested shadow methods, as `(name, value)` pairs. They override
    /// a method's own settings.
    pub settings: Vec<(String, String)>,
    /// Whether the stability case applies only to shadow methods that have all of the settings it imposes.
    pub needs_settings: bool,
    /// Step length of the renderer's camera rays in the stability case, in units of the smallest voxel spacing.
    pub step: f64,
}

/// Contents of `cases.toml`, the file that defines the stability cases.
#[derive(Deserialize)]
struct CaseFile {
    case: Vec<CaseEntry>,
}

/// Entry of `cases.toml`: one stability case.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct CaseEntry {
    name: String,
    about: String,
    field: Field,
    /// Voxel values that the scalar field's values 0 and 1 become in the volume; values between are mapped linearly.
    values: [f64; 2],
    dims: [usize; 3],
    /// World vectors of one voxel step along each index axis of the volume, and world position of index (0, 0, 0),
    /// mm.
    affine: [DVec3; 4],
    /// Control points of the stability case's transfer function as pairs of voxel value and extinction (1/mm).
    extinction: Vec<(f64, f64)>,
    /// Control points of the stability case's transfer function as pairs of voxel value and opacity.
    opacity: Vec<(f64, f64)>,
    /// Number of control points in the stability case's transfer function if its extinction is a sine wave; 0 if not.
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

/// Light of a stability case: the direction towards a directional light, or the position of a point light, mm.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum LightEntry {
    Dir(DVec3),
    Point(DVec3),
}

/// Reads all stability cases from the built-in file `cases.toml`, the ordinary case first.
///
/// # Errors
/// The built-in file of cases is malformed; a test reads it.
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

/// Default lights of a stability case: an oblique directional light, and a point light well outside the volume.
fn default_lights(volume: &Volume) -> [Light; 2] {
    let (center, radius) = volume.bounding_sphere_mm();
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
        // Both default lights apply unless the case is about the light itself.
        assert!(
            cases
                .iter()
                .filter(|c| c.lights.len() < 2)
                .all(|c| c.name.contains("light-") || c.name == "map-4096")
        );
    }
}
