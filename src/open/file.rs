//! Scene files: [`SceneSettings`] as TOML, both ways. A key is read by the very parser of its flag.

use super::presets::PRESETS;
use super::refusal::{Refusal, refusal};
use super::settings::SceneSettings;
use crate::error::{Error, Result};
use crate::files::input::read_text;
use clap::{ArgAction, CommandFactory, FromArgMatches, Parser};
use std::path::Path;
use toml::{Table, Value};

const WHAT: &str = "cannot read scene file";

/// The settings as a command of their own.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct Line {
    #[command(flatten)]
    settings: SceneSettings,
}

impl SceneSettings {
    /// Reads a scene file. Its paths are of files beside it, or else relative to the working folder, as those of flags are.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, has keys that are no flags, or a value that the flag would not take.
    pub fn read(path: &Path) -> Result<Self> {
        let mut settings = Self::from_toml(&read_text(path, WHAT)?).map_err(|e| e.at(path.display()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for name in [&mut settings.volume, &mut settings.tf].into_iter().flatten() {
            let beside = folder.join(&*name);
            // Neither a preset nor a built-in volume has a file; where one is called so, it is the file that is odd.
            let is_built_in = name.starts_with("phantom:") || PRESETS.iter().any(|p| p.name == name);
            if !is_built_in && !name.is_empty() && Path::new(name).is_relative() && beside.exists() {
                *name = beside.to_string_lossy().into_owned();
            }
        }
        settings.parts.beside(folder);
        settings.opaque.beside(folder);
        Ok(settings)
    }

    /// Reads the text of a scene file.
    ///
    /// # Errors
    /// As [`Self::read`]; the place is a line or a key.
    pub fn from_toml(text: &str) -> Result<Self> {
        let table: Table = toml::from_str(text).map_err(|e: toml::de::Error| {
            let line = 1 + e.span().map_or(0, |s| text[..s.start].matches('\n').count());
            Error::input(WHAT, format!("line {line}"), e.message())
        })?;
        Self::try_from(table)
    }

    /// The text of a scene file that says the same.
    ///
    /// # Errors
    /// A whole number that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(unwritable)
    }

    /// These where given, those below otherwise.
    ///
    /// # Errors
    /// As [`Self::to_toml`].
    pub fn over(&self, below: &Self) -> Result<Self> {
        let mut table = Table::try_from(below).map_err(unwritable)?;
        table.extend(Table::try_from(self).map_err(unwritable)?);
        Self::try_from(table)
    }
}

impl SceneSettings {
    /// Every key, with the help of its flag.
    pub fn keys() -> Vec<(String, String)> {
        let command = Line::command();
        let help = |a: &clap::Arg| a.get_help().map_or_else(String::new, ToString::to_string);
        command.get_arguments().map(|a| (a.get_id().to_string(), help(a))).collect()
    }
}

fn unwritable(e: toml::ser::Error) -> Error {
    Error::input("cannot write scene", "settings", e)
}

impl TryFrom<Table> for SceneSettings {
    type Error = Error;

