//! `umbravox render`: renders one picture, or those of a rotation of the camera or the lights, or of a time series.

use super::console::{load_scene, print_json, print_message};
use super::frames::{FrameFlags, FramePlan, FrameRecord, FrameWriter, Frames, Position, Texts};
use super::render_progress::RenderProgress;
use crate::engine::{Building, CachedSession, MapCoverage, Prepared, ReusePolicy, ShadowCache, Work};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::field::{PageUsage, StreamUsage};
use crate::files::animation::is_animation;
use crate::files::loading::Loading;
use crate::files::output::{check_output, check_output_or_stdout, extension_or_first, write_whole};
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS, rgb_png, write_picture, write_picture_with};
use crate::gpu::Clock;
use crate::measure::certified::{self, Certificate, CertifiedPicture, CertifiedScene};
use crate::measure::mean_error::{MEAN_ERROR_POINTS, MeanError, MeanErrorSample};
use crate::open::provenance::picture_texts;
use crate::open::{Diagnostic, Level, Loaded, RunFlags, SceneArgs, SceneRequest, SceneSettings, values};
use crate::render::{Omission, Picture, Renderer};
use crate::report::annotate::annotated;
use crate::scene::{LightSource, Scene};
use crate::shadow::{Bound, BuildReport, Method, MethodSpec, ShadowMap, mapped_lights};
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::{ReadUsage, Volume};
use clap::Args;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Draw one picture, or those of a camera rotation (turntable), a light rotation (light sweep) or a time series
#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub frames: FrameFlags,
    /// Output picture: .png (8-bit sRGB, with the scene as text), .exr or .npy (float32, height x width x 4, linear RGB and
    /// opacity). With --background none, .png has straight alpha, the others premultiplied colours. Several pictures are
    /// frame_0000.png and so on for frame.png, or one animated .apng or .gif file. `-` writes PNG to standard output, one
    /// picture after another
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Mark the picture (.png): directions of the patient, a scale bar in mm at the camera's target, and the colours of
    /// the transfer function
    #[arg(long, conflicts_with_all = ["turntable", "light_sweep", "frames"])]
    pub annotate: bool,
    /// Print an upper bound, at 99 % confidence, on the mean error of the picture's shadows, and an estimate of that
    /// error: from the exact transmittance at 10,000 random points
    #[arg(long, conflicts_with_all = ["turntable", "light_sweep", "frames"])]
    pub error_bound: bool,
    /// Draw a picture with an estimated bound on the error of every pixel (docs/render.md): with `dsm:enclose=on`, and shadow
    /// rays where its bounds on a transmittance are wider than ETA
    #[arg(long, value_name = "ETA", value_parser = values::within(0.0..=1.0),
        conflicts_with_all = ["turntable", "light_sweep", "frames", "error_bound"])]
    pub certify: Option<f64>,
    /// With --certify: picture of the error bound of every pixel: .exr or .npy (linear, in all channels), or .png
    #[arg(long, value_name = "FILE", requires = "certify")]
    pub error_picture: Option<PathBuf>,
}

