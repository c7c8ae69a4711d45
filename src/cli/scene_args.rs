//! The flags that every drawing command shares, and the scene they describe.

use super::scene_file;
use super::values::{self, Background, Size};
use crate::error::{Error, Result};
use crate::render::Forced;
use crate::scene::{Camera, Light, Scene, Shading, Skip};
use crate::shadow::{self, Method};
use crate::strands::StrandFlags;
use crate::volume::{RawLayout, Volume, VolumeSpec};
use clap::Args;
use glam::DVec3;
use std::path::PathBuf;

/// Which volume, where nothing is said.
pub const DEFAULT_VOLUME: &str = "phantom:thorax";

/// The shadow method, where nothing is said.
pub const DEFAULT_SHADOW: &str = "dsm";

/// Below this sine of the angle between two directions they count as parallel in 32-bit arithmetic.
const MIN_SINE: f64 = 1e-5;

/// How to read a volume that does not say it itself.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct VolumeFlags {
    /// Read VOLUME as raw voxels: DIMXxDIMYxDIMZ:TYPE, TYPE one of u8 i8 u16 i16 u32 i32 f32 f64, then :be for
    /// big-endian [default: from a name like foot_256x256x256_uint8.raw]
    #[arg(long, value_name = "LAYOUT", value_parser = values::raw_layout, help_heading = "Volume")]
    pub raw: Option<RawLayout>,
    /// Voxel spacing of a raw file, mm [default: 1,1,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::spacing_mm, allow_hyphen_values = true, help_heading = "Volume")]
    pub spacing: Option<[f64; 3]>,
    /// Bytes before the first voxel of a raw file [default: 0]
    #[arg(long, value_name = "BYTES", allow_hyphen_values = true, help_heading = "Volume")]
    pub offset: Option<u64>,
    /// Which volume of a 4-D file, from 0 [default: 0]
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Volume")]
    pub frame: Option<usize>,
    #[command(flatten)]
    pub strands: StrandFlags,
}

impl VolumeFlags {
    /// The volume of that path or name, read as the flags say.
    pub fn spec(&self, source: &str) -> VolumeSpec {
        VolumeSpec {
            source: source.into(),
            raw: self.raw,
            spacing_mm: self.spacing,
            offset_bytes: self.offset,
            frame: self.frame,
            strands: self.strands,
        }
    }
}

/// The shared flags as written; absent ones are `None`, so that a scene file can fill them in.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct SceneArgs {
    /// A volume file (NIfTI, raw), strands (.hair) or a built-in one, phantom:NAME[:SIZE] [default: phantom:thorax]
    #[arg(value_name = "VOLUME")]
    pub volume: Option<String>,
    #[command(flatten)]
    pub volume_flags: VolumeFlags,

    /// Transfer function: a preset or a .json file [default: ct for a volume in HU with air, bone in HU without, hair for strands, engine otherwise]
    #[arg(long, value_name = "FILE|PRESET", help_heading = "Scene", long_help = super::tf_help())]
    pub tf: Option<String>,
    /// Shadow method and its settings, METHOD[:key=value,...] [default: dsm]
    #[arg(long, value_name = "METHOD", help_heading = "Scene", long_help = super::shadow_help())]
    pub shadow: Option<String>,
    /// Picture size, pixels [default: 512x512]
    #[arg(long, value_name = "WxH", value_parser = values::size, allow_hyphen_values = true, help_heading = "Scene")]
    pub size: Option<Size>,
    /// Where the camera is, world mm [default: frames the volume]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, help_heading = "Scene")]
    pub eye: Option<DVec3>,
    /// What the camera looks at, world mm [default: the centre of the volume]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, help_heading = "Scene")]
    pub target: Option<DVec3>,
    /// Which direction is up in the picture [default: 0,0,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::direction, allow_hyphen_values = true, help_heading = "Scene")]
    pub up: Option<DVec3>,
    /// Vertical field of view, degrees [default: 40]
    #[arg(long, value_name = "DEG", value_parser = values::fov_deg, allow_hyphen_values = true, help_heading = "Scene")]
    pub fov: Option<f64>,
    /// The light: dir:x,y,z towards one at infinity, or point:x,y,z in world mm [default: dir:0.5,0.5,0.7071]
    #[arg(long, value_name = "LIGHT", value_parser = values::light, allow_hyphen_values = true, help_heading = "Scene")]
    pub light: Option<Light>,
    /// Share of the light that shadows do not touch, 0 to 1 [default: 0.1]
    #[arg(long, value_name = "A", value_parser = values::ambient, allow_hyphen_values = true, help_heading = "Scene")]
    pub ambient: Option<f64>,
    /// Surface shading by the gradient [default: none]
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
    /// A TOML file with any of these flags as keys, and `volume`; flags win. `compare` takes several, each with its own
    /// --scene
    #[arg(long, value_name = "FILE.toml", help_heading = "Scene")]
    pub scene: Vec<PathBuf>,

    /// Do work that the scene does not need: names apart by commas, which --explain shows in square brackets, or all
    #[arg(long, value_name = "NAMES", value_parser = values::forced, help_heading = "Scene")]
    pub force: Option<Forced>,

    /// Say what runs, what is left out and why
    #[arg(long)]
    pub explain: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// Use the graphics adapter whose name contains NAME [default: the fastest]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

