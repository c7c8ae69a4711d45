//! Settings of a scene ([`SceneSettings`]), which command line, scene files and window share.

use super::layer::{Layer, layer};
use super::masking::MaskFlags;
use super::meshes::OpaqueFlags;
use super::presets::{PRESETS, Suiting};
use super::sky::opened;
use super::units::Units;
use super::values::{self, Background, Size};
use super::{ReadFlags, VolumeSpec};
use crate::error::{Error, Result};
use crate::render::DisabledOptimizations;
use crate::render::VisibleBounds;
use crate::scene::{AmbientOcclusion, AxisView, Camera, LightSource, Scene, Shading, Skip};
use crate::shadow::{METHODS, Method, MethodSpec};
use crate::transfer::GradientOpacity;
use clap::Args;
use glam::DVec3;
use itertools::Itertools as _;
use serde::{Serialize, Serializer};
use std::path::Path;

/// Volume that is shown if the user gives none, a built-in one.
pub const DEFAULT_VOLUME: &str = "phantom:thorax";

layer! {
/// Settings of a scene; `None` means the default. Each field is a command-line flag, whose help is its doc comment,
/// and a key of scene files.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct SceneSettings {
    /// A volume (NIfTI, DICOM folder, NRRD, MetaImage, OME-Zarr, TIFF, .vti, .npy, raw), strands (.hair, .tck, .trk,
    /// .vtk, .vtp, .obj) or a built-in one, phantom:NAME[:SIZE] [default: phantom:thorax]
    #[arg(value_name = "VOLUME")]
    pub volume: Option<String>,
    /// Command-line flags for reading the volume.
    #[command(flatten)]
    #[serde(flatten)]
    pub read_flags: ReadFlags,
    /// Command-line flags that mask parts of the volume.
    #[command(flatten)]
    #[serde(flatten)]
    pub masking: MaskFlags,
    /// Expected SHA-256 of the volume's file; a warning says when it differs
    #[arg(long, value_name = "HEX", value_parser = values::sha256, help_heading = "Volume")]
    pub sha256: Option<String>,

    /// Name of the scene in tables [default: the scene file's name, or volume and transfer function]
    #[arg(long, value_name = "TEXT", help_heading = "Scene")]
    pub name: Option<String>,
    /// Transfer function: a preset or a file; the help names the presets.
    #[arg(long, value_name = "TF", help_heading = "Scene", help = tf_help())]
    pub tf: Option<String>,
    /// Factor of the transfer function's extinction [default: 1; by the volume's size for presets]
    #[arg(id = "opacity-scale", long, value_name = "F", value_parser = values::within(1e-6..=1e6), allow_hyphen_values = true, help_heading = "Scene")]
    pub opacity_scale: Option<f64>,
    /// Factors from 0 to 1 on the extinction by gradient magnitude, per mm or with ,per=voxel at the end; or none [default:
    /// as the transfer function's file]
    #[arg(id = "gradient-opacity", long, value_name = "GRADIENT:FACTOR,...", allow_hyphen_values = true, help_heading = "Scene")]
    pub gradient_opacity: Option<GradientOpacity>,
    /// Interpret values as HU (hu) or as fractions of their range (fraction), which decides how presets are scaled
    /// [default: as the file or the values suggest]
    #[arg(long, value_enum, value_name = "UNITS", help_heading = "Scene", hide_possible_values = true)]
    pub units: Option<Units>,
    /// Shadow method and its settings; the help names the methods.
    #[arg(long, value_name = "METHOD", help_heading = "Scene", help = shadow_help())]
    #[serde(serialize_with = "display", skip_serializing_if = "Option::is_none")]
    pub shadow: Option<MethodSpec>,
    /// Picture size in pixels; one number stands for both sides [default: 512x512]
    #[arg(long, value_name = "WxH", value_parser = values::size, allow_hyphen_values = true, help_heading = "Scene")]
    pub size: Option<Size>,
    /// Position of the camera, world mm [default: frames the visible part of the volume, and opaque objects]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, help_heading = "Scene")]
    pub eye: Option<DVec3>,
    /// Point that the camera looks at, world mm [default: centre of the framed part]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, help_heading = "Scene")]
    pub target: Option<DVec3>,
    /// Up direction of the picture [default: 0,0,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::direction, allow_hyphen_values = true, help_heading = "Scene")]
    pub up: Option<DVec3>,
    /// Side from which the camera looks: A, P, L, R, S or I; or front, back, top, bottom [default: front, a little from the side and above]
    #[arg(long, value_name = "SIDE", value_parser = values::view, help_heading = "Scene")]
    pub view: Option<AxisView>,
    /// Zoom factor: narrows the field of view [default: 1]
    #[arg(long, value_name = "F", value_parser = values::within(0.01..=100.0), allow_hyphen_values = true, help_heading = "Scene")]
    pub zoom: Option<f64>,
    /// Vertical field of view, degrees [default: 40]
    #[arg(long, value_name = "DEG", value_parser = values::within(0.001..=179.9), allow_hyphen_values = true, help_heading = "Scene")]
    pub fov: Option<f64>,
    /// Light, may be given several times: dir:x,y,z (or x,y,z) towards a light at infinity, or point:x,y,z in world mm.
    /// With a size, for soft shadows: sun:x,y,z,angle=DEG, disc:x,y,z,radius=MM, sky, or sky:FILE[,turn=DEG] for an
    /// equirectangular map (.hdr, .exr), optionally ,samples=N (default: 16 shadow maps). Then optionally ,color=#rrggbb
    /// (sRGB, or a name; default: white) and ,intensity=F (default: 1) [default: dir:0.5,0.5,0.7071]
    #[arg(long, value_name = "LIGHT", value_parser = values::light, allow_hyphen_values = true, help_heading = "Scene")]
    #[serde(serialize_with = "one_or_list", skip_serializing_if = "Option::is_none")]
    pub light: Option<Vec<LightSource>>,
    /// Command-line flags for opaque objects in the volume.
    #[command(flatten)]
    #[serde(flatten)]
    pub opaque: OpaqueFlags,
    /// Share of ambient light, which shadows do not affect, 0 to 1 [default: 0.1]
    #[arg(long, value_name = "A", value_parser = values::within(0.0..=1.0), allow_hyphen_values = true, help_heading = "Scene")]
    pub ambient: Option<f64>,
    /// Ambient occlusion: matter within this distance of a point occludes ambient light, mm, optionally ,samples=N for the
    /// number of rays around the point (default: 32) [default: nothing occludes it]
    #[arg(id = "ambient-occlusion", long, value_name = "MM", value_parser = values::ambient_occlusion, allow_hyphen_values = true, help_heading = "Scene")]
    pub ambient_occlusion: Option<AmbientOcclusion>,
    /// Shading by the gradient (lambert, blinn-phong), of strands by their direction (kajiya-kay), or by a phase function
    /// (phase) [default: none]
    #[arg(long, value_enum, value_name = "MODEL", help_heading = "Scene", hide_possible_values = true)]
    pub shading: Option<Shading>,
    /// Mean cosine g of the Henyey-Greenstein phase function, -0.95 to 0.95; implies --shading phase [default: 0]
    #[arg(long, value_name = "G", value_parser = values::within(-0.95..=0.95), allow_hyphen_values = true, help_heading = "Scene")]
    pub phase: Option<f64>,
    /// Background colour, sRGB #rrggbb or a name such as white; or none: black, and transparent in picture files [default:
    /// #000000]
    #[arg(long, value_name = "COLOR", value_parser = values::background, help_heading = "Scene")]
    pub background: Option<Background>,
    /// Eye-ray step in units of the smallest voxel spacing, 0.01 to 8 [default: 0.5]
    #[arg(long, value_name = "VOXELS", value_parser = values::within(0.01..=8.0), allow_hyphen_values = true, help_heading = "Scene")]
    pub step: Option<f64>,
    /// Empty-space skipping of eye rays: bricks (blocks of voxels), or none [default: bricks]
    #[arg(long, value_enum, value_name = "HOW", help_heading = "Scene", hide_possible_values = true)]
    pub skip: Option<Skip>,
    /// Disable optimizations: names separated by commas, as --explain shows them in square brackets, or all
    #[arg(id = "no-skip", long, value_name = "NAMES", help_heading = "Scene")]
    pub no_skip: Option<DisabledOptimizations>,
}
}

