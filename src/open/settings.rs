//! One description of a scene: command line, scene file and the window's document are views of [`SceneSettings`].

use super::help::{shadow_help, tf_help};
use super::lights::{self, one_or_list};
use super::meshes::OpaqueFlags;
use super::parts::PartFlags;
use super::presets::Suiting;
use super::units::Units;
use super::values::{self, Background, Size};
use super::view;
use super::{ReadFlags, VolumeSpec};
use crate::error::{Error, Result};
use crate::render::DisabledOptimizations;
use crate::render::VisibleBounds;
use crate::scene::{AxisView, Camera, LightSource, Scene, Shading, Skip};
use crate::shadow::{self, Method};
use clap::Args;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::ops::Not;
use std::path::PathBuf;

/// Which volume, where nothing is said.
pub const DEFAULT_VOLUME: &str = "phantom:thorax";

/// The shadow method, where nothing is said.
pub const DEFAULT_SHADOW: &str = "dsm";

/// A scene as a user describes it; `None` is the default. One field is all of a setting: its doc comment is the help of
/// its flag, its name the key of a scene file, its parser reads both.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize, Deserialize)]
#[serde(try_from = "toml::Table")]
pub struct SceneSettings {
    /// A volume (NIfTI, DICOM folder, NRRD, MetaImage, OME-Zarr, TIFF, .vti, .npy, raw), strands (.hair, .tck, .trk, .vtk,
    /// .vtp, .obj) or a built-in one, phantom:NAME[:SIZE] [default: phantom:thorax]
    #[arg(value_name = "VOLUME")]
    pub volume: Option<String>,
    #[expect(missing_docs, reason = "flags of their own, whose comments are the help")]
    #[command(flatten)]
    #[serde(flatten)]
    pub read_flags: ReadFlags,
    #[expect(missing_docs, reason = "flags of their own, whose comments are the help")]
    #[command(flatten)]
    #[serde(flatten)]
    pub parts: PartFlags,
    /// SHA-256 that the volume's file should have; a warning says where it has another
    #[arg(long, value_name = "HEX", value_parser = values::sha256, help_heading = "Volume")]
    pub sha256: Option<String>,

