//! Errors of the command-line parser clap, converted to the form of this program: one line and a hint.

use crate::error::Error;
use crate::open::flag_error;
use clap::Command;
use clap::error::ContextKind as Kind;
use std::ffi::OsString;

/// Converts an error of the command-line parser clap for a command line `args` of the definition `known`. `command` is the
/// command whose `--help` the hint suggests.
pub fn from_clap(e: &clap::Error, args: &[OsString], known: &Command, command: Option<&str>) -> Error {
    let first = |kinds: &[Kind]| {
        let mut texts = kinds.iter().filter_map(|kind| e.get(*kind)).map(ToString::to_string);
        texts.find(|text| !text.is_empty())
    };
    let place = first(&[Kind::InvalidArg, Kind::InvalidSubcommand]).unwrap_or_else(|| "arguments".into());
    let suggested = || first(&[Kind::SuggestedArg, Kind::SuggestedSubcommand, Kind::SuggestedValue]);
    let hint = match long_flag(&place, args, known).or_else(suggested) {
        Some(known) => format!("did you mean `{known}`?"),
        None => format!("see `umbravox {}--help`", command.map_or(String::new(), |name| format!("{name} "))),
    };
    Error::input("bad command line", place, flag_error(e)).hint(hint)
}

/// Returns the long flag that was written with a single `-`, such as `--tf` for `-tf`. The parser took that for several
/// short flags, of which it names the first, `refused`.
fn long_flag(refused: &str, args: &[OsString], known: &Command) -> Option<String> {
    let is_short = refused.len() == 2 && refused.starts_with('-');
    let texts = args.iter().filter_map(|arg| arg.to_str()).filter(|_| is_short);
    let mut written =
        texts.filter(|text| !text.starts_with("--") && text.len() > 2 && text.starts_with(refused));
    let is_known = |name: &str| {
        let mut flags = known.get_subcommands().flat_map(Command::get_arguments);
        flags.any(|flag| flag.get_long() == Some(name))
    };
    written
        .find_map(|text| Some(text.trim_start_matches('-')).filter(|name| is_known(name)))
        .map(|name| format!("--{name}"))
}