/// Help text of `--tf`, which names the transfer-function presets.
fn tf_help() -> String {
    let names = PRESETS.iter().map(|preset| preset.name).join(", ");
    format!(
        "Transfer function: a preset ({names}; `umbravox tf list` describes them), or a file of this program, ParaView, 3D \
         Slicer, MRIcroGL, NiiVue or Inviwo [default: ct for a volume in HU with air, bone in HU without, hair for strands, \
         engine otherwise]"
    )
}

/// Help text of `--shadow`, which names the shadow methods.
fn shadow_help() -> String {
    let names = METHODS.iter().map(|method| method.name).join(", ");
    format!(
        "Shadow method and its settings, METHOD[:key=value,...]: {names}; `umbravox methods` describes them, and `umbravox \
         methods METHOD` its settings [default: dsm]"
    )
}

fn display<S: Serializer>(spec: &Option<MethodSpec>, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    spec.as_ref().map(ToString::to_string).serialize(serializer)
}

/// Serializes the lights of a scene: a single light as a string, and several lights as a list.
fn one_or_list<S: Serializer>(
    lights: &Option<Vec<LightSource>>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    match lights.as_deref() {
        Some([one]) => one.serialize(serializer),
        lights => lights.serialize(serializer),
    }
}

impl SceneSettings {
    /// Creates the default scene settings for a volume specification.
    pub fn of_volume(spec: &VolumeSpec) -> Self {
        Self { volume: Some(spec.source.clone()), read_flags: spec.flags.clone(), ..Self::default() }
    }

