//! `umbravox export`: writes one HTML file that draws a scene in a browser.

use super::console::{StepDisplay, load_scene, print_json, print_message};
use super::interrupt::Interrupt;
use super::measuring_bar::MeasuringBar;
use crate::error::{Error, Result};
use crate::files::input::source_name;
use crate::files::output::{check_output, write_whole};
use crate::gpu::{Gpu, Tuning};
use crate::measure::compare::{compare, steps};
use crate::measure::comparison::Compared;
use crate::measure::facts::REVISION;
use crate::measure::job::{Checked, Effort, Job};
use crate::measure::journal::Journal;
use crate::measure::progress::Progress;
use crate::open::{Loaded, SceneArgs, SceneRequest, SceneSettings};
use crate::page::{PageTexts, html, page_data};
use crate::render::{Renderer, Session};
use crate::report::make::scene_name;
use crate::scene::LightSource;
use crate::shadow::{Method, parse_distinct};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// Write one HTML file that draws the scene in a browser, offline, with the shaders of this program
#[derive(Debug, Args)]
pub struct ExportArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output page: .html
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Shadow methods of the page separated by `;`, each with settings such as dsm:map=256
    #[arg(long, value_name = "METHODS", default_value = "dsm;rays;avsm;osm;fourier;none")]
    pub methods: String,
    /// Put the voxels, labels and meshes of the scene's files into the page, where everybody who has the page can read
    /// them. Built-in phantoms do not need this flag
    #[arg(long)]
    pub embed_volume: bool,
}

/// Extent of the measurement of the errors that a page shows.
const EFFORT: Effort = Effort {
    repeats: 1,
    short_repeats: 0,
    points: 4000,
    rays: 200,
    depths: 50,
    check: Checked::Sample,
    flicker: 0,
};

/// Runs the `export` command: measures the errors of the methods, and writes the page.
///
/// # Errors
/// Bad input, a scan without `--embed-volume`, a failure of the device or disk, or an interruption.
pub fn run(args: ExportArgs) -> Result<()> {
    check_output(&args.output, &["html"])?;
    let mut methods: Vec<Box<dyn Method>> = Vec::new();
    for method in parse_distinct(&args.methods).map_err(|e| e.at("--methods"))? {
        let method = of_all_views(method)?;
        if methods.iter().all(|known| known.spec() != method.spec()) {
            methods.push(method);
        }
    }
    let SceneRequest { settings, run } = args.scene.into_request()?;
    if let Some(file) = embedded_file(&settings).filter(|_| !args.embed_volume) {
        return Err(Error::input("cannot write page", file, "the page would hold the data of this file").hint(
            "--embed-volume puts them into the page, for everybody who has it; --downsample makes it smaller",
        ));
    }
    let loaded = load_scene(&settings)?;
    let mut gpu = Gpu::open(run.adapter.as_deref())?;
    // Shaders of cards find the tiles of a picture on the device, and allow for coarse weights of the texture filter.
    gpu.tuning = Tuning::CARD;
    let renderer = Arc::new(Renderer::new(gpu));
    let session =
        Session::on(&renderer, Arc::clone(&loaded.volume), &loaded.tf, settings.disabled_optimizations())?
            .with_strands(loaded.strands.clone());
    let rows = measured(&session, &methods, &loaded)?;
    let data = page_data(&session, &methods, &loaded.scene)?;
    let page = html(&texts(&settings, &loaded), &rows, &data)?;
    write_whole(&args.output, |file| file.write_all(page.as_bytes()))?;
    if run.explain {
        rows.iter().flat_map(|row| &row.left_out).for_each(|omission| print_message("plan", omission));
    }
    let summary = Summary { page: args.output.display().to_string(), bytes: page.len() };
    if run.json {
        return print_json(&summary);
    }
    print_message("page", &format_args!("{}, {:.1} MB", summary.page, summary.bytes as f64 * 1e-6));
    Ok(())
}

/// Output of `export --json`.
#[derive(Debug, Serialize)]
struct Summary {
    page: String,
    bytes: usize,
}

/// Returns the first file of a scene whose data a page would hold: volume, segmentation, mesh or strands.
fn embedded_file(settings: &SceneSettings) -> Option<&str> {
    let opaque = [&settings.opaque.mesh, &settings.opaque.strands].into_iter().flatten().flatten();
    let files = settings.volume.iter().chain(&settings.masking.labels).chain(opaque.map(|file| &file.source));
    files.map(String::as_str).find(|source| !source.starts_with("phantom:"))
}

/// Returns a method whose shadow maps are valid in all views, since the camera of a page moves.
fn of_all_views(method: Box<dyn Method>) -> Result<Box<dyn Method>> {
    method.spec().with("fit", "volume").map_or(Ok(method), |spec| spec.method())
}

/// Measures the errors of the methods of a page, and draws their pictures.
fn measured(session: &Session, methods: &[Box<dyn Method>], loaded: &Loaded) -> Result<Vec<Compared>> {
    let Loaded { volume, tf, scene, strands, .. } = loaded;
    let name = scene_name(volume, tf);
    let strands = strands.as_deref().map(|of| &of.strands);
    let job = Job { strands, ..Job::new(session, (volume, tf), scene, &name, EFFORT) };
    let bar = StepDisplay::new()?;
    let interrupt = Interrupt::between_steps("no page is written");
    let mut progress = Progress::watched(MeasuringBar { bar: &bar, interrupt: &interrupt });
    for (step, times) in steps(methods, &EFFORT) {
        progress.expect(step, times);
    }
    let compared = compare(&job, methods, &mut Journal::nowhere(), &mut progress);
    drop(progress);
    bar.finish_and_clear();
    let compared = compared?;
    match compared.failures.into_iter().next() {
        Some((name, error)) => Err(error.at(name)),
        None => Ok(compared.compared),
    }
}

/// Returns heading and facts of a page.
fn texts(settings: &SceneSettings, loaded: &Loaded) -> PageTexts {
    let Loaded { volume, tf, tf_source, scene, .. } = loaded;
    let [x, y, z] = volume.dims();
    let lights = scene.lights.iter().map(LightSource::text).collect::<Vec<_>>().join("; ");
    // A page does not tell the folders of its author.
    let name_of = |source: &str| source_name(source).to_owned();
    let facts = [
        ("volume", format!("{}, {x} x {y} x {z} voxels", name_of(&volume.provenance.source))),
        ("transfer function", format!("{} ({})", tf.name, name_of(tf_source))),
        ("lights", lights),
        ("ambient light", scene.ambient.to_string()),
        ("picture", format!("{} x {} pixels, eye step {} voxels", scene.width, scene.height, scene.step)),
        ("revision", REVISION.to_owned()),
    ];
    PageTexts {
        title: settings.name.clone().unwrap_or_else(|| scene_name(volume, tf)),
        facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
    }
}
