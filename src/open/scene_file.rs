//! Scene files: settings of a scene ([`SceneRequest`]) as TOML. The value of a key has the syntax of the command-line
//! flag with the same name.

use super::layer::Layer;
use super::presets::PRESETS;
use super::{SceneRequest, SceneSettings};
use crate::error::{Error, Result};
use crate::files::input::read_text;
use crate::files::picture::{is_png, png_text};
use crate::scene::Extent;
use clap::{ArgAction, Args, FromArgMatches};
use std::error::Error as _;
use std::path::Path;
use toml::{Table, Value};

const WHAT: &str = "cannot read scene file";

/// Key of the scene file in the metadata of a picture.
pub const SCENE_KEY: &str = "umbravox:scene";

impl SceneRequest {
    /// Reads a scene file (TOML), or the scene that a PNG picture of this program contains. A relative path in it
    /// means a file beside the scene file, or else in the working folder.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, or has an unknown key or a value out of range; a picture contains no
    /// scene.
    pub fn read(path: &Path) -> Result<Self> {
        let text = if is_png(path) { scene_of_picture(path)? } else { read_text(path, WHAT)? };
        let mut request = Self::from_toml(&text).map_err(|e| e.at(path.display()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let SceneSettings { volume, tf, masking, opaque, light, read_flags, .. } = &mut request.settings;
        let names = [volume, tf].into_iter().flatten();
        let names = names.chain(masking.files_mut()).chain(opaque.files_mut());
        let skies = light.iter_mut().flatten().filter_map(|source| match &mut source.extent {
            Extent::Map(map) => Some(&mut map.path),
            _ => None,
        });
        let skies = skies.chain(read_flags.scratch.as_mut());
        for name in names.chain(skies) {
            // Built-in names are never files.
            let is_built_in = name.starts_with("phantom:") || PRESETS.iter().any(|p| p.name == name);
            let beside = folder.join(&*name);
            if !is_built_in && !name.is_empty() && Path::new(name).is_relative() && beside.exists() {
                *name = beside.to_string_lossy().into_owned();
            }
        }
        Ok(request)
    }

    /// Parses the text of a scene file (TOML).
    ///
    /// # Errors
    /// See [`Self::read`]; the place is a line or a key.
    pub fn from_toml(text: &str) -> Result<Self> {
        let table: Table = toml::from_str(text).map_err(|e: toml::de::Error| {
            let line = 1 + e.span().map_or(0, |s| text[..s.start].matches('\n').count());
            Error::input(WHAT, format!("line {line}"), e.message())
        })?;
        Self::from_table(&table)
    }

    /// Reads the settings of a scene from the keys of a parsed scene file.
    ///
    /// # Errors
    /// An unknown key, or a value out of range; the place is the key.
    pub fn from_table(table: &Table) -> Result<Self> {
        let keys: Vec<String> = Self::keys().into_iter().map(|(key, _)| key).collect();
        let unknown: Vec<&str> =
            table.keys().map(String::as_str).filter(|k| !keys.iter().any(|key| key == k)).collect();
        if !unknown.is_empty() {
            let error = Error::input(WHAT, unknown.join(", "), "unknown key");
            return Err(error.hint(format!("keys: {}", keys.join(", "))));
        }
        let mut request = Self::default();
        for (key, value) in table {
            let of_key = Self::from_key(key, value).map_err(|why| Error::input(WHAT, key, why))?;
            request = of_key.over(&request);
        }
        Ok(Self { settings: request.settings.with_phase_function()?, ..request })
    }

    /// Parses the value of a key in a scene file with the parser of the command-line flag of that name.
    fn from_key(key: &str, value: &Value) -> Result<Self, String> {
        let command = Self::augment_args(clap::Command::new("scene")).no_binary_name(true);
        let arg = command.get_arguments().find(|arg| arg.get_id() == key).ok_or("unknown key")?;
        // A flag that may be given several times takes a list of strings, too.
        let values = match value {
            Value::Array(items) if !items.is_empty() && items.iter().all(Value::is_str) => &items[..],
            value => std::slice::from_ref(value),
        };
        let line: Vec<String> = if let ArgAction::SetTrue = arg.get_action() {
            let is_given = value.as_bool().ok_or("expected true or false")?;
            is_given.then(|| format!("--{key}")).into_iter().collect()
        } else {
            let texts = values.iter().map(flag_text).collect::<Result<Vec<_>, _>>()?;
            match arg.is_positional() {
                true => ["--".to_owned()].into_iter().chain(texts).collect(),
                false => texts.iter().map(|text| format!("--{key}={text}")).collect(),
            }
        };
        let matches = command.try_get_matches_from(line);
        matches.and_then(|matches| Self::from_arg_matches(&matches)).map_err(|e| match e.source() {
            Some(why) => why.to_string(),
            None => flag_error(&e),
        })
    }

    /// Returns every key of scene files with the help text of the command-line flag of that name.
    pub fn keys() -> Vec<(String, String)> {
        let command = Self::augment_args(clap::Command::new("scene"));
        let help = |a: &clap::Arg| a.get_help().map_or_else(String::new, ToString::to_string);
        command.get_arguments().map(|a| (a.get_id().to_string(), help(a))).collect()
    }
}

impl SceneSettings {
    /// Writes these settings as the text of a scene file (TOML).
    ///
    /// # Errors
    /// A whole number that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::input("cannot write scene", "settings", e))
    }
}

/// Returns the text of the scene file in the metadata of a PNG picture.
fn scene_of_picture(path: &Path) -> Result<String> {
    png_text(path, SCENE_KEY)?.ok_or_else(|| {
        Error::input(WHAT, path.display(), "the picture contains no scene").hint(
            "pictures of `render` and of the window contain it, unless another program has saved them again",
        )
    })
}

/// Converts a TOML value of a scene file to the text that the command-line flag of the same name takes.
fn flag_text(value: &Value) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(n) => Ok(n.to_string()),
        Value::Float(x) => Ok(x.to_string()),
        Value::Array(items) if !items.iter().any(Value::is_str) => {
            Ok(items.iter().map(flag_text).collect::<Result<Vec<_>, _>>()?.join(","))
        }
        _ => Err("expected a string, a number or an array of numbers".into()),
    }
}

