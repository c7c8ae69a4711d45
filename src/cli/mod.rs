//! The command line: one file a command, each thin.

pub mod compare;
mod error;
pub mod info;
pub mod phantom;
pub mod probe;
mod probe_curve;
pub mod probe_rays;
pub mod render;
pub mod scene_args;
mod scene_file;
pub mod stability;
pub mod values;
pub mod view;
pub mod voxelise;

use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::shadow::METHODS;
use crate::transfer::TransferFunction;
use crate::transfer::presets::{self, PRESETS};
use crate::volume::{self, Volume};
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use scene_args::SceneRequest;
use std::ffi::OsString;
use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;

/// Volumetric shadows for CT volumes, each method with its error against an exact answer.
#[derive(Debug, Parser)]
#[command(name = "umbravox", version, arg_required_else_help = false)]
struct Cli {
    /// Say more on stderr; twice or three times for still more
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
    Compare(compare::CompareArgs),
    Stability(stability::StabilityArgs),
    Voxelise(voxelise::VoxeliseArgs),
    Phantom(phantom::PhantomArgs),
    View(Box<view::ViewArgs>),
}

/// The command line's definition, to be asked what it accepts.
pub fn command() -> clap::Command {
    Cli::command()
}

/// Runs a command line, program name first; prints what went wrong and gives the exit status: 0, or that of the error.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Vec<OsString> = args.into_iter().collect();
    let result = match Cli::try_parse_from(&args) {
        Ok(cli) => {
            log_to_stderr(cli.verbose);
            run(cli.command)
        }
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            print_result(&e.render())
        }
        Err(e) => Err(error::from_clap(&e, named_command(&args).as_deref())),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            say("error", &e);
            if let Some(hint) = &e.hint {
                say("hint", hint);
            }
            ExitCode::from(e.exit_status())
        }
    }
}

fn run(command: Command) -> Result<()> {
    match command {
        Command::Info(args) => info::run(&args),
        Command::Render(args) => render::run(args),
        Command::Probe(args) => probe::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Stability(args) => stability::run(&args),
        Command::Voxelise(args) => voxelise::run(&args),
        Command::Phantom(args) => phantom::run(&args.name, &args.output),
        Command::View(args) => view::run(*args),
    }
}

/// The command that a refused command line names, for the hint.
fn named_command(args: &[OsString]) -> Option<String> {
    let named = |a: &OsString| Cli::command().find_subcommand(a).map(|c| c.get_name().to_owned());
    args.iter().skip(1).find_map(named)
}

/// Prints a result to stdout. A reader that has gone away (`| head`) is no error.
///
/// # Errors
/// stdout cannot be written, e.g. because the disk is full.
pub fn print_result(text: &impl std::fmt::Display) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match write!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::runtime("cannot print result", "stdout", e))
        }
        _ => Ok(()),
    }
}

/// Prints `KIND: TEXT` to stderr, even where stderr is closed.
pub fn say(kind: &str, text: &impl std::fmt::Display) {
    // There is nowhere left to say that stderr is gone.
    let _ = writeln!(io::stderr(), "{kind}: {text}");
}

/// A volume, the transfer function in its units and the scene: what every drawing command starts from.
pub struct Loaded {
    pub volume: Volume,
    pub tf: TransferFunction,
    pub scene: Scene,
}

/// Reads what a request names, cheap things first, and says on stderr what was assumed.
///
/// # Errors
/// Whatever of it cannot be read or does not go together.
pub fn load(request: &SceneRequest) -> Result<Loaded> {
    let (loaded, remarks) = read(request)?;
    remarks.iter().for_each(|(kind, remark)| say(kind, remark));
    Ok(loaded)
}

/// What is said of an input, and as what: `note` or `warning`.
type Remark = (&'static str, String);

/// As [`load`], but hands over what there is to say.
///
/// # Errors
/// As there.
pub fn read(request: &SceneRequest) -> Result<(Loaded, Vec<Remark>)> {
    let found = request.tf.as_deref().map(presets::find).transpose()?;
    let volume = volume::load(&request.volume)?;
    let mut remarks: Vec<Remark> =
        volume.provenance.warnings.iter().map(|w| ("warning", w.clone())).collect();
    let found = match found {
        Some(found) => found,
        None => presets::find(presets::default_name(&volume))?,
    };
    let presets::ResolvedTransferFunction { tf, note } = found.suit(&volume);
    remarks.extend(note.map(|note| ("note", note)));
    let scene = request.resolve(&volume)?;
    Ok((Loaded { volume, tf, scene }, remarks))
}

/// Reads a volume and says its warnings on stderr.
///
/// # Errors
/// The volume cannot be read.
pub fn load_volume(spec: &volume::VolumeSpec) -> Result<Volume> {
    let volume = volume::load(spec)?;
    for warning in &volume.provenance.warnings {
        say("warning", warning);
    }
    Ok(volume)
}

fn log_to_stderr(verbose: u8) {
    // The GPU stack speaks at `warn` about things no user can act on.
    let filter = match verbose {
        0 => "error,umbravox=warn",
        1 => "warn,umbravox=info",
        2 => "info,umbravox=debug",
        _ => "trace",
    };
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::new(filter))
        .with_writer(io::stderr)
        .with_ansi(io::stderr().is_terminal())
        .with_target(verbose > 1)
        .without_time()
        .log_internal_errors(false);
    // Only a second call in one process can fail, and the first one's settings are as good.
    let _ = subscriber.try_init();
}

/// The long help of `--tf`: the presets.
fn tf_help() -> String {
    let mut help = String::from(
        "Transfer function: a preset, or the path of a .json file\n\
         [default: ct for a volume in HU with air, bone in HU without, hair for strands, engine otherwise]\n\n\
         A file is used as it is. A preset in HU is used as it is on a volume in HU (one whose values span more than \
         300 within -32768 to 32767); on any other, -1000 to 800 HU are laid over the value range. A preset in \
         fractions is laid over the value range of every volume. `hair` takes values as extinction in 1/mm.\n\nPresets:",
    );
    for preset in PRESETS {
        help += &format!("\n  {:<12} {}", preset.name, preset.about);
    }
    help
}

/// The long help of `--shadow`: the methods, their keys and every default.
fn shadow_help() -> String {
    let mut help =
        String::from("Shadow method and its settings, METHOD[:key=value,...] [default: dsm]\n\nMethods:");
    for method in METHODS {
        help += &format!("\n  {:<12} {}", method.name, method.summary);
        for key in method.keys {
            help += &format!("\n    {}={} [default: {}] {}", key.name, key.values, key.default, key.help);
        }
    }
    help
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_definitions_are_sound() {
        Cli::command().debug_assert();
    }
}