/// Runs the `render` command: renders one picture, or the pictures of a rotation, and writes them to files.
///
/// # Errors
/// Bad input, a failure of the device or disk, or an interruption between two pictures.
pub fn run(args: RenderArgs) -> Result<()> {
    let SceneRequest { mut settings, run } = args.scene.clone().into_request()?;
    let mut plan = args.frames.plan(&args.output, run.json)?;
    if plan.is_none() {
        let hint = "--turntable and --light-sweep make one animated file";
        let animated = is_animation(&args.output);
        check_output_or_stdout(&args.output, PICTURE_EXTENSIONS, run.json)
            .map_err(|e| if animated { e.hint(hint) } else { e })?;
    }
    check_error_picture(&args)?;
    if let Some(range) = args.frames.frames {
        settings.read_flags.frame = Some(range.first());
    }
    let spec = match args.certify {
        None => settings.method_spec(),
        Some(_) => settings.method_spec().enclosing().map_err(|e| e.at("--shadow"))?,
    };
    let method = spec.method()?;
    let backdrop = if settings.is_transparent() { Backdrop::LeftOut } else { Backdrop::Drawn };
    plan.iter().try_for_each(|plan| plan.check(backdrop))?;
    if args.annotate
        && (backdrop == Backdrop::LeftOut || extension_or_first(&args.output, PICTURE_EXTENSIONS)? != "png")
    {
        let why = "marks are drawn over the background of a .png file";
        return Err(Error::input("bad command line", "--annotate", why));
    }
    let loaded = load_scene(&settings)?;
    plan.iter_mut().try_for_each(|plan| plan.set_file_frames(loaded.volume.provenance.frames))?;
    if args.certify.is_some() {
        certified::check(&loaded.scene)?;
    }
    let renderer = Arc::new(Renderer::new(run.gpu()?));
    let adapter = renderer.gpu().info.name.clone();
    // A shadow map is reused only if a new one would be identical, so each picture equals one rendered alone.
    let cache = ShadowCache::new(1, ReusePolicy::Exact);
    let mut session = CachedSession::new(renderer, settings.disabled_optimizations(), cache);
    session.load(Arc::clone(&loaded.volume), loaded.strands.clone())?;
    session.set_transfer(&loaded.tf, &mut Work::default())?;
    let progress = RenderProgress::new(plan.as_ref().map_or(1, FramePlan::count))?;
    let job =
        RenderJob { args: &args, settings: &settings, spec, method, backdrop, loaded, adapter, progress };
    let summary = match &plan {
        None => job.draw_one(&mut session),
        Some(plan) => job.draw_several(&mut session, plan),
    };
    job.progress.finish_and_clear();
    summary?.report(&run)
}

/// Pictures to render, with everything that is the same for all of them.
struct RenderJob<'a> {
    args: &'a RenderArgs,
    settings: &'a SceneSettings,
    spec: MethodSpec,
    method: Box<dyn Method>,
    backdrop: Backdrop,
    loaded: Loaded,
    adapter: String,
    progress: RenderProgress,
}

