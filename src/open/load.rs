//! From settings to what a scene is of: a volume is read, and looked at through a transfer function.

use super::parts::LabelList;
use super::presets::{self, Found, ResolvedTransferFunction, Suiting};
use super::remark::Remark;
use super::{Read, SceneSettings, lights, read_with};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::render::VisibleBounds;
use crate::scene::Scene;
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::transfer::formats::Imported;
use crate::volume::Volume;
use std::sync::Arc;

/// A volume, the transfer function in its units and the scene: what every drawing command starts from.
#[derive(Debug)]
pub struct Loaded {
    /// What casts shadows.
    pub volume: Arc<Volume>,
    /// What the volume was made from, where that is strands.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Its transfer function.
    pub tf: TransferFunction,
    /// The preset or file that `tf` is.
    pub tf_source: String,
    /// Camera, lights and picture.
    pub scene: Scene,
    /// What a camera frames.
    pub seen: VisibleBounds,
    /// What was asked for or found out of units and opacity.
    pub suiting: Suiting,
    /// What was assumed.
    pub remarks: Vec<Remark>,
}

/// The transfer functions that settings name, found before anything large is read.
#[derive(Debug)]
pub struct Functions {
    /// Of the whole volume; `None`: the preset that suits it.
    whole: Option<(String, Found)>,
    of_labels: Vec<(LabelList, Found)>,
}

impl Functions {
    /// The same with this function for the whole volume, in the volume's own units or in fractions of its range;
    /// `source` says where it is from.
    #[must_use]
    pub fn with_whole(self, source: &str, tf: TransferFunction) -> Self {
        let carried = Imported { tf, warnings: Vec::new(), format: "umbravox" };
        Self { whole: Some((source.to_owned(), Found::File(carried))), ..self }
    }
}

impl Loaded {
    /// The scene of other settings, which look at this ([`SceneSettings::looks_as`]).
    ///
    /// # Errors
    /// A camera that looks nowhere, or shading that the volume is not made for.
    pub fn scene_of(&self, settings: &SceneSettings) -> Result<Scene> {
        settings.spec().check_shading(settings.shading)?;
        Ok(Scene { mesh: self.scene.mesh.clone(), ..settings.scene(&self.seen)? })
    }
}

impl SceneSettings {
    /// Reads what is named, cheap things first; watched and ended early through `loading`.
    ///
    /// # Errors
    /// Whatever of it cannot be read or does not go together, or it was cancelled.
    pub fn load(&self, loading: &Loading) -> Result<Loaded> {
        let functions = self.functions(false)?;
        let mut remarks = Vec::new();
        let Read { volume, strands } = self.read_volume(&mut remarks, loading)?;
        self.look_at((Arc::new(volume), strands), functions, remarks, loading)
    }

    /// Finds the transfer functions, and refuses what can be refused without the volume; `is_labelled` where its voxels have
    /// labels without a file of them.
    ///
    /// # Errors
    /// A function that cannot be found or read, and settings that do not go together.
    pub fn functions(&self, is_labelled: bool) -> Result<Functions> {
        let found = |tf: &String| Ok((tf.clone(), presets::find(tf)?));
        let whole = self.tf.as_ref().map(found).transpose()?;
        let of_labels = self.parts.find(is_labelled)?;
        lights::checked(self.light.as_deref())?;
        self.spec().check_shading(self.shading)?;
        Ok(Functions { whole, of_labels })
    }

    /// Reads the volume, and the labels of its voxels; `remarks` gets what was assumed.
    ///
    /// # Errors
    /// It cannot be read, or it was cancelled.
    pub fn read_volume(&self, remarks: &mut Vec<Remark>, loading: &Loading) -> Result<Read> {
        let Read { volume, strands } = read_with(&self.spec(), loading)?;
        remarks.extend(volume.provenance.warnings.iter().map(|w| ("warning", w.clone())));
        remarks.extend(self.another_volume()?.map(|remark| ("warning", remark)));
        let volume = self.parts.label(volume, strands.is_some(), remarks, loading)?;
        Ok(Read { volume, strands })
    }

    /// How a volume that is read, with its labels, is looked at; `remarks` are what was assumed before.
    ///
    /// # Errors
    /// What does not go together with the volume, and opaque things that cannot be read.
    pub fn look_at(
        &self,
        (volume, strands): (Arc<Volume>, Option<Arc<VoxelisedStrands>>),
        functions: Functions,
        mut remarks: Vec<Remark>,
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
        // Each by itself: a factor that suits a preset to the volume is none for a file.
        let own = Suiting { units: suiting.units, ..self.suiting() };
        tf.rules = self.parts.rules(functions.of_labels, &tf, &volume, own, &mut remarks)?;
        tf.clip = self.parts.planes(strands.is_some())?;
        remarks.extend(warnings.into_iter().map(|warning| ("warning", warning)));
        remarks.extend(chosen.into_iter().chain(notes).map(|note| ("note", note)));
        let mesh = self.opaque.read(&mut remarks, loading)?;
        let seen = VisibleBounds::of(&volume, &tf, mesh.as_ref());
        let scene = Scene { mesh, ..self.scene(&seen)? };
        Ok(Loaded { volume, strands, tf, tf_source, scene, seen, suiting, remarks })
    }

    /// Whether both are of one volume.
    pub fn reads_as(&self, other: &Self) -> bool {
        let read = |s: &Self| (s.volume.clone(), s.read_flags, s.parts.labels.clone(), s.sha256.clone());
        read(self) == read(other)
    }

    /// Whether both look at a volume in the same way: only cameras, lights and pictures differ.
    pub fn looks_as(&self, other: &Self) -> bool {
        let look = |s: &Self| {
            (s.tf.clone(), s.suiting(), s.parts.clone(), s.opaque.clone(), s.disabled_optimizations())
        };
        self.reads_as(other) && look(self) == look(other)
    }

    /// Where `sha256` is given: what to say if the volume's file has another.
    fn another_volume(&self) -> Result<Option<String>> {
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