    /// Returns the specification of the scene's volume: its source, and the flags for reading it.
    pub fn spec(&self) -> VolumeSpec {
        VolumeSpec {
            source: self.volume.clone().unwrap_or_else(|| DEFAULT_VOLUME.into()),
            flags: self.read_flags.clone(),
        }
    }

    /// Returns an error if the scene's volume is a file or folder that does not exist.
    ///
    /// # Errors
    /// There is no such file or folder.
    pub fn check_volume_exists(&self) -> Result<()> {
        match &self.volume {
            Some(source) if !source.starts_with("phantom:") && !Path::new(source).exists() => {
                Err(Error::input("cannot read volume", source, "there is no such file or folder"))
            }
            _ => Ok(()),
        }
    }

    /// Specification of the scene's shadow method: its name and settings.
    pub fn method_spec(&self) -> MethodSpec {
        self.shadow.clone().unwrap_or_default()
    }

    /// Creates the scene's shadow method.
    ///
    /// # Errors
    /// Settings that do not fit the method.
    pub fn method(&self) -> Result<Box<dyn Method>> {
        self.method_spec().method()
    }

    /// Units of the volume's values and factor on the transfer function's extinction that the scene's settings
    /// request.
    pub fn suiting(&self) -> Suiting {
        Suiting { units: self.units, opacity_scale: self.opacity_scale }
    }

    /// Rendering optimizations that the user disables with the flag `--no-skip`.
    pub fn disabled_optimizations(&self) -> DisabledOptimizations {
        self.no_skip.unwrap_or_default()
    }

    /// Whether picture files of the scene have a transparent background.
    pub fn is_transparent(&self) -> bool {
        self.background == Some(Background::None)
    }

    /// Returns the scene's settings with all defaults written out, so that a saved file keeps its meaning when
    /// defaults change. Settings that the user gave win over those of `scene`.
    #[must_use]
    pub fn resolved(&self, scene: &Scene, tf: &str, suiting: Suiting) -> Self {
        let mut all = Self::of_scene(&self.spec(), scene, self.is_transparent()).over(self);
        all.tf = Some(tf.to_owned());
        // With label functions, a fixed factor would scale all of them.
        let of_all = self.masking.label_tf.is_none();
        let opacity_scale = if of_all { suiting.opacity_scale } else { self.opacity_scale };
        (all.units, all.opacity_scale) = (suiting.units, opacity_scale);
        // Eye, target, up and field of view already include view and zoom.
        (all.view, all.zoom) = (None, None);
        // A comparison table lists its shadow methods itself.
        all.shadow = None;
        all
    }