    /// What tables call the scene [default: the scene file's name, or volume and transfer function]
    #[arg(long, value_name = "TEXT", help_heading = "Scene")]
    pub name: Option<String>,
    /// Transfer function: a preset or a file [default: ct for a volume in HU with air, bone in HU without, hair for strands, engine otherwise]
    #[arg(long, value_name = "FILE|PRESET", help_heading = "Scene", long_help = tf_help())]
    pub tf: Option<String>,
    /// Factor of the transfer function's extinction at every value [default: 1; by the volume's size for presets]
    #[arg(id = "opacity-scale", long, value_name = "F", value_parser = values::opacity_scale, allow_hyphen_values = true, help_heading = "Scene")]
    #[serde(rename = "opacity-scale")]
    pub opacity_scale: Option<f64>,
    /// What the volume's values are taken for, which decides how presets lie over them [default: what the file or the values tell]
    #[arg(long, value_enum, value_name = "UNITS", help_heading = "Scene")]
    pub units: Option<Units>,
    /// Shadow method and its settings, METHOD[:key=value,...] [default: dsm]
    #[arg(long, value_name = "METHOD", help_heading = "Scene", long_help = shadow_help())]
    pub shadow: Option<String>,
    /// Picture size, pixels [default: 512x512]
    #[arg(long, value_name = "WxH", value_parser = values::size, allow_hyphen_values = true, help_heading = "Scene")]
    pub size: Option<Size>,
    /// Where the camera is, world mm [default: frames what has extinction, and opaque things]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, help_heading = "Scene")]
    pub eye: Option<DVec3>,
    /// What the camera looks at, world mm [default: the middle of what is framed]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, help_heading = "Scene")]
    pub target: Option<DVec3>,
    /// Which direction is up in the picture [default: 0,0,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::direction, allow_hyphen_values = true, help_heading = "Scene")]
    pub up: Option<DVec3>,
    /// The side to look from, by its letter: A, P, L, R, S or I [default: front, a little from the side and above]
    #[arg(long, value_name = "SIDE", value_parser = values::view, help_heading = "Scene")]
    pub view: Option<AxisView>,
    /// How much larger everything is in the picture: the field of view narrows [default: 1]
    #[arg(long, value_name = "F", value_parser = values::zoom, allow_hyphen_values = true, help_heading = "Scene")]
    pub zoom: Option<f64>,
    /// Vertical field of view, degrees [default: 40]
    #[arg(long, value_name = "DEG", value_parser = values::fov_deg, allow_hyphen_values = true, help_heading = "Scene")]
    pub fov: Option<f64>,
    /// A light, once or for each of several: dir:x,y,z towards one at infinity, or point:x,y,z in world mm, and behind it
    /// ,color=#rrggbb (sRGB, white) and ,intensity=F (1) [default: dir:0.5,0.5,0.7071]
    #[arg(long, value_name = "LIGHT", value_parser = values::light, allow_hyphen_values = true, help_heading = "Scene")]
    #[serde(serialize_with = "one_or_list", skip_serializing_if = "Option::is_none")]
    pub light: Option<Vec<LightSource>>,
    #[expect(missing_docs, reason = "flags of their own, whose comments are the help")]
    #[command(flatten)]
    #[serde(flatten)]
    pub opaque: OpaqueFlags,
    /// Share of the light that shadows do not touch, 0 to 1 [default: 0.1]
    #[arg(long, value_name = "A", value_parser = values::ambient, allow_hyphen_values = true, help_heading = "Scene")]
    pub ambient: Option<f64>,
    /// Shading of surfaces by the gradient, or of strands by their direction (kajiya-kay) [default: none]
    #[arg(long, value_enum, value_name = "MODEL", help_heading = "Scene")]
    pub shading: Option<Shading>,
    /// Background colour, sRGB, or none: black behind it, and picture files are transparent there [default: #000000]
    #[arg(long, value_name = "#RRGGBB|none", value_parser = values::background, help_heading = "Scene")]
    pub background: Option<Background>,
    /// Eye-ray step in units of the smallest voxel spacing, 0.01 to 8 [default: 0.5]
    #[arg(long, value_name = "VOXELS", value_parser = values::step, allow_hyphen_values = true, help_heading = "Scene")]
    pub step: Option<f64>,
    /// How empty space is passed over [default: bricks]
    #[arg(long, value_enum, value_name = "HOW", help_heading = "Scene")]
    pub skip: Option<Skip>,
    /// Disable optimizations: names separated by commas, as --explain shows them in square brackets, or all
    #[arg(id = "no-skip", long, value_name = "NAMES", value_parser = values::disabled_optimizations, help_heading = "Scene")]
    #[serde(rename = "no-skip")]
    pub no_skip: Option<DisabledOptimizations>,

    /// Say what runs, what is left out and why
    #[arg(long)]
    #[serde(skip_serializing_if = "Not::not")]
    pub explain: bool,
    /// Print the result as JSON
    #[arg(long)]
    #[serde(skip_serializing_if = "Not::not")]
    pub json: bool,
    /// Use the graphics adapter whose name contains NAME [default: the fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

/// The shared flags: a scene, and scene files below it.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct SceneArgs {
    #[expect(missing_docs, reason = "flags of their own, whose comments are the help")]
    #[command(flatten)]
    pub settings: SceneSettings,
    /// A TOML file with any of these flags as keys, and `volume`; flags win. `compare` takes several, each with its own
    /// --scene
    #[arg(long, value_name = "FILE.toml", help_heading = "Scene")]
    pub scene: Vec<PathBuf>,
}

impl SceneArgs {
    /// What was asked for: the flags over the scene file.
    ///
    /// # Errors
    /// The scene file cannot be read, or there is more than one.
    pub fn into_settings(self) -> Result<SceneSettings> {
        if self.scene.len() > 1 {
            return Err(Error::input("bad command line", "--scene", "only `compare` takes more than one"));
        }
        Ok(self.into_each()?.swap_remove(0))
    }

    /// Settings for each scene file, in their order; the flags alone where there is none.
    ///
    /// # Errors
    /// A scene file cannot be read.
    pub fn into_each(self) -> Result<Vec<SceneSettings>> {
        let Self { settings, scene } = self;
        if scene.is_empty() {
            return Ok(vec![settings]);
        }
        scene.iter().map(|path| settings.over(&SceneSettings::read(path)?)).collect()
    }
}

