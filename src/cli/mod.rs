//! Command line of `umbravox`, with one source file for each command.

pub mod benchmark;
pub mod claims;
pub mod compare;
pub mod completions;
mod console;
pub mod convert;
mod error;
pub mod export;
pub mod frames;
pub mod info;
mod info_strands;
mod interrupt;
mod measuring_bar;
pub mod merge;
pub mod methods;
pub mod phantom;
pub mod probe;
mod probe_curve;
pub mod probe_points;
pub mod probe_rays;
mod probe_slices;
pub mod render;
mod render_progress;
pub mod stability;
mod table_flags;
pub mod tf;
pub mod verify;
pub mod view;
pub mod voxelise;

use crate::error::Result;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use console::{print_message, print_result};
use std::ffi::OsString;
use std::io::{self, IsTerminal};
use tracing_subscriber::EnvFilter;

/// Volumetric shadows for CT volumes, with the error of each shadow method against an exact answer.
#[derive(Debug, Parser)]
#[command(name = "umbravox", version, arg_required_else_help = false)]
struct Cli {
    /// Print more messages on stderr; -vv and -vvv print still more
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Info(info::InfoArgs),
    Render(render::RenderArgs),
    Probe(probe::ProbeArgs),
    Compare(Box<compare::CompareArgs>),
    Export(Box<export::ExportArgs>),
    Convert(convert::ConvertArgs),
    Merge(merge::MergeArgs),
    Benchmark(benchmark::BenchmarkArgs),
    Verify(verify::VerifyArgs),
    Claims(claims::ClaimsArgs),
    Stability(stability::StabilityArgs),
    Voxelise(voxelise::VoxeliseArgs),
    Phantom(phantom::PhantomArgs),
    Tf(tf::TfArgs),
    Methods(methods::MethodsArgs),
    Completions(completions::CompletionsArgs),
    View(Box<view::ViewArgs>),
}

/// Returns clap's definition of the command line: all commands, flags and help texts.
pub fn command() -> clap::Command {
    Cli::command()
}

/// Function that opens the viewer window for the `view` command. The command line takes it as a parameter, because
/// the window belongs to a higher module.
pub type Window = fn(view::ViewArgs) -> Result<()>;

/// Runs a command line, whose first argument is the program name. Prints any error and returns the exit status: 0, 1 if the
/// command failed, 2 for wrong input.
pub fn main(args: impl IntoIterator<Item = OsString>, window: Window) -> u8 {
    let args = without_help(args.into_iter().collect());
    let result = match Cli::try_parse_from(&args) {
        Ok(cli) => {
            log_to_stderr(cli.verbose);
            run(cli.command, window)
        }
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            print_result(&e.render())
        }
        Err(e) => Err(error::from_clap(&e, &args, named_command(&args).as_ref())),
    };
    match result {
        Ok(()) => 0,
        Err(e) => {
            print_message("error", &e);
            if let Some(hint) = &e.hint {
                print_message("hint", hint);
            }
            e.exit_status()
        }
    }
}

/// Changes `help methods` to `methods`: the list of shadow methods helps more than the usage of that command.
fn without_help(mut args: Vec<OsString>) -> Vec<OsString> {
    if args.get(1).is_some_and(|arg| arg == "help") && args.get(2).is_some_and(|arg| arg == "methods") {
        args.remove(1);
    }
    args
}

fn run(command: Command, window: Window) -> Result<()> {
    interrupt::listen()?;
    match command {
        Command::Info(args) => info::run(&args),
        Command::Render(args) => render::run(args),
        Command::Probe(args) => probe::run(args),
        Command::Compare(args) => compare::run(*args),
        Command::Export(args) => export::run(*args),
        Command::Convert(args) => convert::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Benchmark(args) => benchmark::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Claims(args) => claims::run(&args),
        Command::Stability(args) => stability::run(&args),
        Command::Voxelise(args) => voxelise::run(&args),
        Command::Phantom(args) => phantom::run(&args.name, &args.output),
        Command::Tf(args) => tf::run(args),
        Command::Methods(args) => methods::run(&args),
        Command::Completions(args) => completions::run(&args, Cli::command()),
        Command::View(args) => window(*args),
    }
}

/// Command in a command line that the parser clap rejected; the error's hint names it.
fn named_command(args: &[OsString]) -> Option<clap::Command> {
    let named = |a: &OsString| Cli::command().find_subcommand(a).cloned();
    args.iter().skip(1).find_map(named)
}

fn log_to_stderr(verbose: u8) {
    // Users cannot act on warnings of the GPU libraries. The command itself reports why the window did not open.
    let filter = match verbose {
        0 => "error,eframe=off,umbravox=warn",
        1 => "warn,umbravox=info",
        2 => "info,umbravox=debug",
        _ => "trace",
    };
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::new(filter))
        .with_writer(io::stderr)
        .with_target(verbose > 1)
        .without_time()
        .log_internal_errors(false);
    // By default there are colours, unless `NO_COLOR` is set (no-color.org).
    let subscriber = if io::stderr().is_terminal() { subscriber } else { subscriber.with_ansi(false) };
    // A second call in a process fails; the settings of the first one stay.
    let _ = subscriber.try_init();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_definitions_are_sound() {
        Cli::command().debug_assert();
    }
}