impl RenderJob<'_> {
    /// Returns the texts in a picture's file. `position` is its place among several.
    fn texts(&self, scene: &Scene, position: Option<Position>) -> Result<Texts> {
        let mut resolved = self.settings.resolved(scene, &self.loaded.tf_source, self.loaded.suiting);
        if let Some(Position::Frame { frame }) = position {
            resolved.read_flags.frame = Some(frame);
        }
        resolved.shadow = Some(self.spec.clone());
        let certify = self.args.certify.map(|eta| ("umbravox:certify".to_owned(), eta.to_string()));
        Ok(picture_texts(&self.adapter, Some(&resolved))?.into_iter().chain(certify).collect())
    }

    fn summary(&self, prepared: &Prepared<'_>, picture: &Picture) -> Summary {
        Summary::new(&self.args.output, prepared, self.method.as_ref(), &self.loaded.scene, picture)
    }

    /// Draws and writes a single picture.
    fn draw_one(&self, session: &mut CachedSession) -> Result<Summary> {
        let Self { args, loaded: Loaded { volume, strands, tf, scene, .. }, .. } = self;
        if args.error_bound {
            let refuse = |why| Error::input("cannot bound error", "--error-bound", why);
            scene.bounds_mean_error().map_err(refuse)?;
        }
        let asked = args.error_bound || args.certify.is_some();
        let exact = asked.then(|| exact_field((volume, tf), strands.as_deref(), scene)).transpose()?;
        let extent = (scene, MapCoverage::Picture);
        let show_map = |number, count| self.progress.show_map(number, count);
        let building = Building { watch: Some(&show_map), ..Building::default() };
        let mut work = Work::default();
        let prepared = session.prepare_with(self.method.as_ref(), extent, &mut work, building)?;
        self.progress.show_rays(0.0);
        let mut picture = prepared.render_watched(scene, |share| self.progress.show_rays(share))?;
        let certified = exact.as_ref().zip(args.certify);
        let certified = certified.map(|(field, eta)| self.certify(&prepared, field, eta)).transpose()?;
        volume.check_reads()?;
        certified.iter().for_each(|certified| picture.pixels.assign(&certified.pixels));
        let texts = self.texts(scene, None)?;
        if args.annotate {
            let marked = annotated(&picture.pixels, scene, (tf, volume.value_range()))?;
            let bytes = rgb_png(&marked, &texts)?;
            write_whole(&args.output, |file| file.write_all(&bytes))?;
        } else {
            write_picture_with(&args.output, &picture.pixels, self.backdrop, &texts)?;
        }
        if let (Some(path), Some(certified)) = (&args.error_picture, &certified) {
            write_picture(path, &certified.error_pixels())?;
        }
        let of_points = |field| {
            self.progress.show_share("exact transmittance", 0.0);
            mean_error(&field, scene, &prepared)
        };
        let mean_error = exact.filter(|_| args.error_bound).map(of_points);
        let certificate = certified.as_ref().map(CertifiedPicture::certificate);
        let mean_error = mean_error.transpose()?;
        volume.check_reads()?;
        Ok(Summary { mean_error, certificate, ..self.summary(&prepared, &picture) })
    }

    /// Returns a picture whose transmittances err by at most `eta`, or are those of shadow rays.
    fn certify(
        &self,
        Prepared { renderer, loaded, transfer, shadows }: &Prepared<'_>,
        field: &ExactField<'_>,
        eta: f64,
    ) -> Result<CertifiedPicture> {
        let certified = CertifiedScene { renderer, loaded, transfer, shadows, field };
        certified.render(&self.loaded.scene, eta, &|share| {
            self.progress.show_share("certified eye rays", share);
            Ok(())
        })
    }

    /// Draws and writes the pictures of a rotation or of a time series.
    fn draw_several(&self, session: &mut CachedSession, plan: &FramePlan) -> Result<Summary> {
        let Loaded { tf_source, scene, suiting, .. } = &self.loaded;
        // All frames have the camera of the first, and units and extinction as that one.
        let later = self.settings.resolved(scene, tf_source, *suiting);
        let reported = RefCell::new(self.loaded.diagnostics.clone());
        let at = |session: &mut CachedSession, position: Position| match (plan.frames, position) {
            (Frames::Rotation(rotation), Position::Angle { angle_deg }) => {
                Ok(rotation.rotated(scene, angle_deg))
            }
            (_, Position::Frame { frame }) if Some(frame) != self.settings.read_flags.frame => {
                let (scene, diagnostics) = load_frame(session, &later, frame)?;
                let is_warning = |d: &Diagnostic| d.level == Level::Warning;
                for warning in diagnostics.into_iter().filter(is_warning) {
                    self.warn_once(frame, warning, &mut reported.borrow_mut());
                }
                Ok(scene)
            }
            _ => Ok(scene.clone()),
        };
        let texts = |scene: &Scene, position| self.texts(scene, Some(position));
        let (backdrop, progress) = (self.backdrop, &self.progress);
        let writer = FrameWriter { plan, backdrop, texts: &texts, scene: &at, progress };
        let on_first = |prepared: &Prepared<'_>, picture: &Picture| self.summary(prepared, picture);
        let (first, frames) = writer.write(session, self.method.as_ref(), scene, on_first)?;
        Ok(Summary { frames: Some(frames), ..first })
    }

    /// Prints a warning about a frame of a time series, unless an earlier frame has it too.
    fn warn_once(&self, frame: usize, warning: Diagnostic, reported: &mut Vec<Diagnostic>) {
        if !reported.contains(&warning) {
            let text = format_args!("frame {frame}: {}", warning.message);
            self.progress.print_message(warning.level.name(), &text);
            reported.push(warning);
        }
    }
}