/// Returns the reason of a command-line parsing error of clap, in one line.
pub fn flag_error(e: &clap::Error) -> String {
    let message = e.to_string();
    let reason = message.split("\n\n").next().unwrap_or_default();
    reason.trim_start_matches("error: ").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shading;
    use clap::{CommandFactory, Parser};

    #[derive(Parser)]
    #[command(no_binary_name = true, disable_help_flag = true)]
    struct CommandLine {
        #[command(flatten)]
        request: SceneRequest,
    }

    fn to_toml(request: &SceneRequest) -> String {
        toml::to_string(request).unwrap()
    }

    /// Example values of command-line flags for the tests; values that only few flags accept come first.
    const TEXTS: &[&str] = &[
        "2x2x2:u8",
        "auto",
        "2x2x1",
        "2GiB",
        "500MB",
        "3x3x3:i16:be",
        "1:2,,3:",
        ":9,1:4,2:8",
        "0:0,5:1",
        "0:1,7.5:0.25,per=voxel",
        "0,0,1,-20",
        "0,1,0,30",
        "dir:0,0.28,0.96",
        "point:1,2.5,-3",
        "A",
        "S",
        "8x9",
        "7x6",
        "1,2,3.5",
        "4,5,6",
        "#336699",
        "none",
        "rays",
        "1-3,7=bone",
        "4=skin",
        "tiles,bricks",
        "gradients",
        "64",
        "65",
        "0.5",
        "0.25",
        "1",
        "2",
        "box",
        "tent",
        "lambert",
        "blinn-phong",
        "bricks",
        "hu",
        "fraction",
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
        "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
    ];

    /// Returns every key of scene files with two different values, parsed from `--key=value`.
    fn two_of_each() -> Vec<(String, [SceneRequest; 2])> {
        let command = CommandLine::command();
        let keys =
            command.get_arguments().map(|a| (a.get_id().to_string(), a.is_positional(), a.get_action()));
        keys.map(|(key, positional, action)| {
            let lines: Vec<String> = match action {
                ArgAction::SetTrue => vec![format!("--{key}")],
                _ if positional => TEXTS.iter().map(|t| (*t).to_owned()).collect(),
                _ => TEXTS.iter().map(|t| format!("--{key}={t}")).collect(),
            };
            let good = lines.iter().filter_map(|line| CommandLine::try_parse_from([line]).ok());
            let mut good: Vec<_> = good.map(|line| line.request).collect();
            good.dedup();
            if matches!(action, ArgAction::SetTrue) {
                good.push(SceneRequest::default());
            }
            assert!(good.len() > 1, "--{key} takes fewer than two of TEXTS");
            (key, [good[0].clone(), good[1].clone()])
        })
        .collect()
    }

    #[test]
    fn every_setting_survives_a_file_and_wins_over_one() {
        let every = two_of_each();
        assert!(every.len() > 20);
        for (key, [one, other]) in &every {
            for settings in [one, other] {
                let text = to_toml(settings);
                assert!(text.is_empty() || text.starts_with(&format!("{key} = ")), "{key}: {text}");
                let mut expected = settings.clone();
                expected.settings = expected.settings.with_phase_function().unwrap();
                assert_eq!(SceneRequest::from_toml(&text).unwrap(), expected, "{text}");
            }
            assert_ne!(one, other, "{key}");
            assert_eq!(one.over(&SceneRequest::default()), *one);
            assert_eq!(SceneRequest::default().over(one), *one);
            // A switch that is not given overrides nothing.
            let winner = if to_toml(other).is_empty() { one } else { other };
            assert_eq!(other.over(one), *winner, "{key}");
        }
        let mut all = every.iter().fold(SceneRequest::default(), |all, (_, [one, _])| one.over(&all));
        // No other shading has a phase function.
        all.settings.shading = Some(Shading::Phase);
        let text = to_toml(&all);
        assert_eq!(text.lines().count(), every.len(), "{text}");
        assert_eq!(SceneRequest::from_toml(&text).unwrap(), all);
    }

    #[test]
    fn files_of_earlier_versions_are_read() {
        let text = "volume = 'a.raw'\nraw = '2x2x2:u8'\nspacing = [1, 2, 3.5]\noffset = '1'\nframe = 1\n\
            resolution = 64\nkernel = 'tent'\nthickness = 0.5\nadapter = 7\ntf = 'bone'\nsize = '8x9'\n\
            eye = [1, 2, 3]\ntarget = '4,5,6'\nlight = 'point:1,2,3'\nno-skip = 'tiles,bricks'\nexplain = false\n\
            background = '#ffffff'\nfov = '50'";
        let flags = [
            "--raw=2x2x2:u8",
            "--spacing=1,2,3.5",
            "--offset=1",
            "--frame=1",
            "--resolution=64",
            "--kernel=tent",
            "--thickness=0.5",
            "--adapter=7",
            "--tf=bone",
            "--size=8x9",
            "--eye=1,2,3",
            "--target=4,5,6",
            "--light=point:1,2,3",
            "--no-skip=tiles,bricks",
            "--background=#ffffff",
            "--fov=50",
            "a.raw",
        ];
        let settings = CommandLine::try_parse_from(flags).unwrap().request;
        assert_eq!(SceneRequest::from_toml(text).unwrap(), settings);
    }

    #[test]
    fn a_file_beside_a_scene_file_is_meant_before_one_elsewhere() {
        let dir = tempfile::tempdir().unwrap();
        let (scene, tf) = (dir.path().join("scene.toml"), dir.path().join("bone.json"));
        std::fs::write(&scene, "volume = 'phantom:slab:8'\ntf = 'bone.json'").unwrap();
        assert_eq!(SceneRequest::read(&scene).unwrap().settings.tf.unwrap(), "bone.json");
        std::fs::write(&tf, "{}").unwrap();
        let read = SceneRequest::read(&scene).unwrap().settings;
        assert_eq!(read.tf.unwrap(), tf.to_string_lossy());
        assert_eq!(read.volume.unwrap(), "phantom:slab:8");
        // A preset is never a file.
        std::fs::write(dir.path().join("bone"), "").unwrap();
        std::fs::write(&scene, "tf = 'bone'").unwrap();
        assert_eq!(SceneRequest::read(&scene).unwrap().settings.tf.unwrap(), "bone");
        // Paths of meshes and of strands are resolved one by one.
        let things = "['here.stl,color=#ff0000', 'elsewhere.stl', 'phantom:hair-fur']";
        std::fs::write(&scene, format!("mesh = {things}\nstrands = {things}")).unwrap();
        std::fs::write(dir.path().join("here.stl"), "").unwrap();
        let opaque = SceneRequest::read(&scene).unwrap().settings.opaque;
        let paths: Vec<_> = opaque.mesh.unwrap().into_iter().map(|mesh| mesh.source).collect();
        let here = dir.path().join("here.stl").to_string_lossy().into_owned();
        assert_eq!(paths, [&*here, "elsewhere.stl", "phantom:hair-fur"]);
        let sources: Vec<_> = opaque.strands.unwrap().into_iter().map(|strands| strands.source).collect();
        assert_eq!(sources, paths);
    }

    #[test]
    fn the_scene_in_a_picture_is_read() {
        use crate::files::picture::{Backdrop, write_picture_with};
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("picture.png");
        let write = |texts: &[(&str, &str)]| {
            let texts: Vec<_> = texts.iter().map(|(k, t)| ((*k).to_owned(), (*t).to_owned())).collect();
            let picture = ndarray::Array3::<f32>::zeros((2, 3, 4));
            write_picture_with(&path, &picture, Backdrop::Drawn, &texts).unwrap();
        };
        write(&[("Software", "test"), (SCENE_KEY, "volume = 'phantom:slab:8'\nfov = 40\nname = 'Körper'")]);
        let settings = SceneRequest::read(&path).unwrap().settings;
        assert_eq!(
            (settings.volume.as_deref(), settings.name.as_deref()),
            (Some("phantom:slab:8"), Some("Körper"))
        );
        write(&[("Software", "test")]);
        let e = SceneRequest::read(&path).unwrap_err();
        assert!(e.exit_status() == 2 && e.why.contains("no scene") && e.hint.is_some(), "{e}");
        std::fs::write(&path, b"\x89PNG\r\n\x1a\n cut").unwrap();
        assert_eq!(SceneRequest::read(&path).unwrap_err().exit_status(), 2);
    }

    #[test]
    fn unknown_keys_are_refused_by_name() {
        let e = SceneRequest::from_toml("fov = 40\nfovv = 40\nscene = 'x.toml'").unwrap_err();
        assert!(e.place == "fovv, scene" && e.hint.unwrap().contains("fov, light"), "{}", e.place);
    }

    #[test]
    fn directions_come_back_to_the_last_bit() {
        let text = "light = 'dir:0.3,-0.2,0.7'\nup = [0.1, 0.2, 0.3]";
        let request = SceneRequest::from_toml(text).unwrap();
        assert_eq!(SceneRequest::from_toml(&to_toml(&request)).unwrap(), request);
    }
}
