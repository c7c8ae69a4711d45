//! Test scenes for claims: stand-ins for the papers' data that this program makes itself, and ways of changing a
//! scene where a claim is about the change.

use crate::scene::{Light, Scene, Skip};
use crate::transfer::{ControlPoint, Quantity, TransferFunction};
use crate::volume::Volume;
use glam::DVec3;
use std::sync::Arc;

/// A scene that stands in for a paper's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandIn {
    /// The column `scene`.
    pub name: &'static str,
    /// Data of the papers that the scene stands in for.
    pub about: &'static str,
    /// The scene file that says the same, but for its extinction.
    pub toml: &'static str,
    /// Factor on the extinction of its transfer function.
    pub extinction: f64,
}

/// Translucent tissue and bone.
pub const CHEST: StandIn = StandIn {
    name: "chest",
    extinction: 1.0,
    about: "the CT scan of a hand of Hadwiger et al.",
    toml: "volume = \"phantom:thorax:96\"\ntf = \"ct\"\nsize = \"256x256\"\nlight = \"dir:0.4,0.5,0.75\"\n",
};
/// A jump of the transfer function in the same volume. The preset's own extinction makes a skin a hundredth of a voxel
/// deep, in which no map's resolution tells light from dark; a twentieth of it stops light within a voxel.
pub const BONES: StandIn = StandIn {
    name: "isosurface",
    about: "the isosurfaces of Hadwiger et al., Figures 3 and 6; opaque objects elsewhere",
    extinction: 0.05,
    toml: "volume = \"phantom:thorax:96\"\ntf = \"isosurface\"\nsize = \"256x256\"\nlight = \"dir:0.4,0.5,0.75\"\n",
};
/// Straight hair with the number of segments of Yuksel and Keyser's Figure 1.
pub const STRAIGHT: StandIn = StandIn {
    name: "straight hair",
    extinction: 1.0,
    about: "the straight hair of Yuksel and Keyser, Figure 1 (150,000 segments); the hair of Kim and Neumann",
    toml: "volume = \"phantom:hair-straight:150000\"\nresolution = 96\nsize = \"256x256\"\nlight = \"dir:0.5,0.6,0.6\"\n",
};
/// Curls with the number of segments of Yuksel and Keyser's Figure 5.
pub const CURLY: StandIn = StandIn {
    name: "curly hair",
    extinction: 1.0,
    about: "the curly hair of Yuksel and Keyser, Figure 5 (1.5 million segments)",
    toml: "volume = \"phantom:hair-curly:1500000\"\nresolution = 96\nsize = \"256x256\"\nlight = \"dir:0.5,0.6,0.6\"\n",
};
/// Locks with gaps between them.
pub const LOCKS: StandIn = StandIn {
    name: "hair in locks",
    extinction: 1.0,
    about: "the clustered strands of Yuksel and Keyser, Figure 8; the trees of Voicu, which are scattered as well",
    toml: "volume = \"phantom:hair-clustered:200000\"\nresolution = 96\nsize = \"256x256\"\nlight = \"dir:0.5,0.6,0.6\"\n",
};
/// Short strands, close together.
pub const FUR: StandIn = StandIn {
    name: "fur",
    extinction: 1.0,
    about: "the fur of Kim and Neumann, Plate 3; the grass of Voicu",
    toml: "volume = \"phantom:hair-fur:200000\"\nresolution = 96\nsize = \"256x256\"\nlight = \"dir:0.5,0.6,0.6\"\n",
};
/// Homogeneous medium: constant extinction throughout the volume.
pub const EVEN: StandIn = StandIn {
    name: "even medium",
    extinction: 1.0,
    about: "the evenly distributed volume of Kim and Neumann, Figure 3a",
    toml: "volume = \"phantom:slab:64\"\ntf = \"uniform\"\nsize = \"256x256\"\nlight = \"dir:0.4,0.5,0.75\"\n",
};

/// A tenth of the strands of the fur, three times as thick: they hide a third of the area.
pub const SPARSE_FUR: StandIn = StandIn {
    name: "sparse fur",
    about: "the grass of Voicu, thinned out",
    toml: "volume = \"phantom:hair-fur:20000\"\nresolution = 96\nsize = \"256x256\"\nlight = \"dir:0.5,0.6,0.6\"\n",
    extinction: 1.0,
};
/// A fortieth of them: less than a tenth of the area.
pub const SPARSEST_FUR: StandIn = StandIn {
    name: "sparsest fur",
    about: "the grass of Voicu, thinned out more",
    toml: "volume = \"phantom:hair-fur:5000\"\nresolution = 96\nsize = \"256x256\"\nlight = \"dir:0.5,0.6,0.6\"\n",
    extinction: 1.0,
};