/// Puts a frame of a time series into a session, and returns its scene with notes and warnings.
fn load_frame(
    session: &mut CachedSession,
    settings: &SceneSettings,
    frame: usize,
) -> Result<(Scene, Vec<Diagnostic>)> {
    let mut settings = settings.clone();
    settings.read_flags.frame = Some(frame);
    let Loaded { volume, strands, tf, scene, diagnostics, .. } = settings.load(&Loading::default())?;
    session.load(volume, strands)?;
    session.set_transfer(&tf, &mut Work::default())?;
    Ok((scene, diagnostics))
}

/// Refuses a file for the error bounds that cannot be written, or that is the picture itself.
fn check_error_picture(args: &RenderArgs) -> Result<()> {
    let Some(path) = &args.error_picture else { return Ok(()) };
    check_output(path, PICTURE_EXTENSIONS)?;
    if *path == args.output {
        let why = "--output and --error-picture are one file";
        return Err(Error::input("cannot write picture", path.display(), why));
    }
    Ok(())
}

/// Returns the exact field of a scene, with the directions of strands if its shading reads them.
///
/// # Errors
/// The host is out of memory.
fn exact_field<'a>(
    (volume, tf): (&'a Volume, &'a TransferFunction),
    strands: Option<&VoxelisedStrands>,
    scene: &Scene,
) -> Result<ExactField<'a>> {
    let shaded = strands.filter(|_| scene.shading.is_of_strands());
    let directions = shaded.map(VoxelisedStrands::directions).transpose()?;
    Ok(ExactField::new(volume, tf).with_directions(directions))
}

/// Returns the mean error of the shadows of a picture.
fn mean_error(field: &ExactField, scene: &Scene, prepared: &Prepared<'_>) -> Result<MeanError> {
    let Prepared { renderer, loaded, transfer, shadows } = prepared;
    let sample = MeanErrorSample::new(field, scene, MEAN_ERROR_POINTS);
    sample.of(shadows, |map, points| renderer.query(loaded, transfer, map, points))
}

/// Output of `render --json`: times and memory of the first picture, and a record of each picture of a rotation in
/// `frames`.
#[derive(Debug, serde::Serialize)]
struct Summary {
    output: String,
    adapter: String,
    method: &'static str,
    params: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pages: Option<PageUsage>,
    #[serde(skip_serializing_if = "Option::is_none")]
    streaming: Option<StreamUsage>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reading: Option<ReadUsage>,
    table_ms: f64,
    march_table_ms: Option<f64>,
    classify_ms: f64,
    build_ms: f64,
    frame_ms: f64,
    frame_wall_ms: f64,
    clock: Clock,
    bytes: u64,
    nodes_total: Option<u64>,
    nodes_max: Option<u64>,
    texels_hit: Option<u64>,
    texels_narrowed: Option<u64>,
    pool_growths: u32,
    bound: Option<f64>,
    bound_depth_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_error: Option<MeanError>,
    #[serde(skip_serializing_if = "Option::is_none")]
    certificate: Option<Certificate>,
    lights: Vec<LightCost>,
    left_out: Vec<Omission>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frames: Option<Vec<FrameRecord>>,
}

/// Build time and memory of the shadow map of one light.
#[derive(Debug, serde::Serialize)]
struct LightCost {
    light: LightSource,
    build_ms: f64,
    bytes: u64,
}

