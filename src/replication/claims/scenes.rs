//! Scenes for testing claims of papers: built-in substitutes for the papers' data, and variants of a scene.

use crate::scene::{Light, Scene, Skip};
use crate::transfer::{ControlPoint, Quantity, TransferFunction};
use crate::volume::Volume;
use glam::DVec3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

/// Built-in scene that replaces the data used in a paper.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandIn {
    /// Name of the built-in scene, as in the column `scene` of `claims.csv`.
    pub name: String,
    /// Description of the data in papers that this built-in scene replaces.
    pub about: String,
    /// Text of the built-in scene's TOML file. The factor `extinction` is not applied in it.
    pub toml: String,
    /// Factor by which the extinction of the built-in scene's transfer function is multiplied.
    #[serde(default = "one")]
    pub extinction: f64,
}

fn one() -> f64 {
    1.0
}

/// All built-in scenes for testing claims of papers, from `scenes.toml`.
pub static STAND_INS: LazyLock<Vec<StandIn>> = LazyLock::new(|| {
    // A test reads the built-in file.
    let file: Option<BTreeMap<String, Vec<StandIn>>> = toml::from_str(include_str!("scenes.toml")).ok();
    file.and_then(|mut file| file.remove("scene")).unwrap_or_default()
});

impl StandIn {
    /// Multiplies the extinction of a scene's transfer function by the factor of this built-in scene.
    pub fn of(&self, subject: Subject) -> Subject {
        Subject { tf: denser(&subject.tf, self.extinction), ..subject }
    }
}

/// Scene for testing claims of papers, with its volume and transfer function.
#[derive(Clone)]
pub struct Subject {
    /// Volume of the scene on which claims of papers are tested.
    pub volume: Arc<Volume>,
    /// Transfer function of the scene on which claims of papers are tested, from scalar values to colour and
    /// extinction.
    pub tf: TransferFunction,
    /// Camera, light and picture size of the scene on which claims of papers are tested.
    pub scene: Scene,
}

/// Variant of a scene on which a paper's claim is tested: changes, such as of extinction, light or picture size.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Variant {
    /// Factor by which all extinction of the scene is multiplied in this variant.
    pub extinction: f64,
    /// Direction towards the light in the scene variant, if it differs from the original scene's.
    pub light: Option<DVec3>,
    /// Mode of empty-space skipping in the scene variant, if it differs from the original scene's.
    pub skip: Option<Skip>,
    /// Width and height of a square picture, in pixels, if its size differs from the original scene's.
    pub pixels: Option<u32>,
    /// Name of another built-in scene that replaces the original scene in this variant.
    pub scene: Option<String>,
}

/// Creates the scene variant that leaves a scene unchanged.
impl Default for Variant {
    fn default() -> Self {
        Self { extinction: 1.0, light: None, skip: None, pixels: None, scene: None }
    }
}

impl Variant {
    /// Returns a scene with the changes of this variant: extinction, light, empty-space skipping and picture size.
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

    /// Describes in words how this variant changes a scene; empty for an unchanged scene.
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

/// Returns the transfer function with all extinction multiplied by a factor, exactly. If the transfer function gives
/// opacities, their reference length is divided by the factor.
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