    fn try_from(table: Table) -> Result<Self> {
        let command = Line::command();
        let known = |key: &str| command.get_arguments().find(|a| a.get_id() == key);
        let unknown: Vec<&str> = table.keys().map(String::as_str).filter(|k| known(k).is_none()).collect();
        if !unknown.is_empty() {
            let keys: Vec<&str> = command.get_arguments().map(|a| a.get_id().as_str()).collect();
            return Err(Error::input(WHAT, unknown.join(", "), "unknown key")
                .hint(format!("keys: {}", keys.join(", "))));
        }
        let (mut flags, mut positional) = (Vec::new(), Vec::new());
        for (key, value) in &table {
            let argument = known(key);
            let is_switch = argument.is_some_and(|a| matches!(a.get_action(), ArgAction::SetTrue));
            match value {
                Value::Boolean(on) if is_switch => flags.extend(on.then(|| format!("--{key}"))),
                _ if is_switch => return Err(Error::input(WHAT, key, "expected true or false")),
                // A flag that may be given more than once has a list of texts, too.
                Value::Array(items) if texts_for(argument, items) => {
                    flags
                        .extend(items.iter().filter_map(Value::as_str).map(|text| format!("--{key}={text}")));
                }
                _ => {
                    let text = text_of(value).ok_or_else(|| {
                        let list =
                            if is_list(argument) { " of numbers, or of strings" } else { " of numbers" };
                        Error::input(WHAT, key, format!("expected a string, a number or an array{list}"))
                    })?;
                    match argument.is_some_and(clap::Arg::is_positional) {
                        true => positional.extend(["--".into(), text]),
                        false => flags.push(format!("--{key}={text}")),
                    }
                }
            }
        }
        flags.extend(positional);
        let parsed = command.try_get_matches_from(&flags).and_then(|m| Line::from_arg_matches(&m));
        parsed.map(|line| line.settings).map_err(|e| {
            let Refusal { place, why, hint } = refusal(&e);
            let key = place.trim_start_matches("--").split([' ', '=']).next().unwrap_or_default();
            Error { hint, ..Error::input(WHAT, key, why) }
        })
    }
}

/// Whether a flag may be given more than once.
fn is_list(argument: Option<&clap::Arg>) -> bool {
    argument.is_some_and(|a| matches!(a.get_action(), ArgAction::Append))
}

/// Whether these are the texts of a flag that may be given more than once.
fn texts_for(argument: Option<&clap::Arg>, items: &[Value]) -> bool {
    is_list(argument) && !items.is_empty() && items.iter().all(Value::is_str)
}

/// A value as it would stand on the command line.
fn text_of(value: &Value) -> Option<String> {
    match value {
        Value::String(s) => Some(s.clone()),
        Value::Integer(n) => Some(n.to_string()),
        Value::Float(x) => Some(x.to_string()),
        Value::Array(items) => {
            let numbers = items.iter().filter(|v| matches!(v, Value::Integer(_) | Value::Float(_)));
            let texts: Vec<String> = numbers.filter_map(text_of).collect();
            (texts.len() == items.len()).then(|| texts.join(","))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What some flag takes, the pickiest first; a setting that takes none of these needs a line more.
    const TEXTS: &[&str] = &[
        "2x2x2:u8",
        "auto",
        "2x2x1",
        "3x3x3:i16:be",
        "1:2,,3:",
        ":9,1:4,2:8",
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

    /// Two different values of every setting, as `--key=value`, and its key.
    fn two_of_each() -> Vec<(String, [SceneSettings; 2])> {
        let command = Line::command();
        let keys =
            command.get_arguments().map(|a| (a.get_id().to_string(), a.is_positional(), a.get_action()));
        keys.map(|(key, positional, action)| {
            let lines: Vec<String> = match action {
                ArgAction::SetTrue => vec![format!("--{key}")],
                _ if positional => TEXTS.iter().map(|t| (*t).to_owned()).collect(),
                _ => TEXTS.iter().map(|t| format!("--{key}={t}")).collect(),
            };
            let good = lines.iter().filter_map(|line| Line::try_parse_from([line]).ok());
            let mut good: Vec<_> = good.map(|line| line.settings).collect();
            good.dedup();
            if matches!(action, ArgAction::SetTrue) {
                good.push(SceneSettings::default());
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
                let text = settings.to_toml().unwrap();
                assert!(text.is_empty() || text.starts_with(&format!("{key} = ")), "{key}: {text}");
                assert_eq!(SceneSettings::from_toml(&text).unwrap(), *settings, "{text}");
            }
            assert_ne!(one, other, "{key}");
            assert_eq!(one.over(&SceneSettings::default()).unwrap(), *one);
            assert_eq!(SceneSettings::default().over(one).unwrap(), *one);
            // The other of two switches is one that is not given, and so wins over nothing.
            let winner = if other.to_toml().unwrap().is_empty() { one } else { other };
            assert_eq!(other.over(one).unwrap(), *winner, "{key}");
        }
        let all = every.iter().fold(SceneSettings::default(), |all, (_, [one, _])| one.over(&all).unwrap());
        let text = all.to_toml().unwrap();
        assert_eq!(text.lines().count(), every.len(), "{text}");
        assert_eq!(SceneSettings::from_toml(&text).unwrap(), all);
        assert_eq!(toml::from_str::<SceneSettings>(&text).unwrap(), all);
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
        let settings = Line::try_parse_from(flags).unwrap().settings;
        assert_eq!(SceneSettings::from_toml(text).unwrap(), settings);
    }

    #[test]
    fn a_file_beside_a_scene_file_is_meant_before_one_elsewhere() {
        let dir = tempfile::tempdir().unwrap();
        let (scene, tf) = (dir.path().join("scene.toml"), dir.path().join("bone.json"));
        std::fs::write(&scene, "volume = 'phantom:slab:8'\ntf = 'bone.json'").unwrap();
        assert_eq!(SceneSettings::read(&scene).unwrap().tf.unwrap(), "bone.json");
        std::fs::write(&tf, "{}").unwrap();
        let read = SceneSettings::read(&scene).unwrap();
        assert_eq!(read.tf.unwrap(), tf.to_string_lossy());
        assert_eq!(read.volume.unwrap(), "phantom:slab:8");
        // A preset is never a file.
        std::fs::write(dir.path().join("bone"), "").unwrap();
        std::fs::write(&scene, "tf = 'bone'").unwrap();
        assert_eq!(SceneSettings::read(&scene).unwrap().tf.unwrap(), "bone");
        // Of meshes and strands each by itself.
        let things = "['here.stl,color=#ff0000', 'elsewhere.stl', 'phantom:hair-fur']";
        std::fs::write(&scene, format!("mesh = {things}\nstrands = {things}")).unwrap();
        std::fs::write(dir.path().join("here.stl"), "").unwrap();
        let opaque = SceneSettings::read(&scene).unwrap().opaque;
        let paths: Vec<_> = opaque.mesh.unwrap().into_iter().map(|mesh| mesh.path).collect();
        assert_eq!(paths, [dir.path().join("here.stl"), "elsewhere.stl".into(), "phantom:hair-fur".into()]);
        let sources: Vec<_> = opaque.strands.unwrap().into_iter().map(|strands| strands.source).collect();
        assert_eq!(sources, paths.iter().map(|p| p.to_string_lossy().into_owned()).collect::<Vec<_>>());
    }

    #[test]
    fn unknown_keys_are_refused_by_name() {
        let e = SceneSettings::from_toml("fov = 40\nfovv = 40\nscene = 'x.toml'").unwrap_err();
        assert!(e.place == "fovv, scene" && e.hint.unwrap().contains("fov, light"), "{}", e.place);
    }

    #[test]
    fn directions_come_back_to_the_last_bit() {
        let text = "light = 'dir:0.3,-0.2,0.7'\nup = [0.1, 0.2, 0.3]";
        let settings = SceneSettings::from_toml(text).unwrap();
        assert_eq!(SceneSettings::from_toml(&settings.to_toml().unwrap()).unwrap(), settings);
    }
}
