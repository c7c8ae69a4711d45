//! Test scenes for claims: stand-ins for the papers' data that this program makes itself, and ways of changing a
//! scene where a claim is about the change.

use crate::scene::{Light, Scene, Skip};
use crate::transfer::{ControlPoint, Quantity, TransferFunction};
use crate::volume::Volume;
use glam::DVec3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

/// A scene that stands in for a paper's.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandIn {
    /// The column `scene`.
    pub name: String,
    /// Data of the papers that the scene stands in for.
    pub about: String,
    /// Text of the scene file, without the factor on the extinction.
    pub toml: String,
    /// Factor on the extinction of the scene's transfer function.
    #[serde(default = "one")]
    pub extinction: f64,
}

fn one() -> f64 {
    1.0
}

/// Every stand-in, from `scenes.toml`.
pub static STAND_INS: LazyLock<Vec<StandIn>> = LazyLock::new(|| {
    // A test reads the built-in file.
    let file: Option<BTreeMap<String, Vec<StandIn>>> = toml::from_str(include_str!("scenes.toml")).ok();
    file.and_then(|mut file| file.remove("scene")).unwrap_or_default()
});

impl StandIn {
    /// Applies the extinction factor to a scene.
    pub fn of(&self, subject: Subject) -> Subject {
        Subject { tf: denser(&subject.tf, self.extinction), ..subject }
    }
}

/// Scene of claims with its volume and transfer function.
#[derive(Clone)]
pub struct Subject {
    /// The voxels.
    pub volume: Arc<Volume>,
    /// Transfer function from voxel values to colour and extinction.
    pub tf: TransferFunction,
    /// Camera, light, and size of the picture.
    pub scene: Scene,
}

/// A change to a scene.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Variant {
    /// Factor on all extinction.
    pub extinction: f64,
    /// Direction towards the light, if it differs from the scene's.
    pub light: Option<DVec3>,
    /// Skipping of empty space, if it differs from the scene's.
    pub skip: Option<Skip>,
    /// Pixels a side of a square picture, instead of the size of the scene.
    pub pixels: Option<u32>,
    /// Name of another stand-in.
    pub scene: Option<String>,
}

/// The scene itself.
impl Default for Variant {
    fn default() -> Self {
        Self { extinction: 1.0, light: None, skip: None, pixels: None, scene: None }
    }
}

impl Variant {
    /// Applies the change to a scene.
    pub fn of(&self, subject: &Subject) -> Subject {
        let Subject { volume, tf, scene } = subject;
        let mut scene = scene.clone();
        if let Some(toward) = self.light {
            scene.lights = vec![Light::Directional { toward }.into()];
        }
        scene.skip = self.skip.unwrap_or(scene.skip);
        if let Some(side) = self.pixels {
            [scene.width, scene.height] = [side; 2];
        }
        Subject { volume: Arc::clone(volume), tf: denser(tf, self.extinction), scene }
    }

    /// Description of the change; empty for the unchanged scene.
    pub fn text(&self) -> String {
        let mut parts: Vec<String> = self.scene.iter().cloned().collect();
        if self.extinction != 1.0 {
            parts.push(format!("extinction x {}", self.extinction));
        }
        if let Some(DVec3 { x, y, z }) = self.light {
            parts.push(format!("light dir:{x},{y},{z}"));
        }
        if let Some(side) = self.pixels {
            parts.push(format!("{side}x{side} pixels"));
        }
        if self.skip == Some(Skip::None) {
            parts.push("--skip none".into());
        }
        parts.join(", ")
    }
}

/// The transfer function with all its extinction times a factor, exactly so: opacities are over a shorter length then.
fn denser(tf: &TransferFunction, factor: f64) -> TransferFunction {
    let mut tf = tf.clone();
    match tf.quantity {
        Quantity::Opacity => tf.reference_length_mm /= factor,
        Quantity::Extinction => {
            let scaled = |p: &ControlPoint| ControlPoint { amount: p.amount * factor, ..*p };
            tf.points = tf.points.iter().map(scaled).collect();
        }
    }
    tf
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;

    #[test]
    fn extinction_is_scaled_whatever_a_file_gives() {
        for quantity in [Quantity::Opacity, Quantity::Extinction] {
            let tf = TransferFunction::new(quantity, &[(0.0, 0.0), (100.0, 0.5)]);
            let eight = denser(&tf, 8.0);
            for value in [-5.0, 30.0, 77.0, 100.0, 300.0] {
                assert!((eight.extinction(value) - 8.0 * tf.extinction(value)).abs() < 1e-12, "{value}");
            }
        }
    }

    #[test]
    fn a_variant_changes_what_it_names_and_nothing_else() {
        let volume = Arc::new(Phantom::Slab.build(8).unwrap());
        let scene = Scene::framing(&volume);
        let tf = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.0), (1.0, 1.0)]);
        let subject = Subject { volume, tf, scene };
        let as_is = Variant::default();
        let same = as_is.of(&subject);
        assert!(same.scene == subject.scene && same.tf == subject.tf && as_is.text().is_empty());
        let from_above = Variant { light: Some(DVec3::Z), extinction: 4.0, ..as_is.clone() };
        let changed = from_above.of(&subject);
        assert_eq!(changed.tf.extinction(1.0), 4.0);
        assert_eq!(changed.scene.light(), Light::Directional { toward: DVec3::Z });
        assert_eq!(from_above.text(), "extinction x 4, light dir:0,0,1");
        let small = Variant { pixels: Some(64), ..as_is.clone() }.of(&subject).scene;
        assert_eq!((small.width, small.height, small.camera), (64, 64, subject.scene.camera));
        assert_eq!(Variant { skip: Some(Skip::None), ..as_is }.of(&subject).scene.skip, Skip::None);
        assert_eq!(STAND_INS.len(), 9);
    }
}
