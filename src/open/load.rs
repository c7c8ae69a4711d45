//! Loads a scene: reads its volume, adapts its transfer function to the volume, and prepares opaque objects and
//! camera.

use super::masking::LabelList;
use super::presets::{self, Found, ResolvedTransferFunction, Suiting};
use super::{Diagnostic, Read, SceneSettings, likely_labels, user_presets};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::formats::frame_choice;
use crate::render::VisibleBounds;
use crate::scene::Scene;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::transfer::formats::Imported;
use crate::volume::Volume;
use std::sync::Arc;

/// Loaded scene: its volume, its transfer function in the volume's units, camera, lights and opaque objects.
#[derive(Debug)]
pub struct Loaded {
    /// Volume of the loaded scene.
    pub volume: Arc<Volume>,
    /// Strands that the scene's volume was voxelised from, if any.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Transfer function of the loaded scene, in the units of its volume.
    pub tf: TransferFunction,
    /// Origin of the loaded scene's transfer function: name of a preset, or path of a file.
    pub tf_source: String,
    /// Camera, lights, opaque objects and picture size of the loaded scene.
    pub scene: Scene,
    /// Bounds of the visible part of the volume and of opaque objects, which the camera frames by default.
    pub bounds: VisibleBounds,
    /// Kind of the volume's values (HU or not) and factor on the transfer function's extinction, given by the user or
    /// derived from the volume.
    pub suiting: Suiting,
    /// Notes and warnings for the user about the files and settings of the loaded scene.
    pub diagnostics: Vec<Diagnostic>,
}

/// Transfer functions that a scene's settings name: one for the whole volume, others for segmentation labels. They
/// are found before the volume is read.
#[derive(Debug)]
pub struct Functions {
    /// Transfer function of the whole volume, with its preset name or path; `None` for the default preset.
    whole: Option<(String, Found)>,
    of_labels: Vec<(LabelList, Found)>,
}

impl Functions {
    /// Replaces the transfer function of the whole volume by `tf`. The scalar values of `tf` are those of the volume,
    /// or fractions of its value range; `source` is its name.
    #[must_use]
    pub fn with_whole(self, source: &str, tf: TransferFunction) -> Self {
        let carried = Imported { tf, warnings: Vec::new(), format: "umbravox" };
        Self { whole: Some((source.to_owned(), Found::File(carried))), ..self }
    }
}

impl Loaded {
    /// Returns the scene of other settings, with this volume, transfer function and opaque objects. The settings may
    /// differ only in camera, lights, shading and picture ([`SceneSettings::looks_as`]).
    ///
    /// # Errors
    /// A camera without direction, or shading that does not fit the volume.
    pub fn scene_of(&self, settings: &SceneSettings) -> Result<Scene> {
        settings.spec().check_shading(settings.shading)?;
        Ok(Scene { mesh: self.scene.mesh.clone(), ..settings.scene(&self.bounds)? })
    }
}

impl SceneSettings {
    /// Loads a scene from its settings; its transfer functions are read before its volume. `loading` shows progress
    /// and can cancel it.
    ///
    /// # Errors
    /// A file cannot be read, settings contradict each other, or loading was cancelled.
    pub fn load(&self, loading: &Loading) -> Result<Loaded> {
        let functions = self.functions(false)?;
        let mut diagnostics = Vec::new();
        let Read { volume, strands } = self.read_volume(&mut diagnostics, loading)?;
        self.look_at((Arc::new(volume), strands), functions, diagnostics, loading)
    }

    /// Finds the scene's transfer functions, and validates all settings that need no volume. `is_labelled` says that
    /// the volume already has segmentation labels.
    ///
    /// # Errors
    /// A transfer function cannot be found or read, or settings contradict each other.
    pub fn functions(&self, is_labelled: bool) -> Result<Functions> {
        let found = |tf: &String| Ok((user_presets::located(tf), presets::find(tf)?));
        let whole = self.tf.as_ref().map(found).transpose()?;
        let of_labels = self.masking.find(is_labelled)?;
        self.check_lights()?;
        self.spec().check_shading(self.shading)?;
        Ok(Functions { whole, of_labels })
    }