impl SceneArgs {
    /// What was asked for: the flags over the scene file over the defaults.
    ///
    /// # Errors
    /// The scene file cannot be read, there is more than one, or flags that do not go together.
    pub fn into_request(self) -> Result<SceneRequest> {
        if self.scene.len() > 1 {
            return Err(Error::input("bad command line", "--scene", "only `compare` takes more than one"));
        }
        self.into_requests()?.pop().ok_or_else(|| Error::input("bad command line", "--scene", "no scene"))
    }

    /// A request for each scene file, in their order; one where there is none.
    ///
    /// # Errors
    /// As [`Self::into_request`], but for there being several.
    pub fn into_requests(mut self) -> Result<Vec<SceneRequest>> {
        let paths = std::mem::take(&mut self.scene);
        if paths.is_empty() {
            return Ok(vec![self.request()]);
        }
        paths.into_iter().map(|path| Ok(self.clone().over(scene_file::read(&path)?).request())).collect()
    }

    /// The flags over the defaults.
    fn request(self) -> SceneRequest {
        SceneRequest {
            volume: self.volume_flags.spec(self.volume.as_deref().unwrap_or(DEFAULT_VOLUME)),
            tf: self.tf,
            shadow: self.shadow,
            size: self.size.unwrap_or(Size { width: 512, height: 512 }),
            eye: self.eye,
            target: self.target,
            up: self.up.unwrap_or(DVec3::Z),
            fov_deg: self.fov.unwrap_or(Camera::DEFAULT_FOV_DEG),
            light: self.light,
            ambient: self.ambient,
            shading: self.shading,
            background: self.background,
            step: self.step,
            skip: self.skip,
            forced: self.force.unwrap_or_default(),
            explain: self.explain,
            json: self.json,
            adapter: self.adapter,
        }
    }

    /// These flags where given, `file`'s otherwise.
    fn over(self, file: Self) -> Self {
        Self {
            volume: self.volume.or(file.volume),
            volume_flags: VolumeFlags {
                raw: self.volume_flags.raw.or(file.volume_flags.raw),
                spacing: self.volume_flags.spacing.or(file.volume_flags.spacing),
                offset: self.volume_flags.offset.or(file.volume_flags.offset),
                frame: self.volume_flags.frame.or(file.volume_flags.frame),
                strands: self.volume_flags.strands.or(file.volume_flags.strands),
            },
            tf: self.tf.or(file.tf),
            shadow: self.shadow.or(file.shadow),
            size: self.size.or(file.size),
            eye: self.eye.or(file.eye),
            target: self.target.or(file.target),
            up: self.up.or(file.up),
            fov: self.fov.or(file.fov),
            light: self.light.or(file.light),
            ambient: self.ambient.or(file.ambient),
            shading: self.shading.or(file.shading),
            background: self.background.or(file.background),
            step: self.step.or(file.step),
            skip: self.skip.or(file.skip),
            force: self.force.or(file.force),
            scene: self.scene,
            explain: self.explain || file.explain,
            json: self.json || file.json,
            adapter: self.adapter.or(file.adapter),
        }
    }
}

