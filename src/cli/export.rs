//! `umbravox export`: writes one HTML file that draws a scene in a browser, or a scene for Mitsuba 3.

use super::console::{StepDisplay, load_scene, print_json, print_message};
use super::interrupt::Interrupt;
use super::measuring_bar::MeasuringBar;
use crate::error::{Error, Result};
use crate::files::input::source_name;
use crate::files::output::{check_output_or_stdout, write_whole};
use crate::gpu::Tuning;
use crate::measure::comparison::Compared;
use crate::measure::facts::REVISION;
use crate::measure::job::{Effort, Job};
use crate::measure::picture_errors::picture_errors;
use crate::measure::progress::Progress;
use crate::open::{Loaded, RunFlags, SceneArgs, SceneRequest, SceneSettings};
use crate::page::{PageTexts, html, page_data, page_optimizations};
use crate::render::{DisabledOptimizations, Renderer, Session};
use crate::report::make::scene_name;
use crate::report::mitsuba::{GridError, SCENE_FILE, write_mitsuba};
use crate::scene::LightSource;
use crate::shadow::{Method, parse_distinct};
use crate::transfer::GradientOpacity;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Write one HTML file that draws the scene in a browser, offline, with the shaders of this program; or the scene for Mitsuba
#[derive(Debug, Args)]
pub struct ExportArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output page: .html, or `-` for standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Instead of a page, write scene.xml, extinction.vol and albedo.vol for the renderer Mitsuba 3 into a new folder
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["output", "methods", "embed_volume"])]
    pub mitsuba: Option<PathBuf>,
    /// Grid points of --mitsuba for each voxel along each axis, for functions that are not linear in the value
    #[arg(long, value_name = "N", default_value_t = 1, requires = "mitsuba", conflicts_with = "output", value_parser = clap::value_parser!(u8).range(1..=8))]
    pub supersample: u8,
    /// Shadow methods of the page separated by `;`, each with settings such as dsm:map=256
    #[arg(long, value_name = "METHODS", default_value = "dsm;rays;avsm;osm;fourier;none")]
    pub methods: String,
    /// Put the voxels, labels and meshes of the scene's files into the page, where everybody who has the page can read
    /// them. Built-in phantoms do not need this flag
    #[arg(long)]
    pub embed_volume: bool,
}

/// Number of visible points at which the errors of a page are measured.
const POINTS: usize = 2000;

