//! `umbravox tf`: lists and exports transfer-function presets, and converts transfer functions of other programs.

use super::console::{print_json, print_message, print_result};
use crate::error::{Error, Result};
use crate::files::output::{check_output_or_stdout, write_whole};
use crate::open::presets::{self, PRESETS, Scale};
use crate::open::user_presets::{UserPreset, names, path_of, user_presets};
use crate::transfer::TransferFunction;
use crate::transfer::formats::{self, Imported, TRANSFER_FORMATS, TransferFormat, has_fractions};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// List transfer-function presets, and convert transfer functions of other programs
#[derive(Debug, Args)]
#[command(arg_required_else_help = false, after_help = USE_OF_PRESETS)]
pub struct TfArgs {
    #[command(subcommand)]
    command: TfCommand,
}

/// Adaptation of presets and files to a volume.
const USE_OF_PRESETS: &str = "\
A file is used unchanged, unless its units are `fraction`. A preset in HU is used unchanged on a volume in HU (`umbravox info` says \
which and why, --units decides); on any other, -1000 to 800 HU are scaled to the value range. Fractions are scaled to the value range \
of every volume. `hair` takes values as extinction in 1/mm. Presets are denser or thinner in volumes far from the size of a body; \
--opacity-scale 1 undoes it.";

#[derive(Debug, Subcommand)]
enum TfCommand {
    /// List the transfer-function presets
    List(ListArgs),
    /// Write a transfer-function preset to a file
    Export(ExportArgs),
    /// Convert a transfer function from or to the format of another program
    #[command(long_about = convert_help())]
    Convert(ConvertArgs),
}

#[derive(Debug, Args)]
struct ListArgs {
    /// Print the presets as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct ExportArgs {
    /// Name of the preset, from `umbravox tf list`
    #[arg(value_name = "PRESET")]
    preset: String,
    #[command(flatten)]
    to: Target,
}

#[derive(Debug, Args)]
struct ConvertArgs {
    /// Transfer-function file: this program's .json, ParaView's .json, 3D Slicer's .vp and .vp.json, MRIcroGL's and
    /// NiiVue's .json, Inviwo's .itf; the content decides the format. `-` is standard input
    #[arg(value_name = "IN")]
    input: PathBuf,
    #[command(flatten)]
    to: Target,
}

/// Output file and format of a transfer function.
#[derive(Debug, Args)]
struct Target {
    /// Output file of the transfer function: .json, or .vp; `-` for standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Format of the output file [default: vp where its name ends in .vp, umbravox otherwise]
    #[arg(long, value_name = "FORMAT", value_parser = written_format())]
    to: Option<&'static TransferFormat>,
    /// Map a transfer function over fractions of the value range to scalar values: fraction 0 to LO, fraction 1 to HI
    #[arg(long, value_name = "LO,HI", value_parser = range, allow_hyphen_values = true)]
    range: Option<[f64; 2]>,
    /// Print file name, formats, units and warnings of the written transfer function as JSON
    #[arg(long)]
    json: bool,
}

/// Command-line parser for the name of a transfer-function format that can be written.
fn written_format() -> impl TypedValueParser<Value = &'static TransferFormat> {
    let written = TRANSFER_FORMATS.iter().filter(|f| f.write.is_some()).map(|f| f.name);
    PossibleValuesParser::new(written).try_map(|name| format_named(&name).ok_or("no such format"))
}

fn format_named(name: &str) -> Option<&'static TransferFormat> {
    TRANSFER_FORMATS.iter().find(|f| f.name == name)
}

fn convert_help() -> String {
    let mut help = String::from(
        "Convert a transfer function from or to the format of another program. A warning states each \
         property that the format cannot hold.\n\nFormats:",
    );
    for format in TRANSFER_FORMATS {
        let written = if format.write.is_some() { "read and written" } else { "read" };
        help += &format!("\n  {:<9} .{:<8} {} ({written})", format.name, format.ending, format.about);
    }
    help
}

/// Parses the value of `--range`: two numbers `LO,HI`, the second greater than the first.
fn range(text: &str) -> Result<[f64; 2], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    match numbers[..] {
        [low, high] if low < high && [low, high].iter().all(|x| x.abs() <= 1e30) => Ok([low, high]),
        _ => Err("expected two numbers LO,HI, the second greater".into()),
    }
}

/// Transfer-function preset in the output of `tf list --json`.
#[derive(Serialize)]
struct Listed {
    name: String,
    /// Units of the preset's scalar values: `HU`, `fraction` or `1/mm`, or as the user's file states them.
    units: String,
    about: String,
    points: usize,
    /// Whether a gradient opacity multiplies the extinction.
    gradient_opacity: bool,
    reference_length_mm: f64,
    /// File of a preset of the user.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
}

impl Listed {
    fn of_user(name: String, path: &Path, tf: TransferFunction) -> Self {
        let TransferFunction { reference_length_mm, points, units, name: about, gradient_opacity, .. } = tf;
        let (file, points) = (Some(path.display().to_string()), points.len());
        Self {
            name,
            units,
            about,
            points,
            gradient_opacity: gradient_opacity.is_some(),
            reference_length_mm,
            file,
        }
    }
}

