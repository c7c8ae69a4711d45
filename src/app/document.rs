//! Open volume of the viewer with its transfer function, shadow method and scene. All of them can be saved in a scene
//! file.

use super::curve::{Edit, History, apply};
use crate::engine::reading::{InitialState, OpenedVolume};
use crate::error::Result;
use crate::files::output::write_whole;
use crate::open::presets::{self, Suiting};
use crate::open::{MaskFlags, SceneSettings, VolumeSpec};
use crate::scene::{Camera, Light, LightSource, Scene};
use crate::shadow::MethodSpec;
use crate::strands::VoxelisedStrands;
use crate::transfer::formats::with_quantity_of;
use crate::transfer::{ClipPlane, GradientOpacity, LabelRule, LabelVisibility, TransferFunction};
use crate::volume::{Histogram, Volume};
use glam::{DQuat, DVec3};
use std::path::Path;
use std::sync::Arc;

/// Open volume of the viewer with all settings that determine its picture.
#[derive(Debug, Clone)]
pub struct Document {
    /// Path or name of the open volume, with the flags by which it was read.
    pub spec: VolumeSpec,
    /// Voxel data of the open volume.
    pub volume: Arc<Volume>,
    /// Hair or fibre strands from which the open volume was voxelised, if any.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Histogram of the scalar values of the open volume.
    pub histogram: Arc<Histogram>,
    /// Transfer function as edited by the user, with clip planes and rules for segmentation labels.
    pub tf: Arc<TransferFunction>,
    /// Preset name or file path of the loaded transfer function, and this transfer function as loaded, before edits.
    pub tf_source: (String, Arc<TransferFunction>),
    /// Units of the scalar values and scale of the opacity, as the user requested them. They also apply to presets
    /// and transfer-function files loaded later.
    pub suiting: Suiting,
    /// Segmentation (label volume) of the open volume, and the transfer functions of its labels. Hidden labels and
    /// clip planes are stored in `tf`.
    pub parts: MaskFlags,
    /// Undo history of the transfer function of the open volume.
    pub history: History,
    /// Index of the control point selected in the transfer-function editor; `None` if none is selected.
    pub selected: Option<usize>,
    /// Scalar values at the left and right edge of the transfer-function editor. `None` selects the value range of
    /// the volume.
    pub value_window: Option<[f64; 2]>,
    /// Shadow method of the picture, or of its left part in a split view.
    pub method: MethodSpec,
    /// Shadow method of the right part of the picture in a split view, which compares two methods.
    pub other: MethodSpec,
    /// Scene of the picture: camera, lights, shading, background and picture size.
    pub scene: Scene,
    /// Index of the light that the light panel edits; see [`Self::chosen_light`].
    pub chosen: usize,
    /// Initial camera of the open volume, which the command to reset the camera restores.
    pub home: Camera,
    /// Whether exported picture files have a transparent background.
    pub transparent: bool,
}

impl Document {
    /// Combines an opened volume with its initial settings and the two shadow methods of a split view.
    pub fn new(opened: OpenedVolume, begin: InitialState, [method, other]: [MethodSpec; 2]) -> Self {
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

    /// Replaces the open volume after its strands were voxelised again; transfer function, scene and all other
    /// settings stay.
    pub fn take_voxels(&mut self, opened: OpenedVolume) {
        self.spec = opened.spec;
        self.volume = opened.volume;
        self.strands = opened.strands;
        self.histogram = opened.histogram;
        // A preset that is fitted to the voxel values may change. The current function then counts as edited.
        if let Ok(found) = presets::resolve_as(&self.tf_source.0, &self.volume, self.suiting) {
            self.tf_source.1 = Arc::new(with_masks_of(found.tf, &self.tf));
        }
    }

    /// Returns the open volume in the form that the render thread uploads to another graphics device.
    pub fn opened(&self) -> OpenedVolume {
        OpenedVolume {
            spec: self.spec.clone(),
            volume: Arc::clone(&self.volume),
            strands: self.strands.clone(),
            histogram: Arc::clone(&self.histogram),
            initial: None,
            notes: Vec::new(),
        }
    }

    /// Applies an edit to the transfer function of the open volume. Successive edits of one kind form one undo step.
    ///
    /// # Errors
    /// An edited transfer function that no file can store.
    pub fn edit(&mut self, edit: Edit) -> std::result::Result<(), &'static str> {
        let tf = Arc::new(apply(&self.tf, edit)?);
        if tf != self.tf {
            self.history.note_edit([&self.tf, &tf], edit);
            self.tf = tf;
        }
        Ok(())
    }

    /// Replaces the transfer function of the open volume as one undo step. Clip planes and visibility rules of
    /// segmentation labels stay.
    pub fn replace_tf(&mut self, tf: TransferFunction, source: String) {
        self.set_tf(with_masks_of(tf, &self.tf), true);
        self.tf_source = (source, Arc::clone(&self.tf));
        self.selected = None;
    }

    /// Whether the transfer function differs from the preset or file that it was loaded from.
    pub fn tf_edited(&self) -> bool {
        !self.tf.is_same_function(&self.tf_source.1)
    }

    /// Sets the clip planes of the open volume. If `begins` is set, records an undo step.
    pub fn set_clip(&mut self, clip: Vec<ClipPlane>, begins: bool) {
        if clip != self.tf.clip {
            self.set_tf(TransferFunction { clip, ..(*self.tf).clone() }, begins);
        }
    }