/// Runs the `export` command: measures the errors of the methods, and writes the page.
///
/// # Errors
/// Bad input, a scan without `--embed-volume`, a failure of the device or disk, or an interruption.
pub fn run(args: ExportArgs) -> Result<()> {
    if let Some(folder) = &args.mitsuba {
        return mitsuba(args.scene, folder, args.supersample);
    }
    let Some(output) = args.output else {
        return Err(Error::input("bad command line", "export", "expected -o page.html or --mitsuba FOLDER"));
    };
    let methods = page_methods(parse_distinct(&args.methods).map_err(|e| e.at("--methods"))?)?;
    let SceneRequest { settings, run } = args.scene.into_request()?;
    check_output_or_stdout(&output, &["html"], run.json)?;
    check_page(&settings, args.embed_volume)?;
    let loaded = load_scene(&settings)?;
    let Page { html: page, rows } = scene_page(&settings, &loaded, &methods, &run)?;
    write_whole(&output, |file| file.write_all(page.as_bytes()))?;
    if run.explain {
        rows.iter().flat_map(|row| &row.left_out).for_each(|omission| print_message("plan", omission));
    }
    let summary = Summary { page: output.display().to_string(), bytes: page.len() };
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

/// Writes a scene for Mitsuba into a folder.
fn mitsuba(scene: SceneArgs, folder: &Path, supersample: u8) -> Result<()> {
    let SceneRequest { settings, run } = scene.into_request()?;
    if folder.join(SCENE_FILE).exists() {
        let why = format!("it holds {SCENE_FILE} already");
        return Err(Error::input("cannot write scene", folder.display(), why).hint("give another folder"));
    }
    let loaded = load_scene(&settings)?;
    let Loaded { volume, tf, scene, .. } = &loaded;
    let error = write_mitsuba(folder, volume, tf, scene, supersample.into())?;
    if run.json {
        return print_json(&error);
    }
    let GridError { max_per_mm, largest_extinction_per_mm } = error;
    print_message(
        "scene",
        &format_args!(
            "{}; the extinction of its grid is off by at most {max_per_mm:.1e}/mm at random points, where the largest is \
            {largest_extinction_per_mm:.3}/mm",
            folder.join(SCENE_FILE).display()
        ),
    );
    Ok(())
}

/// Page of a scene.
pub struct Page {
    /// Text of the HTML file.
    pub html: String,
    /// Methods of the page with their errors and pictures.
    pub rows: Vec<Compared>,
}

/// Measures the errors of methods from [`page_methods`], and returns the page of a scene.
///
/// # Errors
/// There is a gradient opacity, the device cannot hold the scene or a shadow map, the page is too large, or the user
/// interrupted it.
pub fn scene_page(
    settings: &SceneSettings,
    loaded: &Loaded,
    methods: &[Box<dyn Method>],
    run: &RunFlags,
) -> Result<Page> {
    check_page_function(loaded.tf.gradient_opacity.as_ref())?;
    let session = |tuning: Option<Tuning>, disabled: DisabledOptimizations| {
        let mut gpu = run.gpu()?;
        gpu.tuning = tuning.unwrap_or(gpu.tuning);
        let renderer = Arc::new(Renderer::new(gpu));
        let session = Session::on(&renderer, Arc::clone(&loaded.volume), &loaded.tf, disabled)?;
        Ok(session.with_strands(loaded.strands.clone()))
    };
    let disabled = settings.disabled_optimizations();
    let rows = measured(&session(None, disabled)?, methods, loaded)?;
    // Shaders of cards find the tiles of a picture on the device, and allow for coarse weights of the texture filter.
    let session = session(Some(Tuning::CARD), page_optimizations(disabled))?;
    let data = page_data(&session, methods, &loaded.scene)?;
    Ok(Page { html: html(&texts(settings, loaded), &rows, &data)?, rows })
}

/// Fails if a page of the scene would hold the data of a file (volume, segmentation, mesh or strands), unless that is
/// allowed, or if it cannot show the scene.
///
/// # Errors
/// The scene reads a file, and `is_allowed` is false; a light has a size; or the scene has ambient occlusion or a gradient
/// opacity.
pub fn check_page(settings: &SceneSettings, is_allowed: bool) -> Result<()> {
    settings.hard_lights("page")?;
    settings.open_ambient("page")?;
    check_page_function(settings.gradient_opacity.as_ref())?;
    let opaque = [&settings.opaque.mesh, &settings.opaque.strands].into_iter().flatten().flatten();
    let files = settings.volume.iter().chain(&settings.masking.labels).chain(opaque.map(|file| &file.source));
    match files.map(String::as_str).find(|source| !source.starts_with("phantom:")) {
        Some(file) if !is_allowed => Err(Error::input(
            "cannot write page",
            file,
            "the page would hold the data of this file",
        )
        .hint(
            "--embed-volume puts them into the page, for everybody who has it; --downsample makes it smaller",
        )),
        _ => Ok(()),
    }
}

/// Fails if extinction depends on the gradient magnitude, which pages do not show.
fn check_page_function(opacity: Option<&GradientOpacity>) -> Result<()> {
    match opacity.filter(|opacity| !opacity.is_one()) {
        Some(_) => {
            let why = "pages show no gradient opacity";
            Err(Error::input("cannot write page", "--gradient-opacity", why).hint("--gradient-opacity none"))
        }
        None => Ok(()),
    }
}

/// Returns methods whose shadow maps are valid in all views, since the camera of a page moves. Each is returned once.
///
/// # Errors
/// A setting of a method excludes `fit=volume`, or a method draws section by section.
pub fn page_methods(methods: Vec<Box<dyn Method>>) -> Result<Vec<Box<dyn Method>>> {
    let mut distinct: Vec<Box<dyn Method>> = Vec::new();
    for method in methods {
        if method.lookup().is_some_and(|lookup| lookup.has_sections()) {
            let why = "it has no map: its light buffers are advanced while the picture is drawn";
            return Err(Error::input("cannot write page", method.name(), why));
        }
        let method = method.spec().with("fit", "volume").map_or(Ok(method), |spec| spec.method())?;
        if distinct.iter().all(|known| known.spec() != method.spec()) {
            distinct.push(method);
        }
    }
    Ok(distinct)
}

/// Measures the errors of the methods of a page, and draws their pictures.
fn measured(session: &Session, methods: &[Box<dyn Method>], loaded: &Loaded) -> Result<Vec<Compared>> {
    let Loaded { volume, tf, scene, strands, .. } = loaded;
    let name = scene_name(volume, tf);
    let strands = strands.as_deref().map(|of| &of.strands);
    let effort = Effort { points: POINTS, ..Effort::default() };
    let job = Job { strands, ..Job::new(session, (volume, tf), scene, &name, effort) };
    let bar = StepDisplay::new()?;
    let interrupt = Interrupt::between_steps("no page is written");
    let mut progress = Progress::watched(MeasuringBar { bar: &bar, interrupt: &interrupt });
    let rows = picture_errors(&job, methods, &mut progress);
    drop(progress);
    bar.finish_and_clear();
    rows
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
