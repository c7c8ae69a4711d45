//! Errors of clap in the form of this program: one line, and a hint.

use crate::error::Error;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::error::Error as _;

/// Converts an error of clap; `command` names the command whose help the hint suggests.
pub fn from_clap(e: &clap::Error, command: Option<&str>) -> Error {
    let text = |kind| e.get(kind).map(text_of).filter(|s| !s.is_empty());
    let argument = text(ContextKind::InvalidArg);
    let value = text(ContextKind::InvalidValue);
    let valid = text(ContextKind::ValidValue).or_else(|| text(ContextKind::ValidSubcommand));
    let mut hint = [ContextKind::SuggestedArg, ContextKind::SuggestedSubcommand, ContextKind::SuggestedValue]
        .into_iter()
        .find_map(text)
        .map(|s| format!("did you mean `{s}`?"));
    let (place, why) = match e.kind() {
        ErrorKind::ValueValidation => {
            let reason = e.source().map_or_else(|| "it is not valid".into(), ToString::to_string);
            let value = value.unwrap_or_default();
            (
                argument,
                if reason.contains(&format!("`{value}`")) { reason } else { format!("`{value}`: {reason}") },
            )
        }
        ErrorKind::InvalidValue => match value {
            Some(value) => {
                hint = hint.or_else(|| valid.map(|v| format!("one of: {v}")));
                (argument, format!("`{value}` is not one of its values"))
            }
            None => (argument, "it needs a value".into()),
        },
        ErrorKind::UnknownArgument => (argument, "there is no such flag or argument here".into()),
        ErrorKind::InvalidSubcommand => {
            hint = hint.or_else(|| valid.map(|v| format!("commands: {v}")));
            (text(ContextKind::InvalidSubcommand), "there is no such command".into())
        }
        ErrorKind::MissingSubcommand | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            hint = hint.or_else(|| valid.map(|v| format!("commands: {v}")));
            (Some("COMMAND".into()), "none is given".into())
        }
        ErrorKind::MissingRequiredArgument => (argument, "it is required".into()),
        ErrorKind::ArgumentConflict => {
            let other = text(ContextKind::PriorArg);
            let why = match &other {
                Some(other) if Some(other) != argument.as_ref() => format!("it cannot be used with {other}"),
                _ => "it is given more than once".into(),
            };
            (argument, why)
        }
        ErrorKind::NoEquals => (argument, "a value must follow after `=`".into()),
        ErrorKind::TooManyValues | ErrorKind::TooFewValues | ErrorKind::WrongNumberOfValues => {
            (argument, "the number of values is wrong".into())
        }
        ErrorKind::InvalidUtf8 => (argument, "the text is not UTF-8".into()),
        _ => (argument, e.kind().to_string()),
    };
    let help = command.map_or_else(String::new, |command| format!("{command} "));
    let hint = hint.unwrap_or_else(|| format!("see `umbravox {help}--help`"));
    Error::input("bad command line", place.unwrap_or_else(|| "arguments".into()), why).hint(hint)
}

fn text_of(value: &ContextValue) -> String {
    match value {
        ContextValue::Strings(all) => all.join(", "),
        ContextValue::StyledStrs(all) => all.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
        ContextValue::None => String::new(),
        other => other.to_string(),
    }
}
