//! Stages of a picture's pipeline, and the stages that each edit invalidates.

use crate::render::{DeviceTransfer, LoadedVolume};
use crate::scene::{Light, Scene};
use crate::transfer::{TransferChange, TransferFunction};

/// Kind of an edit between two pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Change of the volume.
    Volume,
    /// Extinction, at values that the volume has.
    Opacity,
    /// Extinction or colour, at values that the volume does not have.
    UnusedValues,
    /// Colour alone.
    Color,
    /// Change of the number or position of the lights that shine.
    Light,
    /// The shadow method or its settings.
    Method,
    /// The camera.
    Camera,
    /// Visible region, so that a map fitted to the previous view is too small. Follows [`Self::Camera`] or a new picture shape.
    View,
    /// Change of light colours and intensities, ambient light, shading, background, step, skipping or picture size.
    Picture,
}

/// Stage of the pipeline, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Upload of the volume and the value ranges of its bricks.
    Upload,
    /// Tables of the transfer function and the classes of bricks.
    Tables,
    /// Colours in the tables.
    Colors,
    /// Shadow structures.
    Shadows,
    /// Picture.
    Frame,
}

/// Stages that each change invalidates. The plan decides whether an invalid shadow structure is rebuilt
/// ([`needs_shadows`](crate::render::needs_shadows)).
pub const INVALIDATES: [(Change, &[Stage]); 9] = [
    (Change::Volume, &[Stage::Upload, Stage::Tables, Stage::Shadows, Stage::Frame]),
    (Change::Opacity, &[Stage::Tables, Stage::Shadows, Stage::Frame]),
    (Change::UnusedValues, &[]),
    (Change::Color, &[Stage::Colors, Stage::Frame]),
    (Change::Light, &[Stage::Shadows, Stage::Frame]),
    (Change::Method, &[Stage::Shadows, Stage::Frame]),
    (Change::Camera, &[Stage::Frame]),
    (Change::View, &[Stage::Shadows, Stage::Frame]),
    (Change::Picture, &[Stage::Frame]),
];

impl Change {
    /// Whether the change invalidates a stage.
    pub fn invalidates(self, stage: Stage) -> bool {
        INVALIDATES.iter().any(|(change, stages)| *change == self && stages.contains(&stage))
    }

    /// Changes from one scene to another.
    pub fn between_scenes(old: &Scene, new: &Scene) -> Vec<Self> {
        let moved = shining_lights(old) != shining_lights(new);
        // A moved light reports `Light` alone, not its colour as well.
        let lights = if moved { &new.lights } else { &old.lights };
        let rest = Scene { camera: new.camera, lights: lights.clone(), ..old.clone() };
        [(moved, Self::Light), (old.camera != new.camera, Self::Camera), (rest != *new, Self::Picture)]
            .into_iter()
            .filter_map(|(differs, change)| differs.then_some(change))
            .collect()
    }

    /// Change from one transfer function to another, for the pictures of a volume.
    pub(super) fn between_functions(
        (before, tables): (&TransferFunction, &DeviceTransfer),
        after: &TransferFunction,
        loaded: &LoadedVolume,
    ) -> Self {
        // Integrals are linear inside a table's bin: an edit affects values one bin away.
        let bin = tables.value_bin();
        let occurs = |[low, high]: [f64; 2]| loaded.volume.bricks().have_values(low - bin, high + bin);
        match TransferChange::between(before, after, occurs) {
            TransferChange::Nothing => Self::UnusedValues,
            TransferChange::Color => Self::Color,
            TransferChange::Extinction => Self::Opacity,
        }
    }
}

/// Lights that a picture needs shadow structures for.
pub(super) fn shining_lights(scene: &Scene) -> Vec<Light> {
    scene.shining().iter().map(|source| source.light).collect()
}
