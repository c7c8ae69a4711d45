//! What a person works on: one volume with its transfer function, method and scene; what a scene file says of it.

use super::curve::{Edit, History, apply};
use crate::engine::method_choice::MethodChoice;
use crate::engine::reading::{Beginning, Opened};
use crate::error::Result;
use crate::files::output::write_whole;
use crate::open::presets::{self, Suiting};
use crate::open::{MaskFlags, SceneSettings, VolumeSpec};
use crate::scene::{Camera, Light, LightSource, Scene, Shading};
use crate::strands::VoxelisedStrands;
use crate::transfer::formats::alike;
use crate::transfer::{ClipPlane, LabelRule, Seen, TransferFunction};
use crate::volume::{Histogram, Volume};
use glam::{DQuat, DVec3};
use std::path::Path;
use std::sync::Arc;

/// An open volume and all that decides its picture.
#[derive(Debug, Clone)]
pub struct Document {
    /// Where the volume came from, and how it was read.
    pub spec: VolumeSpec,
    /// The voxels.
    pub volume: Arc<Volume>,
    /// What they were made from, where that is strands.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// How often each value occurs.
    pub histogram: Arc<Histogram>,
    /// The transfer function as it is now.
    pub tf: Arc<TransferFunction>,
    /// The preset or file that the function was, and what it was then.
    pub tf_source: (String, Arc<TransferFunction>),
    /// What was asked for of units and opacity, for presets and files that are read later.
    pub suiting: Suiting,
    /// The segmentation and the functions of its labels, as they were asked for; what is hidden and clipped is said by `tf`.
    pub parts: MaskFlags,
    /// What it was before, to be taken back.
    pub history: History,
    /// The point of the function that is selected in the editor.
    pub selected: Option<usize>,
    /// Values at the editor's left and right edge; `None`: all of the volume's.
    pub value_window: Option<[f64; 2]>,
    /// The shadow method.
    pub method: MethodChoice,
    /// The method on the right of the split.
    pub other: MethodChoice,
    /// Camera, lights and picture settings.
    pub scene: Scene,
    /// Place of the light that hands move and the panel edits; see [`Self::chosen_light`].
    pub chosen: usize,
    /// The camera that reset goes back to.
    pub home: Camera,
    /// Pictures are written without their background, which is black then.
    pub transparent: bool,
}

impl Document {
    /// Of a volume that has been opened, with what it begins with; methods are kept from the one before.
    pub fn new(opened: Opened, begin: Beginning, [method, other]: [MethodChoice; 2]) -> Self {
        let tf = Arc::new(begin.tf);
        Self {
            spec: opened.spec,
            volume: opened.volume,
            strands: opened.strands,
            histogram: opened.histogram,
            tf_source: (begin.tf_source, Arc::clone(&tf)),
            tf,
            suiting: begin.suiting,
            parts: begin.parts,
            history: History::default(),
            selected: None,
            value_window: None,
            method,
            other,
            home: begin.scene.camera,
            scene: begin.scene,
            chosen: 0,
            transparent: begin.transparent.unwrap_or(false),
        }
    }

    /// Takes other voxels of the same strands; all else stays as it is.
    pub fn take_voxels(&mut self, opened: Opened) {
        self.spec = opened.spec;
        self.volume = opened.volume;
        self.strands = opened.strands;
        self.histogram = opened.histogram;
        // A preset that is fitted to the values is another function now: the one that stays counts as edited.
        if let Ok(found) = presets::resolve_as(&self.tf_source.0, &self.volume, self.suiting) {
            self.tf_source.1 = Arc::new(kept_parts(found.tf, &self.tf));
        }
    }

    /// Its volume, to be taken onto another device.
    pub fn opened(&self) -> Opened {
        Opened {
            spec: self.spec.clone(),
            volume: Arc::clone(&self.volume),
            strands: self.strands.clone(),
            histogram: Arc::clone(&self.histogram),
            beginning: None,
            notes: Vec::new(),
        }
    }

