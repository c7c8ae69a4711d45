//! `umbravox claims`: tests claims of the shadow methods' papers by measurement.

use super::console::{StepDisplay, load_scene};
use super::interrupt::Interrupt;
use super::measuring_bar::MeasuringBar;
use super::table_flags::{Earlier, TableFlags, archived, cannot_resume};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::gpu::Gpu;
use crate::measure::facts::Facts;
use crate::measure::job::{Checked, Effort};
use crate::measure::progress::Progress;
use crate::open::{SceneRequest, SceneSettings};
use crate::render::Renderer;
use crate::replication::claims::scenes::{STAND_INS, StandIn, Subject};
use crate::replication::claims::table::{TriedOn, counts, markdown};
use crate::replication::claims::verify::{comparable, compare};
use crate::replication::claims::{Claim, Row, all, find_paper, run as run_claims, scene_names, unrequested};
use crate::report::verify::Verified;
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Numbers of repeats, points, light rays and depths for testing claims of papers. They suffice for a verdict, yet
/// all claims take only minutes on two cores.
const EFFORT: Effort = Effort {
    repeats: 3,
    short_repeats: 0,
    points: 4000,
    rays: 500,
    depths: 100,
    check: Checked::Sample,
    flicker: 0,
};

/// Test claims of the shadow methods' papers by measurement: states each claim, the measured value, and whether the
/// claim holds
#[derive(Debug, Args)]
pub struct ClaimsArgs {
    #[command(flatten)]
    table: TableFlags,
    /// Test only claims of this paper, by an author's name: hadwiger, kim, yuksel, voicu, mertens, jansen, salvi, muenstermann; may be given several times
    #[arg(long = "paper", value_name = "NAME")]
    pub papers: Vec<String>,
    /// Test every claim on this scene instead of the built-in scenes; may be given several times
    #[arg(long, value_name = "FILE.toml")]
    pub scene: Vec<PathBuf>,
    /// Number of timed runs of each shadow method, after warm-up
    #[arg(long, value_name = "N", default_value_t = EFFORT.repeats as u32,
        value_parser = clap::value_parser!(u32).range(Effort::REPEATS))]
    pub repeats: u32,
}

/// Runs the `claims` command: tests claims of papers and writes a table of verdicts.
///
/// # Errors
/// Bad input, a failure of the device or disk, or an interruption. A claim that does not hold is not an error.
pub fn run(args: &ClaimsArgs) -> Result<()> {
    let mut claims = all()?;
    let papers = args.papers.iter().map(|name| find_paper(name, &claims)).collect::<Result<Vec<_>>>()?;
    claims.retain(|c: &Claim| papers.is_empty() || papers.contains(&c.paper));
    args.table.check("claims")?;
    let given = given_scenes(&args.scene)?;
    // Reads all scenes first, so that an error in the last file is found at once.
    for (name, settings) in &given {
        settings.one_light("claims").and_then(|()| settings.hard_lights("claims")).map_err(|e| e.at(name))?;
        settings.load(&Loading::default()).map_err(|e| e.at(name))?;
    }
    let renderer = args.table.open()?;
    let effort = Effort { repeats: args.repeats as usize, ..EFFORT };
    let conditions = Facts::of(renderer.gpu()).conditions();
    let made_by = format!("{conditions}; times are medians of {}.", effort.repeats);
    let names: Vec<String> = given.iter().map(|(name, _)| name.clone()).collect();
    let tried =
        scene_names(&claims, &names).iter().map(|n| tried_on(n, &given)).collect::<Result<Vec<_>>>()?;
    let earlier = args.table.earlier("claims", &made_by)?;
    check_earlier(&earlier, (&claims, &names), &tried)
        .map_err(|why| cannot_resume(args.table.output.join("claims.csv").display(), why))?;
    let bar = StepDisplay::new()?;
    let interrupt = Interrupt::between_steps("verdicts on finished scenes are written");
    let mut progress = Progress::watched(MeasuringBar { bar: &bar, interrupt: &interrupt });
    let mut read = |name: &str| subject(name, &given);
    let (rows, outcome) =
        run_claims(&renderer, &claims, &names, &earlier.rows, &mut read, effort, &mut progress);
    drop(progress);
    bar.finish_and_clear();
    let is_interrupted = outcome.as_ref().is_err_and(Error::is_cancelled);
    if !is_interrupted {
        outcome?;
    }
    args.table.write("claims", &rows, &markdown(&rows, &tried, &made_by), &counts(&rows))?;
    if is_interrupted { Err(interrupted(args, &claims, &names, &rows)) } else { Ok(()) }
}

