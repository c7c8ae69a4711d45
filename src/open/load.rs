//! Loading of a scene: reads a volume, and prepares its transfer function and camera.

use super::masking::LabelList;
use super::presets::{self, Found, ResolvedTransferFunction, Suiting};
use super::{Diagnostic, Read, SceneSettings};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::render::VisibleBounds;
use crate::scene::Scene;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::transfer::formats::Imported;
use crate::volume::Volume;
use std::sync::Arc;

/// A volume, the transfer function in its units, and the scene.
#[derive(Debug)]
pub struct Loaded {
    /// Volume.
    pub volume: Arc<Volume>,
    /// Strands that the volume was made from.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Transfer function.
    pub tf: TransferFunction,
    /// Preset or file of the transfer function.
    pub tf_source: String,
    /// Camera, lights and picture.
    pub scene: Scene,
    /// Bounds that a camera frames.
    pub bounds: VisibleBounds,
    /// Units and opacity scale, given or derived from the volume.
    pub suiting: Suiting,
    /// Notes and warnings.
    pub diagnostics: Vec<Diagnostic>,
}

/// Transfer functions that settings name, found before the volume is read.
#[derive(Debug)]
pub struct Functions {
    /// Function of the whole volume; `None`: the default preset.
    whole: Option<(String, Found)>,
    of_labels: Vec<(LabelList, Found)>,
}

impl Functions {
    /// Replaces the function of the whole volume, in the volume's units or in fractions of its range; `source` names it.
    #[must_use]
    pub fn with_whole(self, source: &str, tf: TransferFunction) -> Self {
        let carried = Imported { tf, warnings: Vec::new(), format: "umbravox" };
        Self { whole: Some((source.to_owned(), Found::File(carried))), ..self }
    }
}

impl Loaded {
    /// Scene of other settings with the same appearance ([`SceneSettings::looks_as`]).
    ///
    /// # Errors
    /// A camera without direction, or shading that does not fit the volume.
    pub fn scene_of(&self, settings: &SceneSettings) -> Result<Scene> {
        settings.spec().check_shading(settings.shading)?;
        Ok(Scene { mesh: self.scene.mesh.clone(), ..settings.scene(&self.bounds)? })
    }
}

impl SceneSettings {
    /// Loads the scene, cheap files first; `loading` reports progress and cancels.
    ///
    /// # Errors
    /// A file that cannot be read, settings that contradict each other, or cancellation.
    pub fn load(&self, loading: &Loading) -> Result<Loaded> {
        let functions = self.functions(false)?;
        let mut diagnostics = Vec::new();
        let Read { volume, strands } = self.read_volume(&mut diagnostics, loading)?;
        self.look_at((Arc::new(volume), strands), functions, diagnostics, loading)
    }

    /// Finds the transfer functions, and checks everything that needs no volume; `is_labelled`: the volume has labels already.
    ///
    /// # Errors
    /// A function that cannot be found or read, or settings that contradict each other.
    pub fn functions(&self, is_labelled: bool) -> Result<Functions> {
        let found = |tf: &String| Ok((tf.clone(), presets::find(tf)?));
        let whole = self.tf.as_ref().map(found).transpose()?;
        let of_labels = self.masking.find(is_labelled)?;
        self.check_lights()?;
        self.spec().check_shading(self.shading)?;
        Ok(Functions { whole, of_labels })
    }

    /// Reads the volume and the labels of its voxels; notes and warnings join `diagnostics`.
    ///
    /// # Errors
    /// A file that cannot be read, or cancellation.
    pub fn read_volume(&self, diagnostics: &mut Vec<Diagnostic>, loading: &Loading) -> Result<Read> {
        let Read { volume, strands } = self.spec().read(loading)?;
        diagnostics.extend(volume.provenance.warnings.iter().cloned().map(Diagnostic::warning));
        diagnostics.extend(self.checksum_warning()?.map(Diagnostic::warning));
        let volume = self.masking.label(volume, strands.is_some(), diagnostics, loading)?;
        Ok(Read { volume, strands })
    }

    /// Prepares transfer function, opaque objects and camera of a volume that is read; `diagnostics` are those so far.
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
                ((name.to_owned(), presets::find(name)?), why)
            }
        };
        let ResolvedTransferFunction { mut tf, notes, warnings, suiting } =
            found.suit(&volume, self.suiting())?;
        // Labels have factors of their own: that of a preset does not apply to a file.
        let own = Suiting { units: suiting.units, ..self.suiting() };
        tf.rules = self.masking.rules(functions.of_labels, &tf, &volume, own, &mut diagnostics)?;
        tf.clip = self.masking.planes(strands.is_some())?;
        diagnostics.extend(warnings.into_iter().map(Diagnostic::warning));
        diagnostics.extend(chosen.into_iter().chain(notes).map(Diagnostic::note));
        let mesh = self.opaque.read(&mut diagnostics, loading)?;
        let bounds = VisibleBounds::of(&volume, &tf, mesh.as_ref());
        let scene = Scene { mesh, ..self.scene(&bounds)? };
        Ok(Loaded { volume, strands, tf, tf_source, scene, bounds, suiting, diagnostics })
    }

    /// Whether both read the same volume in the same way.
    pub fn reads_as(&self, other: &Self) -> bool {
        let read = |s: &Self| (s.volume.clone(), s.read_flags, s.masking.labels.clone(), s.sha256.clone());
        read(self) == read(other)
    }

    /// Whether only cameras, lights and pictures differ.
    pub fn looks_as(&self, other: &Self) -> bool {
        let look = |s: &Self| {
            (s.tf.clone(), s.suiting(), s.masking.clone(), s.opaque.clone(), s.disabled_optimizations())
        };
        self.reads_as(other) && look(self) == look(other)
    }

    /// Warning where the volume's file has another SHA-256 than `sha256`.
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