/// What was asked for; what depends on the volume is still open (`None` means the default).
#[derive(Debug, Clone, PartialEq)]
pub struct SceneRequest {
    pub volume: VolumeSpec,
    pub tf: Option<String>,
    pub shadow: Option<String>,
    pub size: Size,
    pub eye: Option<DVec3>,
    pub target: Option<DVec3>,
    pub up: DVec3,
    pub fov_deg: f64,
    pub light: Option<Light>,
    pub ambient: Option<f64>,
    pub shading: Option<Shading>,
    pub background: Option<Background>,
    pub step: Option<f64>,
    pub skip: Option<Skip>,
    pub forced: Forced,
    pub explain: bool,
    pub json: bool,
    pub adapter: Option<String>,
}

impl SceneRequest {
    /// The shadow method of `--shadow`.
    ///
    /// # Errors
    /// An unknown method or key, or a value out of range.
    pub fn method(&self) -> Result<Box<dyn Method>> {
        shadow::parse(self.shadow.as_deref().unwrap_or(DEFAULT_SHADOW)).map_err(|e| e.at("--shadow"))
    }

    /// Whether picture files are to be transparent where there is nothing.
    pub fn is_transparent(&self) -> bool {
        self.background == Some(Background::None)
    }

    /// The scene for a volume.
    ///
    /// # Errors
    /// A camera that looks nowhere: eye at the target, or up along the view.
    pub fn resolve(&self, volume: &Volume) -> Result<Scene> {
        let default = Scene::framing(volume);
        Ok(Scene {
            camera: self.camera(volume)?,
            light: self.light.unwrap_or(default.light),
            ambient: self.ambient.unwrap_or(default.ambient),
            shading: self.shading.unwrap_or(default.shading),
            background: match self.background {
                Some(Background::Color(rgb)) => rgb,
                Some(Background::None) => [0.0; 3],
                None => default.background,
            },
            step: self.step.unwrap_or(default.step),
            skip: self.skip.unwrap_or(default.skip),
            width: self.size.width,
            height: self.size.height,
        })
    }

    fn camera(&self, volume: &Volume) -> Result<Camera> {
        // A picture higher than wide is framed by its width.
        let aspect = (f64::from(self.size.width) / f64::from(self.size.height)).min(1.0);
        let narrow_deg = 2.0 * (aspect * (0.5 * self.fov_deg).to_radians().tan()).atan().to_degrees();
        let framing = Camera::framing(volume, self.up, narrow_deg);
        let target = self.target.unwrap_or(framing.target);
        let eye = self.eye.unwrap_or(target + (framing.eye - framing.target));
        let view = target - eye;
        // Nearer than this the direction drowns in the rounding of 32-bit positions.
        if view.length() <= 1e-6 * eye.abs().max_element().max(1.0) {
            return Err(Error::input("bad camera", "--eye, --target", "the eye is at the target"));
        }
        if view.normalize().cross(self.up).length() < MIN_SINE {
            let other = if self.up.y.abs() < 0.9 { "--up 0,1,0" } else { "--up 0,0,1" };
            return Err(Error::input("bad camera", "--up", "up is along the direction of view")
                .hint(format!("give another, e.g. {other}")));
        }
        Ok(Camera { eye, target, up: self.up, fov_deg: self.fov_deg })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        scene: SceneArgs,
    }

    fn parse(line: &[&str]) -> SceneArgs {
        Line::try_parse_from([&["test"], line].concat()).unwrap().scene
    }

    fn resolve(line: &[&str]) -> Result<Scene> {
        let request = parse(line).into_request()?;
        request.resolve(&crate::volume::load(&VolumeSpec::new("phantom:slab:8"))?)
    }

