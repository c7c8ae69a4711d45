//! `--scene FILE.toml`: the shared flags as keys, read by the very parsers of the flags.

use super::error::{self, Refusal};
use super::scene_args::SceneArgs;
use crate::error::{Error, Result};
use crate::files::input::read_text;
use clap::{ArgAction, CommandFactory, FromArgMatches, Parser};
use std::path::Path;
use toml::Value;

const WHAT: &str = "cannot read scene file";

/// The shared flags as a command of their own.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct SceneFile {
    #[command(flatten)]
    args: SceneArgs,
}

/// Reads a scene file. Its paths are relative to the working folder, as those of flags are.
///
/// # Errors
/// The file cannot be read, is not TOML, has keys that are no flags, or a value that the flag would not take.
pub fn read(path: &Path) -> Result<SceneArgs> {
    let text = read_text(path, WHAT)?;
    let table: toml::Table = toml::from_str(&text).map_err(|e: toml::de::Error| {
        let line = 1 + e.span().map_or(0, |s| text[..s.start].matches('\n').count());
        Error::input(WHAT, format!("{}: line {line}", path.display()), e.message())
    })?;
    let at = |key: &str| format!("{}: {key}", path.display());
    let command = SceneFile::command();
    // A scene file within a scene file would make the order of precedence a riddle.
    let known = |key: &str| command.get_arguments().find(|a| a.get_id() == key && key != "scene");
    let unknown: Vec<&str> = table.keys().map(String::as_str).filter(|k| known(k).is_none()).collect();
    if !unknown.is_empty() {
        let keys: Vec<&str> =
            command.get_arguments().map(|a| a.get_id().as_str()).filter(|k| *k != "scene").collect();
        return Err(Error::input(WHAT, at(&unknown.join(", ")), "unknown key")
            .hint(format!("keys: {}", keys.join(", "))));
    }
    let mut arguments = Vec::new();
    let mut volume = None;
    for (key, value) in &table {
        let is_flag = known(key).is_some_and(|a| matches!(a.get_action(), ArgAction::SetTrue));
        match value {
            Value::Boolean(on) if is_flag => arguments.extend(on.then(|| format!("--{key}"))),
            _ if is_flag => return Err(Error::input(WHAT, at(key), "expected true or false")),
            _ => {
                let text = text_of(value).ok_or_else(|| {
                    Error::input(WHAT, at(key), "expected a string, a number or an array of numbers")
                })?;
                if key == "volume" {
                    volume = Some(text);
                } else {
                    arguments.push(format!("--{key}={text}"));
                }
            }
        }
    }
    let parsed = command.try_get_matches_from(&arguments).and_then(|m| SceneFile::from_arg_matches(&m));
    let mut args = parsed.map_err(|e| {
        let Refusal { place, why, hint } = error::refusal(&e);
        let key = place.trim_start_matches("--").split([' ', '=']).next().unwrap_or_default();
        Error { hint, ..Error::input(WHAT, at(key), why) }
    })?;
    args.args.volume = volume;
    Ok(args.args)
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