impl SceneSettings {
    /// A volume, and the defaults for all else.
    pub fn of_volume(spec: &VolumeSpec) -> Self {
        Self { volume: Some(spec.source.clone()), read_flags: spec.flags, ..Self::default() }
    }

    /// The volume, and how to read it.
    pub fn spec(&self) -> VolumeSpec {
        VolumeSpec {
            source: self.volume.clone().unwrap_or_else(|| DEFAULT_VOLUME.into()),
            flags: self.read_flags,
        }
    }

    /// The shadow method of `--shadow`.
    ///
    /// # Errors
    /// An unknown method or key, or a value out of range.
    pub fn method(&self) -> Result<Box<dyn Method>> {
        shadow::parse(self.shadow.as_deref().unwrap_or(DEFAULT_SHADOW)).map_err(|e| e.at("--shadow"))
    }

    /// What is asked for of units and opacity.
    pub fn suiting(&self) -> Suiting {
        Suiting { units: self.units, opacity_scale: self.opacity_scale }
    }

    /// Optimizations that the user disables.
    pub fn disabled_optimizations(&self) -> DisabledOptimizations {
        self.no_skip.unwrap_or_default()
    }

    /// Whether picture files are to be transparent where there is nothing.
    pub fn is_transparent(&self) -> bool {
        self.background == Some(Background::None)
    }

    /// The settings with nothing left to a default, for a file that stays true when defaults change: what was given, and
    /// what `scene` says of the rest.
    ///
    /// # Errors
    /// As [`Self::to_toml`].
    pub fn resolved(&self, scene: &Scene, tf: &str, suiting: Suiting) -> Result<Self> {
        let mut all = Self::of_scene(&self.spec(), scene, self.is_transparent()).over(self)?;
        all.tf = Some(tf.to_owned());
        // With functions of labels it would be a factor of all of them.
        let of_all = self.parts.label_tf.is_none();
        let opacity_scale = if of_all { suiting.opacity_scale } else { self.opacity_scale };
        (all.units, all.opacity_scale) = (suiting.units, opacity_scale);
        // These are in eye, target, up and field of view now.
        (all.view, all.zoom) = (None, None);
        // Neither is of the scene: a table has methods of its own, and another machine another adapter.
        [all.shadow, all.adapter] = [None, None];
        [all.explain, all.json] = [false, false];
        Ok(all)
    }

    /// The scene for what there is to see, without its opaque things, which [`Self::load`] reads.
    ///
    /// # Errors
    /// A camera that looks nowhere: eye at the target, or up along the view.
    pub fn scene(&self, seen: &VisibleBounds) -> Result<Scene> {
        let default = Scene::framing(seen.volume());
        let size = self.size.unwrap_or(Size { width: default.width, height: default.height });
        let Self { eye, target, up, view, zoom, fov, .. } = *self;
        let asked = view::Asked { eye, target, up, view, zoom, fov };
        Ok(Scene {
            camera: view::camera(&asked, seen, size)?,
            lights: lights::checked(self.light.as_deref())?.unwrap_or(default.lights),
            ambient: self.ambient.unwrap_or(default.ambient),
            shading: self.shading.unwrap_or(default.shading),
            mesh: None,
            background: match self.background {
                Some(Background::Color(rgb)) => rgb,
                Some(Background::None) => [0.0; 3],
                None => default.background,
            },
            step: self.step.unwrap_or(default.step),
            skip: self.skip.unwrap_or(default.skip),
            width: size.width,
            height: size.height,
        })
    }

    /// What describes a volume and a scene, the other way than [`Self::spec`] and [`Self::scene`].
    pub fn of_scene(spec: &VolumeSpec, scene: &Scene, is_transparent: bool) -> Self {
        let Scene { camera, ambient, shading, background, step, skip, width, height, .. } = *scene;
        let Camera { eye, target, up, fov_deg } = camera;
        let background = if is_transparent { Background::None } else { Background::Color(background) };
        Self {
            size: Some(Size { width, height }),
            eye: Some(eye),
            target: Some(target),
            up: Some(up),
            fov: Some(fov_deg),
            light: Some(scene.lights.clone()),
            opaque: OpaqueFlags::of(scene.mesh.as_deref()),
            ambient: Some(ambient),
            shading: Some(shading),
            background: Some(background),
            step: Some(step),
            skip: Some(skip),
            ..Self::of_volume(spec)
        }
    }