    /// Every flag, once as a key and once as a flag of another value.
    const KEYS: &str = "volume = 'a.raw'\nraw = '2x2x2:u8'\nspacing = [1, 2, 3.5]\noffset = 1\nframe = 1\n\
        resolution = 64\nkernel = 'tent'\nthickness = 0.5\ntf = 'bone'\nshadow = 'none'\nsize = '8x9'\neye = [1, 2, 3]\ntarget = '4,5,6'\nup = [0, 1, 0]\n\
        fov = 50\nlight = 'point:1,2,3'\nambient = 0.5\nshading = 'lambert'\nbackground = '#ffffff'\n\
        step = 0.25\nskip = 'none'\nforce = 'tiles,bricks'\nexplain = true\njson = true\nadapter = 'one'";
    const AS_KEYS: &[&str] = &[
        "a.raw",
        "--raw=2x2x2:u8",
        "--spacing=1,2,3.5",
        "--offset=1",
        "--frame=1",
        "--resolution=64",
        "--kernel=tent",
        "--thickness=0.5",
        "--tf=bone",
        "--shadow=none",
        "--size=8x9",
        "--eye=1,2,3",
        "--target=4,5,6",
        "--up=0,1,0",
        "--fov=50",
        "--light=point:1,2,3",
        "--ambient=0.5",
        "--shading=lambert",
        "--background=#ffffff",
        "--step=0.25",
        "--skip=none",
        "--force=tiles,bricks",
        "--explain",
        "--json",
        "--adapter=one",
    ];
    const OTHERS: &[&str] = &[
        "b.raw",
        "--raw=3x3x3:u8",
        "--spacing=1,1,1",
        "--offset=2",
        "--frame=2",
        "--resolution=65",
        "--kernel=box",
        "--thickness=2",
        "--tf=skin",
        "--shadow=rays",
        "--size=7x7",
        "--eye=7,2,3",
        "--target=7,5,6",
        "--up=1,0,0",
        "--fov=70",
        "--light=dir:1,2,3",
        "--ambient=0.7",
        "--shading=none",
        "--background=none",
        "--step=0.7",
        "--skip=bricks",
        "--force=gradients",
        "--explain",
        "--json",
        "--adapter=seven",
    ];

    #[test]
    fn every_key_is_read_like_its_flag_and_every_flag_wins() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.toml");
        std::fs::write(&path, KEYS).unwrap();
        let file = scene_file::read(&path).unwrap();
        assert_eq!(file, parse(AS_KEYS));
        assert_eq!(parse(&[]).over(file.clone()), file);
        assert_eq!(parse(OTHERS).over(file), parse(OTHERS));
    }

    #[test]
    fn the_defaults_are_the_contracts() {
        let scene = resolve(&[]).unwrap();
        let volume = crate::volume::load(&VolumeSpec::new("phantom:slab:8")).unwrap();
        assert_eq!(scene, Scene::framing(&volume));
        assert_eq!((scene.width, scene.height, scene.camera.fov_deg), (512, 512, 40.0));
        assert_eq!((scene.ambient, scene.step, scene.background), (0.1, 0.5, [0.0; 3]));
        assert_eq!((scene.shading, scene.skip), (Shading::None, Skip::Bricks));
    }

    #[test]
    fn a_target_alone_moves_the_eye_along() {
        let (framed, moved) = (resolve(&[]).unwrap().camera, resolve(&["--target=5,6,7"]).unwrap().camera);
        let offset = DVec3::new(5.0, 6.0, 7.0) - framed.target;
        assert!((moved.eye - framed.eye - offset).length() < 1e-9);
        let eye = resolve(&["--eye", "-90,0,1"]).unwrap().camera;
        assert_eq!((eye.eye, eye.target), (DVec3::new(-90.0, 0.0, 1.0), framed.target));
    }

    #[test]
    fn a_framed_volume_is_inside_the_picture_whatever_its_shape() {
        let volume = crate::volume::load(&VolumeSpec::new("phantom:slab:8")).unwrap();
        for size in ["512x512", "100x900", "900x100"] {
            let scene = resolve(&["--size", size]).unwrap();
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
        assert!(resolve(&["--eye=1,2,3", "--target=1,2,3"]).is_err());
        let e = resolve(&["--eye=0,0,9", "--target=0,0,0"]).unwrap_err();
        assert!(e.place == "--up" && e.hint.unwrap().contains("0,1,0"));
        let e = resolve(&["--eye=0,9,0", "--target=0,0,0", "--up=0,-2,0"]).unwrap_err();
        assert!(e.hint.unwrap().contains("0,0,1"));
    }
}