/// Every stand-in.
pub const STAND_INS: [StandIn; 9] =
    [CHEST, BONES, STRAIGHT, CURLY, LOCKS, FUR, EVEN, SPARSE_FUR, SPARSEST_FUR];

impl StandIn {
    /// The scene of its file with its extinction.
    pub fn of(&self, subject: Subject) -> Subject {
        Subject { tf: denser(&subject.tf, self.extinction), ..subject }
    }
}

/// A scene with all that is measured on it.
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variant {
    /// Factor on all extinction.
    pub extinction: f64,
    /// Another direction towards the light.
    pub toward: Option<[f64; 3]>,
    /// Another way of passing over empty space.
    pub skip: Option<Skip>,
    /// Another side of the picture, which becomes square, pixels.
    pub side_px: Option<u32>,
    /// Another stand-in altogether, by its name.
    pub instead: Option<&'static str>,
}

/// The scene itself.
pub const AS_IS: Variant =
    Variant { extinction: 1.0, toward: None, skip: None, side_px: None, instead: None };
/// Eight times as dense.
pub const DENSER: Variant = Variant { extinction: 8.0, ..AS_IS };
/// An eighth as dense.
pub const SPARSER: Variant = Variant { extinction: 0.125, ..AS_IS };
/// So dense that nothing passes.
pub const OPAQUE: Variant = Variant { extinction: 1e4, ..AS_IS };
/// Every brick is walked through.
pub const NO_SKIPPING: Variant = Variant { skip: Some(Skip::None), ..AS_IS };
/// Lit from above.
pub const FROM_ABOVE: Variant = Variant { toward: Some([0.0, 0.0, 1.0]), ..AS_IS };
/// Lit from the side.
pub const FROM_THE_SIDE: Variant = Variant { toward: Some([1.0, 0.0, 0.0]), ..AS_IS };

impl Variant {
    /// The scene in a picture of so many pixels a side.
    pub const fn pixels(side: u32) -> Self {
        Self { side_px: Some(side), ..AS_IS }
    }

    /// Another stand-in.
    pub const fn instead(scene: &StandIn) -> Self {
        Self { instead: Some(scene.name), ..AS_IS }
    }

    /// Multiplies the variant's extinction by `factor`.
    pub const fn dense(self, factor: f64) -> Self {
        Self { extinction: self.extinction * factor, ..self }
    }

    /// A scene so changed.
    pub fn of(&self, subject: &Subject) -> Subject {
        let Subject { volume, tf, scene } = subject;
        let mut scene = scene.clone();
        if let Some(toward) = self.toward {
            scene.lights = vec![Light::Directional { toward: DVec3::from_array(toward) }.into()];
        }
        scene.skip = self.skip.unwrap_or(scene.skip);
        if let Some(side) = self.side_px {
            [scene.width, scene.height] = [side; 2];
        }
        Subject { volume: Arc::clone(volume), tf: denser(tf, self.extinction), scene }
    }

    /// In words, empty for the scene itself.
    pub fn text(&self) -> String {
        let mut parts: Vec<String> = self.instead.map(str::to_owned).into_iter().collect();
        if self.extinction != 1.0 {
            parts.push(format!("extinction x {}", self.extinction));
        }
        if let Some([x, y, z]) = self.toward {
            parts.push(format!("light dir:{x},{y},{z}"));
        }
        if let Some(side) = self.side_px {
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
        let same = AS_IS.of(&subject);
        assert!(same.scene == subject.scene && same.tf == subject.tf && AS_IS.text().is_empty());
        let changed = FROM_ABOVE.dense(4.0).of(&subject);
        assert_eq!(changed.tf.extinction(1.0), 4.0);
        assert_eq!(changed.scene.light(), Light::Directional { toward: DVec3::Z });
        assert_eq!(FROM_ABOVE.dense(4.0).text(), "extinction x 4, light dir:0,0,1");
        let small = Variant::pixels(64).of(&subject).scene;
        assert_eq!((small.width, small.height, small.camera), (64, 64, subject.scene.camera));
        assert_eq!(NO_SKIPPING.of(&subject).scene.skip, Skip::None);
    }
}