    /// Sets the gradient opacity of the transfer function, and returns whether it changed. If `begins` is set, records
    /// an undo step.
    pub fn set_gradient_opacity(&mut self, opacity: Option<GradientOpacity>, begins: bool) -> bool {
        let gradient_opacity = opacity.filter(|opacity| !opacity.is_one());
        let changes = gradient_opacity != self.tf.gradient_opacity;
        if changes {
            self.set_tf(TransferFunction { gradient_opacity, ..(*self.tf).clone() }, begins);
        }
        changes
    }

    /// Hides these segmentation labels of the open volume and shows all others, as one undo step.
    pub fn hide_labels(&mut self, labels: Vec<u32>) {
        let mut rules: Vec<LabelRule> =
            self.tf.rules.iter().filter(|rule| rule.visibility != LabelVisibility::Hidden).cloned().collect();
        if !labels.is_empty() {
            rules.push(LabelRule { labels, visibility: LabelVisibility::Hidden });
        }
        self.set_tf(TransferFunction { rules, ..(*self.tf).clone() }, true);
    }

    /// Replaces the transfer function together with its clip planes and segmentation label rules. If `begins` is set,
    /// records an undo step.
    fn set_tf(&mut self, tf: TransferFunction, begins: bool) {
        let tf = Arc::new(tf);
        if begins {
            self.history.note([&self.tf, &tf]);
        }
        self.tf = tf;
    }

    /// Returns the command-line flags that limit the visible part of the open volume: segmentation, hidden labels and
    /// clip planes.
    pub fn part_flags(&self) -> MaskFlags {
        let hidden = self.tf.rules.iter().filter(|rule| rule.visibility == LabelVisibility::Hidden);
        let hidden: Vec<u32> = hidden.flat_map(|rule| rule.labels.iter().copied()).collect();
        MaskFlags {
            clip: Some(self.tf.clip.clone()).filter(|clip| !clip.is_empty()),
            hide: (!hidden.is_empty()).then(|| hidden.into_iter().collect()),
            ..self.parts.clone()
        }
    }

    /// Centre and radius of the bounding sphere of the open volume, world mm.
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
        let (center, radius) = self.volume.bounding_sphere_mm();
        (center, radius.max(1e-6))
    }

    /// Fits the camera to the visible part of the open volume, from the current view direction.
    pub fn frame_visible(&mut self) {
        let Scene { camera, width, height, .. } = self.scene;
        let bounds = crate::render::VisibleBounds::of(&self.volume, &self.tf, self.scene.mesh.as_ref());
        let aspect = f64::from(width) / f64::from(height);
        self.scene.camera = bounds.framed(camera.eye - camera.target, camera.up, camera.fov_deg, aspect);
    }

    /// Index of the light that the light panel edits; at most the index of the scene's last light.
    pub fn chosen_light(&self) -> usize {
        self.chosen.min(self.scene.lights.len().saturating_sub(1))
    }

    /// Returns the light source that the light panel edits.
    pub fn light(&self) -> LightSource {
        self.scene.lights.get(self.chosen_light()).cloned().unwrap_or_default()
    }

    /// Returns a mutable reference to the light source that the light panel edits.
    pub fn light_mut(&mut self) -> &mut LightSource {
        let place = self.chosen_light();
        if self.scene.lights.is_empty() {
            self.scene.lights.push(LightSource::default());
        }
        &mut self.scene.lights[place]
    }

    /// Adds a white directional light to the scene and selects it. Its direction is that of the edited light, rotated
    /// by 120 degrees about the picture's up axis. Does nothing at the maximum number of lights.
    pub fn add_light(&mut self) {
        let maps = self.scene.lights.iter().map(LightSource::sample_count).sum::<usize>();
        if self.scene.lights.len() >= Scene::MOST_LIGHTS || maps >= Scene::MOST_SHADOW_MAPS {
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

    /// Removes the light that the light panel edits from the scene, unless it is the only one.
    pub fn remove_light(&mut self) {
        if self.scene.lights.len() > 1 {
            let place = self.chosen_light();
            self.scene.lights.remove(place);
            self.chosen = place.saturating_sub(1);
        }
    }

    /// Returns the name of the open volume and all its settings as the text of a scene file for `--scene`. `tf` is
    /// the preset name or path of the transfer function.
    ///
    /// # Errors
    /// See [`SceneSettings::to_toml`].
    pub fn scene_text(&self, tf: &str) -> Result<String> {
        // A transfer function written to a file already includes the opacity scale.
        let as_loaded = tf == self.tf_source.0 && !self.tf_edited();
        let opacity_scale = self.suiting.opacity_scale.filter(|_| as_loaded);
        let settings = SceneSettings {
            tf: Some(tf.to_owned()),
            opacity_scale,
            // A file may have one that the scene has not.
            gradient_opacity: Some(self.tf.gradient_opacity.clone().unwrap_or_else(GradientOpacity::none))
                .filter(|opacity| !opacity.is_one() || presets::PRESETS.iter().all(|p| p.name != tf)),
            units: self.suiting.units,
            shadow: Some(self.method.clone()),
            masking: self.part_flags(),
            ..SceneSettings::of_scene(&self.spec, &self.scene, self.transparent)
        };
        settings.to_toml()
    }

    /// Writes a scene file with the name of the open volume and all its settings. An edited transfer function is
    /// written to a `.json` file beside it.
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

/// Copies clip planes and visibility rules of segmentation labels from the transfer function `before` to `tf`.
fn with_masks_of(tf: TransferFunction, before: &TransferFunction) -> TransferFunction {
    let mut rules = before.rules.clone();
    for rule in &mut rules {
        if let LabelVisibility::Visible(own) = &mut rule.visibility {
            **own = with_quantity_of(own, &tf).0;
        }
    }
    TransferFunction { rules, clip: before.clip.clone(), ..tf }
}