    /// Edits the transfer function; edits of one kind in quick succession are one step of undo.
    ///
    /// # Errors
    /// An edit that no file could hold.
    pub fn edit(&mut self, edit: Edit) -> std::result::Result<(), &'static str> {
        let tf = apply(&self.tf, edit)?;
        if tf != *self.tf {
            self.history.note_edit(Arc::clone(&self.tf), edit);
            self.tf = Arc::new(tf);
        }
        Ok(())
    }

    /// Puts another transfer function in place, as one step of undo; clip planes and what is said of labels stay.
    pub fn replace_tf(&mut self, tf: TransferFunction, source: String) {
        self.history.note(Arc::clone(&self.tf));
        self.tf = Arc::new(kept_parts(tf, &self.tf));
        self.tf_source = (source, Arc::clone(&self.tf));
        self.selected = None;
    }

    /// Whether the function differs from the preset or file that it came from.
    pub fn tf_edited(&self) -> bool {
        !self.tf.is_same_function(&self.tf_source.1)
    }

    /// Takes other clip planes, as a step of undo where one begins.
    pub fn take_clip(&mut self, clip: Vec<ClipPlane>, begins: bool) {
        if clip != self.tf.clip {
            self.take_parts(TransferFunction { clip, ..(*self.tf).clone() }, begins);
        }
    }

    /// Hides these labels and no others, as a step of undo.
    pub fn hide_labels(&mut self, labels: Vec<u32>) {
        let mut rules: Vec<LabelRule> =
            self.tf.rules.iter().filter(|rule| rule.seen != Seen::Hidden).cloned().collect();
        if !labels.is_empty() {
            rules.push(LabelRule { labels, seen: Seen::Hidden });
        }
        self.take_parts(TransferFunction { rules, ..(*self.tf).clone() }, true);
    }

    fn take_parts(&mut self, tf: TransferFunction, begins: bool) {
        if begins {
            self.history.note(Arc::clone(&self.tf));
        }
        self.tf = Arc::new(tf);
    }

    /// What of the volume is shown, as flags.
    pub fn part_flags(&self) -> MaskFlags {
        let hidden = self.tf.rules.iter().filter(|rule| rule.seen == Seen::Hidden);
        let hidden: Vec<u32> = hidden.flat_map(|rule| rule.labels.iter().copied()).collect();
        MaskFlags {
            clip: Some(self.tf.clip.clone()).filter(|clip| !clip.is_empty()),
            hide: (!hidden.is_empty()).then(|| hidden.into_iter().collect()),
            ..self.parts.clone()
        }
    }

    /// Middle of the volume, and the radius of the sphere around it; world mm.
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
        let corners = self.volume.corners_mm();
        let center = corners.iter().sum::<DVec3>() / 8.0;
        (center, corners.iter().map(|c| c.distance(center)).fold(1e-6, f64::max))
    }

    /// Frames what the transfer function shows, from the side that the camera looks from.
    pub fn frame_seen(&mut self) {
        let Scene { camera, width, height, .. } = self.scene;
        let seen = crate::render::VisibleBounds::of(&self.volume, &self.tf, self.scene.mesh.as_ref());
        let aspect = f64::from(width) / f64::from(height);
        self.scene.camera = seen.framed(camera.eye - camera.target, camera.up, camera.fov_deg, aspect);
    }

    /// Place of the light that is edited, the last one where there are fewer.
    pub fn chosen_light(&self) -> usize {
        self.chosen.min(self.scene.lights.len().saturating_sub(1))
    }

    /// The light that is edited.
    pub fn light(&self) -> LightSource {
        self.scene.lights.get(self.chosen_light()).copied().unwrap_or_default()
    }

    /// The same, to be changed.
    pub fn light_mut(&mut self) -> &mut LightSource {
        let place = self.chosen_light();
        if self.scene.lights.is_empty() {
            self.scene.lights.push(LightSource::default());
        }
        &mut self.scene.lights[place]
    }

    /// Adds a light and edits it: white, at infinity, a third of a turn around the picture's upward axis from the one that
    /// was edited, so that it shows. Does nothing where there are as many as can be drawn.
    pub fn add_light(&mut self) {
        if self.scene.lights.len() >= Scene::MOST_LIGHTS {
            return;
        }
        let (center, _) = self.bounding_sphere();
        let toward = match self.light().light {
            Light::Directional { toward } => toward,
            Light::Point { position } => position - center,
        };
        let turn = DQuat::from_axis_angle(self.scene.camera.frame().up, std::f64::consts::TAU / 3.0);
        let toward = (turn * toward).normalize_or(DVec3::Z);
        self.scene.lights.push(Light::Directional { toward }.into());
        self.chosen = self.scene.lights.len() - 1;
    }

    /// Removes the light that is edited, unless it is the only one.
    pub fn remove_light(&mut self) {
        if self.scene.lights.len() > 1 {
            let place = self.chosen_light();
            self.scene.lights.remove(place);
            self.chosen = place.saturating_sub(1);
        }
    }

    /// The scene as a file that `--scene` takes; `tf` is a preset or a path, or the file that an edited function was
    /// written to.
    ///
    /// # Errors
    /// As [`SceneSettings::to_toml`].
    pub fn scene_text(&self, tf: &str) -> Result<String> {
        // What was written has its opacity scaled already.
        let as_loaded = tf == self.tf_source.0 && !self.tf_edited();
        let opacity_scale = self.suiting.opacity_scale.filter(|_| as_loaded);
        let settings = SceneSettings {
            tf: Some(tf.to_owned()),
            opacity_scale,
            units: self.suiting.units,
            shadow: Some(self.method.spec().parse()?),
            masking: self.part_flags(),
            ..SceneSettings::of_scene(&self.spec, &self.scene, self.transparent)
        };
        settings.to_toml()
    }

    /// Writes a scene file; a function that was edited goes into a `.json` beside it.
    ///
    /// # Errors
    /// One of the files cannot be written.
    pub fn write_scene(&self, path: &Path) -> Result<()> {
        let tf = if self.tf_edited() {
            let beside = path.with_extension("tf.json");
            self.tf.write(&beside)?;
            beside.display().to_string()
        } else {
            self.tf_source.0.clone()
        };
        let text = self.scene_text(&tf)?;
        write_whole(path, |file| file.write_all(text.as_bytes()))
    }
}

/// A function for the parts that another was for; the functions of labels become of its kind.
fn kept_parts(tf: TransferFunction, before: &TransferFunction) -> TransferFunction {
    let mut rules = before.rules.clone();
    for rule in &mut rules {
        if let Seen::Through(own) = &mut rule.seen {
            **own = alike(own, &tf).0;
        }
    }
    TransferFunction { rules, clip: before.clip.clone(), ..tf }
}

/// A shading's name on the command line.
pub fn name_of(shading: Shading) -> &'static str {
    match shading {
        Shading::None => "none",
        Shading::Lambert => "lambert",
        Shading::BlinnPhong => "blinn-phong",
        Shading::KajiyaKay => "kajiya-kay",
    }
}