/// Output of `tf export --json` and `tf convert --json` about a transfer function that was written to a file.
#[derive(Serialize)]
struct Converted<'a> {
    output: String,
    from: &'static str,
    to: &'static str,
    name: &'a str,
    units: &'a str,
    points: usize,
    gradient_opacity: bool,
    warnings: &'a [String],
}

/// Runs the `tf` command: lists, exports or converts transfer functions.
///
/// # Errors
/// Bad input, or a file that cannot be written.
pub fn run(args: TfArgs) -> Result<()> {
    match args.command {
        TfCommand::List(args) => list(args.json),
        TfCommand::Export(args) => {
            let is_built_in = PRESETS.iter().any(|preset| preset.name == args.preset);
            if !is_built_in && path_of(&args.preset).is_none() {
                return Err(Error::input("unknown preset", &args.preset, "there is none of that name")
                    .hint(format!("presets: {}; `tf convert` takes files", names())));
            }
            let (tf, warnings) = presets::find(&args.preset)?.as_it_is();
            write(Imported { tf, warnings, format: "preset" }, &args.to)
        }
        TfCommand::Convert(args) => {
            let to = target(&args.to)?;
            check(&args.to, to)?;
            write(formats::read(&args.input)?, &args.to)
        }
    }
}

fn list(json: bool) -> Result<()> {
    let built_in = PRESETS.iter().map(|preset| {
        let tf = preset.transfer_function();
        let units = match preset.scale {
            Scale::Hounsfield => "HU",
            Scale::Fraction => formats::FRACTION,
            Scale::Extinction => "1/mm",
        };
        let TransferFunction { reference_length_mm, points, gradient_opacity, .. } = tf;
        let (name, units, about) = (preset.name.into(), units.into(), preset.about.into());
        let (points, gradient_opacity) = (points.len(), gradient_opacity.is_some());
        Listed { name, units, about, points, gradient_opacity, reference_length_mm, file: None }
    });
    let mut listed: Vec<Listed> = built_in.collect();
    for UserPreset { name, path } in user_presets() {
        match formats::read(&path) {
            Ok(Imported { tf, .. }) => listed.push(Listed::of_user(name, &path, tf)),
            Err(error) => print_message("warning", &error),
        }
    }
    if json {
        return print_json(&listed);
    }
    let lines = listed.iter().map(|p| {
        let gradient = if p.gradient_opacity { "; with gradient opacity" } else { "" };
        format!("{:<12} {:<9} {}{gradient}\n", p.name, p.units, p.about)
    });
    print_result(&lines.collect::<String>())
}

/// Output format of a transfer function: given by `--to`, or implied by the extension of the output file.
fn target(target: &Target) -> Result<&'static TransferFormat> {
    let name = target.output.to_string_lossy().to_ascii_lowercase();
    let refuse = |why| Error::input("cannot write file", target.output.display(), why);
    if name.ends_with(".vp.json") && target.to.is_none() {
        return Err(refuse("3D Slicer's .vp.json is read and not written")
            .hint("give a name that ends in .vp, or say --to umbravox"));
    }
    let by_name = || format_named(if name.ends_with(".vp") { "vp" } else { "umbravox" });
    target.to.or_else(by_name).ok_or_else(|| refuse("there is no such format"))
}

fn check(target: &Target, format: &TransferFormat) -> Result<()> {
    let endings: &[&str] = if format.name == "vp" { &["vp"] } else { &["json"] };
    check_output_or_stdout(&target.output, endings, target.json)
}

/// Writes a transfer function to a file, with a warning for each property that the file format cannot store.
fn write(carried: Imported, to: &Target) -> Result<()> {
    let format = target(to)?;
    check(to, format)?;
    let Imported { mut tf, mut warnings, format: from } = carried;
    if let Some([low, high]) = to.range {
        if !has_fractions(&tf) {
            let why = format!("the units of `{}` are `{}`, not `{}`", tf.name, tf.units, formats::FRACTION);
            return Err(Error::input("cannot use flag", "--range", why));
        }
        tf = tf.scale_values(|v| low + v * (high - low));
        tf.units.clear();
    }
    let refuse = |why: String| Error::input("cannot write file", to.output.display(), why);
    let write = format.write.ok_or_else(|| refuse(format!("{} is not written", format.name)))?;
    let written = write(&tf).map_err(refuse)?;
    warnings.extend(written.warnings);
    warnings.iter().for_each(|warning| print_message("warning", warning));
    write_whole(&to.output, |file| file.write_all(written.text.as_bytes()))?;
    if !to.json {
        return Ok(());
    }
    print_json(&Converted {
        output: to.output.display().to_string(),
        from,
        to: format.name,
        name: &tf.name,
        units: &tf.units,
        points: tf.points.len(),
        gradient_opacity: tf.gradient_opacity.is_some(),
        warnings: &warnings,
    })
}
