//! clap's errors in this program's form: one line, and a hint.

use crate::error::Error;
use crate::open::{Refusal, refusal};

/// The error line for a command line that clap refused.
pub fn from_clap(e: &clap::Error, command: Option<&str>) -> Error {
    let Refusal { place, why, hint } = refusal(e);
    let help = match command {
        Some(command) => format!("umbravox {command} --help"),
        None => "umbravox --help".into(),
    };
    Error::input("bad command line", place, why).hint(hint.unwrap_or_else(|| format!("see `{help}`")))
}