/// Measures the claims of an archived table again, and compares what does not depend on times.
///
/// # Errors
/// The table cannot be read, has claims or scenes that are not built in, or the device fails.
pub fn verify(folder: &Path, adapter: Option<&str>, progress: &mut Progress) -> Result<Verified> {
    let renderer = Arc::new(Renderer::new(Gpu::open(adapter)?));
    let (earlier, by) = archived::<Row>(folder, "claims", &Facts::of(renderer.gpu()))?;
    let claims = all()?;
    let refuse = |why| Error::input("cannot verify", folder.join("claims.csv").display(), why);
    if let Some(row) = unrequested(&claims, &[], &earlier.rows) {
        let why = format!("this revision does not test \"{}\" on the scene `{}`", row.claim, row.scene);
        return Err(refuse(why));
    }
    let tried =
        scene_names(&claims, &[]).iter().map(|name| tried_on(name, &[])).collect::<Result<Vec<_>>>()?;
    // Without the page it is not known whether scenes have changed.
    let known = if earlier.page.is_empty() { &[] } else { &tried[..] };
    check_earlier(&earlier, (&claims, &[]), known).map_err(refuse)?;
    let recorded = earlier.rows;
    let claims = comparable(claims, &recorded);
    let effort = Effort { repeats: 1, ..EFFORT };
    let mut read = |name: &str| subject(name, &[]);
    let (measured, outcome) = run_claims(&renderer, &claims, &[], &[], &mut read, effort, progress);
    outcome?;
    Ok(compare(&claims, &recorded, &measured, by))
}

/// Loads the scene with this name: of a scene file on the command line, or a built-in one.
fn subject(name: &str, given: &[(String, SceneSettings)]) -> Result<Subject> {
    let loaded = load_scene(&settings_of(name, given)?)?;
    let subject = Subject { volume: loaded.volume, tf: loaded.tf, scene: loaded.scene };
    Ok(match stand_in(name, given) {
        Some(stand_in) => stand_in.of(subject),
        None => subject,
    })
}

/// Error that ends an interrupted test of claims: states on which scenes claims were tested, and which are missing.
fn interrupted(args: &ClaimsArgs, claims: &[Claim], given: &[String], rows: &[Row]) -> Error {
    let (done, missing): (Vec<_>, Vec<_>) =
        scene_names(claims, given).into_iter().partition(|name| has_rows(rows, name));
    let why = format!(
        "claims are tested on {} of {} scenes, and their rows are written; not on {}",
        done.len(),
        done.len() + missing.len(),
        missing.join(", ")
    );
    Error::runtime("interrupted", args.table.output.display(), why)
        .hint("the same command line with --resume tests them on the others")
}

/// Fails if an earlier table has a row that is not requested, or was measured on another scene of the same name.
fn check_earlier(
    earlier: &Earlier<Row>,
    (claims, given): (&[Claim], &[String]),
    tried: &[TriedOn],
) -> Result<(), String> {
    if let Some(Row { paper, place, scene, .. }) = unrequested(claims, given, &earlier.rows) {
        let on = if scene.is_empty() { String::new() } else { format!(" on {scene}") };
        return Err(format!("{place} of {paper}{on} is among its rows and not requested"));
    }
    let is_changed =
        |scene: &&TriedOn| has_rows(&earlier.rows, &scene.name) && !earlier.page.contains(&scene.markdown());
    match tried.iter().find(is_changed) {
        Some(scene) => Err(format!("the scene {} has changed", scene.name)),
        None => Ok(()),
    }
}

/// Whether a table has rows of the scene with this name. The column `scene` has the name, then the variant.
fn has_rows(rows: &[Row], name: &str) -> bool {
    rows.iter().any(|r| r.scene.split(" (").next() == Some(name))
}

/// Reads scene files and names each by its file name without extension. Fails if two names are equal.
fn given_scenes(paths: &[PathBuf]) -> Result<Vec<(String, SceneSettings)>> {
    let mut given: Vec<(String, SceneSettings)> = Vec::new();
    for path in paths {
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        if given.iter().any(|(other, _)| *other == name) {
            return Err(Error::input("bad command line", "--scene", format!("two scenes are named {name}")));
        }
        given.push((name, SceneRequest::read(Path::new(path))?.settings));
    }
    Ok(given)
}

/// Built-in test scene with this name; `None` if a scene file on the command line has the same name.
fn stand_in(name: &str, given: &[(String, SceneSettings)]) -> Option<&'static StandIn> {
    STAND_INS.iter().find(|s| s.name == name && given.iter().all(|(other, _)| other != name))
}

/// Returns the settings of the scene with this name: of a scene file on the command line, or of a built-in scene.
fn settings_of(name: &str, given: &[(String, SceneSettings)]) -> Result<SceneSettings> {
    if let Some((_, settings)) = given.iter().find(|(n, _)| n == name) {
        return Ok(settings.clone());
    }
    let unknown = || Error::runtime("cannot try claims", name, "there is no such scene");
    Ok(SceneRequest::from_toml(&STAND_INS.iter().find(|s| s.name == name).ok_or_else(unknown)?.toml)?
        .settings)
}

fn tried_on(name: &str, given: &[(String, SceneSettings)]) -> Result<TriedOn> {
    let about = |s: &StandIn| match s.extinction {
        1.0 => format!("stands in for {}.", s.about),
        factor => format!("stands in for {}; its extinction times {factor}.", s.about),
    };
    let about = stand_in(name, given).map_or("given with --scene.".to_owned(), about);
    Ok(TriedOn { name: name.into(), about, toml: settings_of(name, given)?.to_toml()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stand_in_is_a_scene_file() {
        for stand_in in STAND_INS.iter() {
            let settings = settings_of(&stand_in.name, &[]).unwrap();
            let again = SceneRequest::from_toml(&tried_on(&stand_in.name, &[]).unwrap().toml).unwrap();
            assert_eq!(settings, again.settings, "{}", stand_in.name);
            assert!(settings.size.is_some() && settings.light.is_some(), "{}", stand_in.name);
        }
        assert!(settings_of("no such scene", &[]).is_err());
    }
}