    /// Reads the scene's volume and the segmentation labels of its voxels. It appends notes and warnings to
    /// `diagnostics`.
    ///
    /// # Errors
    /// A file that cannot be read, or cancellation.
    pub fn read_volume(&self, diagnostics: &mut Vec<Diagnostic>, loading: &Loading) -> Result<Read> {
        let Read { volume, strands } = self.spec().read(loading)?;
        // Who names a frame knows that there are others.
        let chosen = self.read_flags.frame.map(|frame| frame_choice(frame, volume.provenance.frames));
        let warnings = volume.provenance.warnings.iter().filter(|text| chosen.as_ref() != Some(text));
        diagnostics.extend(warnings.cloned().map(Diagnostic::warning));
        diagnostics.extend(self.checksum_warning()?.map(Diagnostic::warning));
        let volume = self.masking.label(volume, strands.is_some(), diagnostics, loading)?;
        Ok(Read { volume, strands })
    }

    /// Prepares transfer function, opaque objects and camera of a scene whose volume has been read. `diagnostics` are
    /// the notes and warnings so far.
    ///
    /// # Errors
    /// Settings that do not fit the volume, or opaque objects that cannot be read.
    pub fn look_at(
        &self,
        (volume, strands): (Arc<Volume>, Option<Arc<VoxelisedStrands>>),
        functions: Functions,
        mut diagnostics: Vec<Diagnostic>,
        loading: &Loading,
    ) -> Result<Loaded> {
        let ((tf_source, found), chosen) = match functions.whole {
            Some(named) => (named, None),
            None => {
                let (name, why) = presets::default_as(&volume, self.units);
                // Units of labels have no meaning, so that their note would only distract.
                ((name.to_owned(), presets::find(name)?), labels_note(&volume, name).or(why))
            }
        };
        let ResolvedTransferFunction { mut tf, notes, warnings, suiting } =
            found.suit(&volume, self.suiting())?;
        // Each label's transfer function has its own factor, since that of a preset does not apply to a file. The
        // units of the volume are found again, so that notes give the reason for them.
        let own = self.suiting();
        tf.rules = self.masking.rules(functions.of_labels, &tf, &volume, own, &mut diagnostics)?;
        tf.clip = self.masking.planes(strands.is_some())?;
        if let Some(opacity) = &self.gradient_opacity {
            tf = tf.with_gradient_opacity(opacity.clone());
        }
        if let Some(opacity) = &tf.gradient_opacity {
            let text = format!("gradient opacity {opacity}: no method states an error bound with it");
            diagnostics.push(Diagnostic::note(text));
        }
        diagnostics.extend(warnings.into_iter().map(Diagnostic::warning));
        diagnostics.extend(chosen.into_iter().chain(notes).map(Diagnostic::note));
        let mesh = self.opaque.read(&mut diagnostics, loading)?;
        let bounds = VisibleBounds::of(&volume, &tf, mesh.as_ref());
        let scene = Scene { mesh, ..self.scene(&bounds)? };
        volume.check_reads()?;
        Ok(Loaded { volume, strands, tf, tf_source, scene, bounds, suiting, diagnostics })
    }

    /// Whether two scenes' settings name the same volume and segmentation, with the same flags for reading them.
    pub fn reads_as(&self, other: &Self) -> bool {
        let read =
            |s: &Self| (s.volume.clone(), s.read_flags.clone(), s.masking.labels.clone(), s.sha256.clone());
        read(self) == read(other)
    }

    /// Whether two scenes' settings differ at most in camera, lights, shading and picture, so that volume, transfer
    /// function and opaque objects are the same.
    pub fn looks_as(&self, other: &Self) -> bool {
        let look = |s: &Self| {
            let tf = (s.tf.clone(), s.suiting(), s.gradient_opacity.clone());
            (tf, s.masking.clone(), s.opaque.clone(), s.disabled_optimizations())
        };
        self.reads_as(other) && look(self) == look(other)
    }

    /// Returns a warning if the SHA-256 of the volume's file differs from that in the settings.
    fn checksum_warning(&self) -> Result<Option<String>> {
        let Some(expected) = &self.sha256 else { return Ok(None) };
        let spec = self.spec();
        Ok(match spec.sha256()? {
            Some(found) if found == *expected => None,
            Some(found) => Some(format!(
                "{} is not the file that was meant: its SHA-256 is {found}, not {expected}",
                spec.source
            )),
            None => Some(format!("{} is built in: it has no SHA-256 to compare", spec.source)),
        })
    }
}

/// Returns a note if a volume without labels is probably a segmentation. `preset` is its transfer function by default.
fn labels_note(volume: &Volume, preset: &str) -> Option<String> {
    let why = volume.labels().is_none().then(|| likely_labels(volume)).flatten()?;
    Some(format!(
        "this is probably a segmentation ({why}): preset `{preset}` draws it as an image, --labels gives an image its labels"
    ))
}
