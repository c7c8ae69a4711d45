//! Stages of the rendering pipeline, and the stages that each kind of edit invalidates.

use crate::render::{DeviceTransfer, LoadedVolume};
use crate::scene::{Light, Scene};
use crate::transfer::{TransferChange, TransferFunction};

/// Kind of an edit between two rendered pictures, such as a change of the camera or of the opacity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Edit that replaces the volume.
    Volume,
    /// Edit of the transfer function's extinction at scalar values that occur in the volume.
    Opacity,
    /// Edit of the transfer function's extinction or colour at scalar values that do not occur in the volume.
    UnusedValues,
    /// Edit of the transfer function's colours without a change of its extinction.
    Color,
    /// Edit of the number or positions of the lights that are not black.
    Light,
    /// Edit of the shadow method or its settings.
    Method,
    /// Edit that moves the camera.
    Camera,
    /// Edit after which the visible region exceeds the area of a shadow map fitted to the previous view. It follows
    /// [`Self::Camera`] or a new picture shape.
    View,
    /// Edit of the light colours and intensities, ambient light, shading, background, ray step, empty-space skipping
    /// or picture size.
    Picture,
}

/// Stage of the rendering pipeline, in order of execution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Pipeline stage: upload of the volume, and computation of the value range of each brick (block of voxels).
    Upload,
    /// Pipeline stage: computation of the transfer-function tables, and classification of bricks (blocks of voxels)
    /// as empty or not.
    Tables,
    /// Pipeline stage: update of the colours in the transfer-function tables.
    Colors,
    /// Pipeline stage: build of the shadow maps or other shadow data structures.
    Shadows,
    /// Pipeline stage: ray casting of the picture.
    Frame,
}

/// Table of the pipeline stages that each kind of edit invalidates. An invalid shadow map is rebuilt only if the
/// picture needs shadows ([`needs_shadows`](crate::render::needs_shadows)).
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
    /// Whether this kind of edit invalidates a stage of the rendering pipeline.
    pub fn invalidates(self, stage: Stage) -> bool {
        INVALIDATES.iter().any(|(change, stages)| *change == self && stages.contains(&stage))
    }

    /// Kinds of edits that lead from an old to a new scene: of lights, camera or picture settings.
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

    /// Kind of the edit from one transfer function to another, considering only scalar values that occur in the
    /// volume.
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

/// Lights for which a picture needs shadow maps: those that are not black, or the first light if all are black.
pub(super) fn shining_lights(scene: &Scene) -> Vec<Light> {
    scene.shining().iter().map(|source| source.light).collect()
}
