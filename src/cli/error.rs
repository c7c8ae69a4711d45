//! Errors of the command-line parser clap, converted to the form of this program: one line and a hint.

use crate::error::Error;
use crate::open::flag_error;
use clap::Command;
use clap::error::ContextKind as Kind;
use std::ffi::OsString;

/// Smallest Jaro similarity (0 to 1) of a word to a suggestion that is shown.
const LEAST_SIMILARITY: f64 = 0.8;

/// Converts an error of the command-line parser clap for a command line `args`. `command` is the command in it, whose
/// `--help` the hint suggests.
pub fn from_clap(e: &clap::Error, args: &[OsString], command: Option<&Command>) -> Error {
    let first = |kinds: &[Kind]| {
        let mut texts = kinds.iter().filter_map(|kind| e.get(*kind)).map(ToString::to_string);
        texts.find(|text| !text.is_empty())
    };
    let place = first(&[Kind::InvalidArg, Kind::InvalidSubcommand]).unwrap_or_else(|| "arguments".into());
    let pairs = [
        (Kind::InvalidArg, Kind::SuggestedArg),
        (Kind::InvalidSubcommand, Kind::SuggestedSubcommand),
        (Kind::InvalidValue, Kind::SuggestedValue),
    ];
    let suggested = || {
        pairs.iter().find_map(|(given, suggested)| {
            let (given, suggested) = (first(&[*given])?, first(&[*suggested])?);
            let similar: Vec<_> = suggested.split(", ").filter(|known| is_similar(&given, known)).collect();
            (!similar.is_empty()).then(|| similar.join("` or `"))
        })
    };
    let hint = match command.and_then(|command| long_flag(&place, args, command)).or_else(suggested) {
        Some(known) => format!("did you mean `{known}`?"),
        None => format!(
            "see `umbravox {}--help`",
            command.map_or(String::new(), |command| format!("{} ", command.get_name()))
        ),
    };
    Error::input("bad command line", place, flag_error(e)).hint(hint)
}

/// Whether a word that the parser suggests is close enough to the given one. The parser also suggests `--name` for
/// `--camera`.
fn is_similar(given: &str, known: &str) -> bool {
    let plain =
        |word: &str| word.trim_start_matches('-').split(['=', ' ']).next().unwrap_or_default().to_lowercase();
    strsim::jaro(&plain(given), &plain(known)) >= LEAST_SIMILARITY
}

/// Returns the long flag of the command that was written with a single `-`, such as `--tf` for `-tf`. The parser took that
/// for several short flags and names one of them, `refused`.
fn long_flag(refused: &str, args: &[OsString], command: &Command) -> Option<String> {
    let letter = refused.strip_prefix('-').filter(|letter| letter.len() == 1)?;
    let names = args.iter().filter_map(|arg| arg.to_str()?.strip_prefix('-')?.split('=').next());
    let mut meant = names.filter(|name| name.len() > 1 && name.contains(letter));
    meant
        .find(|name| command.get_arguments().any(|flag| flag.get_long() == Some(name)))
        .map(|name| format!("--{name}"))
}