    /// Creates a scene from these settings, with a camera that by default frames `bounds`, the visible part of the
    /// volume. The scene has no opaque objects; [`Self::load`] reads them.
    ///
    /// # Errors
    /// There are too many lights, the map of a sky cannot be read, or the camera has no direction: eye at the target, or up
    /// along the view.
    pub fn scene(&self, bounds: &VisibleBounds) -> Result<Scene> {
        let default = Scene::framing(bounds.volume());
        let size = self.size.unwrap_or(Size { width: default.width, height: default.height });
        self.check_lights()?;
        self.check_occlusion()?;
        let lights = self.light.clone().filter(|lights| !lights.is_empty()).unwrap_or(default.lights);
        let center_mm = bounds.volume().center_mm();
        Ok(Scene {
            camera: self.camera(bounds, size)?,
            lights: lights.into_iter().map(|source| opened(source, center_mm)).collect::<Result<_>>()?,
            ambient: self.ambient.unwrap_or(default.ambient),
            ambient_occlusion: self.ambient_occlusion,
            shading: self.shading.unwrap_or(default.shading),
            mean_cosine: self.phase.unwrap_or(default.mean_cosine),
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

    /// Returns the settings that describe a volume and a scene, the inverse of [`Self::spec`] and [`Self::scene`].
    pub fn of_scene(spec: &VolumeSpec, scene: &Scene, is_transparent: bool) -> Self {
        let Scene { camera, ambient, ambient_occlusion, shading, background, step, skip, .. } = *scene;
        let Camera { eye, target, up, fov_deg } = camera;
        let background = if is_transparent { Background::None } else { Background::Color(background) };
        Self {
            size: Some(Size { width: scene.width, height: scene.height }),
            eye: Some(eye),
            target: Some(target),
            up: Some(up),
            fov: Some(fov_deg),
            light: Some(scene.lights.clone()),
            opaque: OpaqueFlags::of(scene.mesh.as_deref()),
            ambient: Some(ambient),
            ambient_occlusion: ambient_occlusion.filter(|_| scene.mesh.is_none()),
            shading: Some(shading),
            phase: (shading == Shading::Phase).then_some(scene.mean_cosine),
            background: Some(background),
            step: Some(step),
            skip: Some(skip),
            ..Self::of_volume(spec)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open::{SceneRequest, load};
    use crate::scene::Light;
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
    fn defaults_are_those_of_the_contract() {
        let scene = scene(&[]).unwrap();
        let volume = load(&VolumeSpec::new("phantom:slab:8")).unwrap();
        assert_eq!(scene, Scene { camera: scene.camera, ..Scene::framing(&volume) });
        assert_eq!((scene.width, scene.height, scene.camera.fov_deg), (512, 512, 40.0));
        assert_eq!((scene.ambient, scene.step, scene.background), (0.1, 0.5, [0.0; 3]));
        assert_eq!((scene.shading, scene.skip), (Shading::None, Skip::Bricks));
    }

    #[test]
    fn a_scene_and_its_settings_describe_each_other() {
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
    fn one_light_is_a_text_and_several_are_a_list() {
        let read = |text: &str| SceneRequest::from_toml(text).unwrap().settings;
        let one = read("light = 'point:1,2,-3.5'");
        assert_eq!(one.to_toml().unwrap(), "light = \"point:1.0,2.0,-3.5\"\n");
        assert_eq!(read("light = ['point:1,2,-3.5']"), one);
        let two = read("light = ['point:1,2,-3.5', 'dir:0,0,1,color=#ff8000,intensity=0.30000000000000004']");
        assert_eq!(read(&two.to_toml().unwrap()), two, "to the last bit");
        let lights = two.light.clone().unwrap();
        assert_eq!(
            (lights[1].light, lights[1].intensity),
            (Light::Directional { toward: DVec3::Z }, 0.1 + 0.2)
        );
        assert_eq!(one.over(&two), one);
        assert!(one.one_light("probe").is_ok() && two.one_light("probe").is_err());
        let with =
            |count| SceneSettings { light: Some(vec![lights[0].clone(); count]), ..SceneSettings::default() };
        assert!(with(17).check_lights().unwrap_err().why.contains("17"));
        assert!(with(16).check_lights().is_ok());
    }

    #[test]
    fn a_phase_function_is_a_shading() {
        let layer = |shading, phase| {
            SceneSettings { shading, phase, ..SceneSettings::default() }.with_phase_function()
        };
        let [phase, lambert] = [Shading::Phase, Shading::Lambert].map(Some);
        assert_eq!(layer(None, Some(0.6)).unwrap().shading, phase);
        assert_eq!(layer(phase, None).unwrap().shading, phase);
        assert!(layer(lambert, Some(0.6)).unwrap_err().why.contains("lambert"));
        // A flag wins over either key of a file.
        let over = |a: (Option<Shading>, _), b: (Option<Shading>, _)| {
            layer(a.0, a.1).unwrap().over(&layer(b.0, b.1).unwrap()).shading
        };
        assert_eq!(over((None, Some(0.6)), (lambert, None)), phase);
        assert_eq!(over((lambert, None), (None, Some(0.6))), lambert);
        let read = SceneRequest::from_toml("phase = 0.6").unwrap().settings;
        assert_eq!((read.shading, read.phase), (phase, Some(0.6)));
    }

    #[test]
    fn lights_with_a_size_are_limited() {
        let light = |text: &str| Some(vec![values::light(text).unwrap(); 5]);
        let with = |text: &str| SceneSettings { light: light(text), ..SceneSettings::default() };
        assert!(with("sky,samples=51").check_lights().is_ok());
        assert!(with("sky,samples=52").check_lights().unwrap_err().why.contains("260"));
        assert!(with("dir:0,0,1").hard_lights("claims").is_ok());
        assert!(with("sun:0,0,1,angle=3").hard_lights("claims").unwrap_err().why.contains("claims"));
    }

    #[test]
    fn cameras_without_direction_are_refused() {
        assert!(scene(&["--eye=1,2,3", "--target=1,2,3"]).is_err());
        let e = scene(&["--eye=0,0,9", "--target=0,0,0"]).unwrap_err();
        assert!(e.place == "--up" && e.hint.unwrap().contains("0,1,0"));
        let e = scene(&["--eye=0,9,0", "--target=0,0,0", "--up=0,-2,0"]).unwrap_err();
        assert!(e.hint.unwrap().contains("0,0,1"));
    }
}
