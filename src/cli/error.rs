//! Errors of the command-line parser clap, converted to the form of this program: one line and a hint.

use crate::error::Error;
use crate::open::flag_error;
use clap::error::ContextKind as Kind;

/// Converts an error of the command-line parser clap. `command` is the command whose `--help` the hint suggests.
pub fn from_clap(e: &clap::Error, command: Option<&str>) -> Error {
    let first = |kinds: &[Kind]| {
        let mut texts = kinds.iter().filter_map(|kind| e.get(*kind)).map(ToString::to_string);
        texts.find(|text| !text.is_empty())
    };
    let place = first(&[Kind::InvalidArg, Kind::InvalidSubcommand]).unwrap_or_else(|| "arguments".into());
    let hint = match first(&[Kind::SuggestedArg, Kind::SuggestedSubcommand, Kind::SuggestedValue]) {
        Some(known) => format!("did you mean `{known}`?"),
        None => format!("see `umbravox {}--help`", command.map_or(String::new(), |name| format!("{name} "))),
    };
    Error::input("bad command line", place, flag_error(e)).hint(hint)
}