impl Summary {
    fn new(
        output: &Path,
        Prepared { renderer, loaded, transfer, shadows }: &Prepared<'_>,
        method: &dyn Method,
        scene: &Scene,
        picture: &Picture,
    ) -> Self {
        let method = renderer.effective_method(loaded, transfer, method, scene);
        let (frame_ms, clock) = picture.span.best();
        let maps = || shadows.iter().copied();
        let (report, bound) = (BuildReport::of_all(maps()), Bound::of_all(maps().map(|map| map.bound)));
        Self {
            output: output.display().to_string(),
            adapter: renderer.gpu().info.name.clone(),
            method: method.name(),
            params: method.params(),
            pages: transfer.pages,
            streaming: transfer.stream().map(|stream| stream.usage()),
            reading: loaded.volume.out_of_core().map(|parts| parts.usage()),
            table_ms: transfer.table_ms,
            march_table_ms: transfer.march_table().map(|t| t.table_ms),
            classify_ms: transfer.classify_ms,
            build_ms: report.build_ms(),
            frame_ms,
            frame_wall_ms: picture.span.wall_ms,
            clock,
            bytes: report.bytes,
            nodes_total: report.nodes_total,
            nodes_max: report.nodes_max,
            texels_hit: report.texels_hit,
            texels_narrowed: report.texels_narrowed,
            pool_growths: report.pool_growths,
            bound: bound.map(|b| b.transmittance),
            bound_depth_mm: bound.map(|b| b.depth_mm),
            mean_error: None,
            certificate: None,
            lights: mapped_lights(method, scene).into_iter().zip(maps()).map(LightCost::new).collect(),
            left_out: picture.plan.left_out.clone(),
            frames: None,
        }
    }

    /// Prints what the user asked for.
    fn report(&self, run: &RunFlags) -> Result<()> {
        if let Some(MeanError { estimate, bound }) = self.mean_error {
            print_message(
                "mean error",
                &format!("at most {bound:.4} (99 % confidence), about {estimate:.4}"),
            );
        }
        if let Some(Certificate { largest, mean, share_of_rays }) = self.certificate {
            let rays = 100.0 * share_of_rays;
            let text = format!(
                "estimated error at most {largest:.4}, mean {mean:.4}, rays for {rays:.1} % of lookups"
            );
            print_message("certified", &text);
        }
        if run.explain {
            self.explain();
        }
        if run.json { print_json(self) } else { Ok(()) }
    }

    fn explain(&self) {
        let print = |line: String| print_message("plan", &line);
        print(format!("adapter {}, times by {}", self.adapter, self.clock));
        if let Some(PageUsage { total, needed, pool_bytes, upload_ms, .. }) = self.pages {
            let mb = pool_bytes as f64 * 1e-6;
            print(format!("volume as pages: {needed} of {total} in {mb:.0} MB, {upload_ms:.0} ms"));
        }
        if let Some(StreamUsage { blocks, pages, ms }) = self.streaming {
            print(format!(
                "volume block by block: {blocks} blocks with {pages} uploads of pages, {ms:.0} ms"
            ));
        }
        if let Some(ReadUsage { read_bytes, read_ms, cached_bytes, peak_bytes, .. }) = self.reading {
            let [read, cached] = [read_bytes, cached_bytes].map(|bytes| bytes as f64 * 1e-6);
            let peak = peak_bytes.map(|bytes| format!(", {:.0} MB of memory at most", bytes as f64 * 1e-6));
            let peak = peak.unwrap_or_default();
            print(format!(
                "voxels read in parts: {read:.0} MB in {read_ms:.0} ms, {cached:.0} MB cached{peak}"
            ));
        }
        let march_table = self.march_table_ms.map(|ms| format!(", pre-compressed table {ms:.1} ms"));
        let tables = format!("tables {:.1} ms{}", self.table_ms, march_table.unwrap_or_default());
        print(format!("{tables}, bricks classified in {:.1} ms", self.classify_ms));
        let built = format!("{:.1} ms, {:.2} MB", self.build_ms, self.bytes as f64 * 1e-6);
        print(format!("shadow method {} {}: {built}", self.method, self.params));
        if self.lights.len() > 1 {
            for LightCost { light, build_ms, bytes } in &self.lights {
                print(format!("light {}: {build_ms:.1} ms, {:.2} MB", light.text(), *bytes as f64 * 1e-6));
            }
        }
        print(format!("ray cast {:.1} ms", self.frame_ms));
        self.left_out.iter().for_each(|o| print(o.to_string()));
        if let Some(frames) = &self.frames {
            print(FrameRecord::summary(frames));
        }
    }
}

impl LightCost {
    fn new((light, shadow): (LightSource, &ShadowMap)) -> Self {
        Self { light, build_ms: shadow.report.build_ms(), bytes: shadow.report.bytes }
    }
}
