//! `umbravox methods`: lists the shadow methods, or the settings of one.

use super::console::print_result;
use crate::error::{Error, Result};
use crate::shadow::{Entry, METHODS, entry};
use clap::Args;
use itertools::Itertools as _;
use std::fmt::Write as _;

/// List the shadow methods, or the settings of one
#[derive(Debug, Args)]
pub struct MethodsArgs {
    /// Shadow method whose settings are listed
    #[arg(value_name = "NAME")]
    name: Option<String>,
}

/// Runs the `methods` command: prints to stdout.
///
/// # Errors
/// There is no such method, or stdout cannot be written.
pub fn run(args: &MethodsArgs) -> Result<()> {
    let Some(name) = &args.name else { return print_result(&list()) };
    let unknown = || {
        let names = METHODS.iter().map(|method| method.name).join(", ");
        Error::input("unknown shadow method", name, format!("there are {names}"))
    };
    print_result(&settings(entry(name).ok_or_else(unknown)?))
}

/// Names and summaries of all shadow methods, a line each.
fn list() -> String {
    METHODS.iter().map(|method| format!("{:<12} {}\n", method.name, method.summary)).collect()
}

/// Settings of a shadow method, each with its values, default and meaning.
fn settings(method: &Entry) -> String {
    let mut text = format!("{}: {}\n", method.name, method.summary);
    for key in method.keys {
        // Writing to a string cannot fail.
        let _ =
            write!(text, "\n{}={} [default: {}]\n    {}\n", key.name, key.values(), key.default, key.help);
    }
    text
}
