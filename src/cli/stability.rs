//! `umbravox stability`: tests every shadow method for numerical faults on extreme and ill-conditioned cases.

use super::console::StepDisplay;
use super::interrupt::Interrupt;
use super::measuring_bar::MeasuringBar;
use super::table_flags::{TableFlags, archived, cannot_resume};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::measure::facts::Facts;
use crate::measure::progress::Progress;
use crate::render::Renderer;
use crate::replication::stability::table::{compare, counted, finished, markdown};
use crate::replication::stability::{Case, Row, Status, all, measured_again, planned, run as run_cases};
use crate::report::verify::Verified;
use crate::shadow::{MethodSpec, STABILITY};
use clap::Args;
use std::path::Path;
use std::sync::Arc;

/// Test every shadow method for numerical faults on extreme and ill-conditioned cases; exit status 1 if one has a fault
#[derive(Debug, Args)]
pub struct StabilityArgs {
    #[command(flatten)]
    table: TableFlags,
    /// Shadow methods separated by `;`, each with settings such as dsm:map=256,512. Several values of a setting give
    /// several table rows, one per combination
    #[arg(long, value_name = "METHODS", default_value_t = STABILITY.clone())]
    pub methods: String,
    /// Names of the test cases, separated by commas [default: all]
    #[arg(long = "case", value_name = "NAME", value_delimiter = ',')]
    pub cases: Vec<String>,
}

/// Runs the `stability` command: tests shadow methods for numerical faults and writes a table of results.
///
/// # Errors
/// Bad input, a failure of the disk, an interruption, or (after everything is written) a failed check.
pub fn run(args: &StabilityArgs) -> Result<()> {
    // Bad methods, unknown cases and a folder that is a file are rejected before any work is done.
    let methods = MethodSpec::parse_list(&args.methods).map_err(|e| e.at("--methods"))?;
    let every = all()?;
    let cases = pick(&every, &args.cases)?;
    args.table.check("stability")?;
    let planned = cases.iter().map(|case| planned(&methods, case)).collect::<Result<Vec<_>>>()?;
    let renderer = args.table.open()?;
    let facts = Facts::of(renderer.gpu());
    let conditions = facts.conditions() + ".";
    let earlier = args.table.earlier("stability", &conditions)?;
    let refuse = |why| cannot_resume(args.table.output.join("stability.csv").display(), why);
    let finished = finished(&planned, &earlier.rows).map_err(refuse)?;
    let bar = StepDisplay::new()?;
    let interrupt = Interrupt::between_steps("rows of finished cases are written");
    let mut progress = Progress::watched(MeasuringBar { bar: &bar, interrupt: &interrupt });
    let (rows, outcome) = run_cases(&renderer, &methods, &cases, finished, &mut progress);
    drop(progress);
    bar.finish_and_clear();
    let is_interrupted = outcome.as_ref().is_err_and(Error::is_cancelled);
    if !is_interrupted {
        outcome?;
    } else if rows.is_empty() {
        return Err(Error::runtime("interrupted", args.table.output.display(), "no case is finished"));
    }
    let summary = markdown(&rows);
    args.table.write(
        "stability",
        &rows,
        &format!("# Stability on {}\n{conditions}\n\n{summary}", facts.adapter),
        &summary,
    )?;
    if is_interrupted {
        return Err(interrupted(args, &planned, &rows));
    }
    verdict(&rows, &args.table.output.join("stability.csv").display())
}

/// Measures the rows of an archived table again, and compares what does not depend on times.
///
/// # Errors
/// The table cannot be read, has unknown cases or settings, or the device fails.
pub fn verify(folder: &Path, adapter: Option<&str>, progress: &mut Progress) -> Result<Verified> {
    let renderer = Arc::new(Renderer::new(Gpu::open(adapter)?));
    let (recorded, by) = archived::<Row>(folder, "stability", &Facts::of(renderer.gpu()))?;
    let measured = measured_again(&recorded.rows, &renderer, progress)
        .map_err(|e| e.at(folder.join("stability.csv").display()))?;
    Ok(compare(&recorded.rows, &measured, by))
}

/// Error that ends an interrupted stability test: states how many cases are in the table, and which are missing.
fn interrupted(args: &StabilityArgs, planned: &[Vec<Row>], rows: &[Row]) -> Error {
    // A case that applies to no method has no rows.
    let cases = planned.iter().filter_map(|rows| Some(rows.first()?.case.as_str()));
    let (done, missing): (Vec<_>, Vec<_>) = cases.partition(|case| rows.iter().any(|row| row.case == *case));
    let all = done.len() + missing.len();
    let why = format!("{} of {all} cases are tested, and their rows are written", done.len());
    Error::runtime("interrupted", args.table.output.display(), why)
        .hint(format!("the same command line with --resume tests the others: {}", missing.join(", ")))
}

/// Selects cases of the stability test by name, in the order of the full list of cases. Selects all if no name is
/// given.
fn pick<'a>(every: &'a [Case], names: &[String]) -> Result<Vec<&'a Case>> {
    if let Some(unknown) = names.iter().find(|n| !every.iter().any(|c| c.name == **n)) {
        let known: Vec<_> = every.iter().map(|c| c.name.as_str()).collect();
        let why = format!("there is: {}", known.join(", "));
        return Err(Error::input("unknown case", format!("--case {unknown}"), why));
    }
    Ok(every.iter().filter(|c| names.is_empty() || names.contains(&c.name)).collect())
}

/// Fails if a row of the stability table reports a numerical fault.
fn verdict(rows: &[Row], place: &dyn std::fmt::Display) -> Result<()> {
    if rows.iter().all(|r| r.status == Status::Ok) {
        return Ok(());
    }
    Err(Error::runtime("stability checks failed", place, counted(rows)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_row_that_is_not_well_makes_the_verdict() {
        let row = |status| Row { status, ..Row::default() };
        assert!(verdict(&[row(Status::Ok), row(Status::Ok)], &"x").is_ok());
        for status in Status::ALL.into_iter().filter(|s| *s != Status::Ok) {
            let error = verdict(&[row(Status::Ok), row(status)], &"x").unwrap_err();
            assert_eq!(error.exit_status(), 1);
            assert!(error.why.contains(status.name()), "{error}");
        }
    }

    #[test]
    fn cases_are_picked_by_name() {
        let every = all().unwrap();
        assert_eq!(pick(&every, &[]).unwrap().len(), every.len());
        let picked = pick(&every, &["nan".into(), "comb".into()]).unwrap();
        assert_eq!(picked.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["comb", "nan"]);
        assert_eq!(pick(&every, &["combs".into()]).err().unwrap().exit_status(), 2);
    }
}