    /// Refuses several lights, for what is a question about one.
    ///
    /// # Errors
    /// There is more than one.
    pub fn one_light(&self, command: &str) -> Result<()> {
        lights::only_one(self.light.as_deref(), command)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open::load;
    use clap::Parser;
    use std::sync::Arc;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: SceneSettings,
    }

    fn scene(line: &[&str]) -> Result<Scene> {
        let settings = Line::try_parse_from([&["test"], line].concat()).unwrap().settings;
        settings.scene(&VisibleBounds::whole(&Arc::new(load(&VolumeSpec::new("phantom:slab:8"))?)))
    }

    #[test]
    fn the_defaults_are_the_contracts() {
        let scene = scene(&[]).unwrap();
        let volume = load(&VolumeSpec::new("phantom:slab:8")).unwrap();
        assert_eq!(scene, Scene { camera: scene.camera, ..Scene::framing(&volume) });
        assert_eq!((scene.width, scene.height, scene.camera.fov_deg), (512, 512, 40.0));
        assert_eq!((scene.ambient, scene.step, scene.background), (0.1, 0.5, [0.0; 3]));
        assert_eq!((scene.shading, scene.skip), (Shading::None, Skip::Bricks));
    }

    #[test]
    fn a_scene_and_its_settings_are_two_views_of_one_thing() {
        let volume = Arc::new(load(&VolumeSpec::new("phantom:slab:8")).unwrap());
        for (transparent, background) in [(false, "#336699"), (true, "none")] {
            let line = [
                "--size=9x8",
                "--eye=9,8,7",
                "--target=1,2,3",
                "--up=0,1,0.5",
                "--fov=33.3",
                "--ambient=0.7",
            ];
            let more =
                ["--light=point:1,2,3", "--shading=lambert", "--step=0.7", "--skip=none", "--background"];
            let scene = scene(&[&line[..], &more, &[background]].concat()).unwrap();
            let spec = VolumeSpec::new("phantom:slab:8");
            let settings = SceneSettings::of_scene(&spec, &scene, transparent);
            assert_eq!(settings.spec(), spec);
            assert_eq!(settings.scene(&VisibleBounds::whole(&volume)).unwrap(), scene);
            assert_eq!(settings.is_transparent(), transparent);
        }
    }

    #[test]
    fn a_target_alone_moves_the_eye_along() {
        let (framed, moved) = (scene(&[]).unwrap().camera, scene(&["--target=5,6,7"]).unwrap().camera);
        let offset = DVec3::new(5.0, 6.0, 7.0) - framed.target;
        assert!((moved.eye - framed.eye - offset).length() < 1e-9);
        let eye = scene(&["--eye", "-90,0,1"]).unwrap().camera;
        assert_eq!((eye.eye, eye.target), (DVec3::new(-90.0, 0.0, 1.0), DVec3::ZERO));
    }

    #[test]
    fn a_framed_volume_is_inside_the_picture_whatever_its_shape() {
        let volume = load(&VolumeSpec::new("phantom:slab:8")).unwrap();
        for size in ["512x512", "100x900", "900x100"] {
            let scene = scene(&["--size", size]).unwrap();
            let frame = scene.camera.frame();
            let tan = (0.5 * scene.camera.fov_deg).to_radians().tan();
            let aspect = f64::from(scene.width) / f64::from(scene.height);
            for corner in volume.corners_mm() {
                let d = corner - scene.camera.eye;
                let (x, y, z) = (d.dot(frame.right), d.dot(frame.up), d.dot(frame.forward));
                assert!(z > 0.0 && x.abs() <= z * tan * aspect && y.abs() <= z * tan, "{size}: {corner}");
            }
        }
    }

    #[test]
    fn cameras_that_look_nowhere_are_refused() {
        assert!(scene(&["--eye=1,2,3", "--target=1,2,3"]).is_err());
        let e = scene(&["--eye=0,0,9", "--target=0,0,0"]).unwrap_err();
        assert!(e.place == "--up" && e.hint.unwrap().contains("0,1,0"));
        let e = scene(&["--eye=0,9,0", "--target=0,0,0", "--up=0,-2,0"]).unwrap_err();
        assert!(e.hint.unwrap().contains("0,0,1"));
    }
}
