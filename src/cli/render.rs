//! `umbravox render`: one picture.

use super::told::{load, print_json, say};
use crate::error::Result;
use crate::files::output::check_output;
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS, write_picture_with};
use crate::gpu::Clock;
use crate::open::{DEFAULT_SHADOW, Loaded, SceneArgs};
use crate::render::{Omission, Picture, Session};
use crate::report::asked::picture_texts;
use crate::scene::{LightSource, Scene};
use crate::shadow::{Bound, BuildReport, Method, NoShadows, ShadowMap};
use clap::Args;
use std::path::{Path, PathBuf};

/// Draw one picture
#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The picture: .png (8-bit sRGB), .exr or .npy (float32, height x width x 4, linear RGB and opacity). With
    /// --background none a .png has straight alpha, and .exr and .npy hold colours times opacity. A .png holds as text
    /// the scene file that draws it
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or a failure of the device or disk.
pub fn run(args: RenderArgs) -> Result<()> {
    check_output(&args.output, PICTURE_EXTENSIONS)?;
    let settings = args.scene.into_settings()?;
    let method = settings.method()?;
    let Loaded { volume, strands, tf, tf_source, scene, suiting, .. } = load(&settings)?;
    let mut whole = settings.resolved(&scene, &tf_source, suiting)?;
    whole.shadow = Some(settings.shadow.clone().unwrap_or_else(|| DEFAULT_SHADOW.into()));
    let session =
        Session::open(settings.adapter.as_deref(), volume, &tf, settings.forced())?.with_strands(strands);
    let method = needed_method(&session, &scene, method);
    let shadows = session.shadows_of(method.as_ref(), &scene)?;
    let picture = session.render(&shadows, &scene)?;
    let backdrop = if settings.is_transparent() { Backdrop::LeftOut } else { Backdrop::Drawn };
    let texts = picture_texts(&session.renderer.gpu().info.name, Some(&whole))?;
    write_picture_with(&args.output, &picture.pixels, backdrop, &texts)?;
    let summary = Summary::of(&args.output, &session, method.as_ref(), (&shadows, &scene), &picture);
    if settings.explain {
        summary.explain();
    }
    if settings.json {
        print_json(&summary)?;
    }
    Ok(())
}

/// The method asked for, or none where no light can be kept from a sample: the map is then not even built.
fn needed_method(session: &Session, scene: &Scene, method: Box<dyn Method>) -> Box<dyn Method> {
    match session.needs_shadows(scene) {
        Ok(()) => method,
        Err(_) => Box::new(NoShadows),
    }
}

/// What `--json` prints.
#[derive(Debug, serde::Serialize)]
struct Summary {
    output: String,
    adapter: String,
    method: &'static str,
    params: String,
    volume_tiles: usize,
    volume_texture: [usize; 3],
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
    lights: Vec<Lit>,
    left_out: Vec<Omission>,
}

/// What one light that shines has cost.
#[derive(Debug, serde::Serialize)]
struct Lit {
    light: LightSource,
    build_ms: f64,
    bytes: u64,
}

impl Summary {
    fn of(
        output: &Path,
        session: &Session,
        method: &dyn Method,
        (shadows, scene): (&[ShadowMap], &Scene),
        picture: &Picture,
    ) -> Self {
        let (frame_ms, clock) = picture.span.best();
        let (report, bound) = (BuildReport::of_all(shadows), Bound::of_all(shadows));
        Self {
            output: output.display().to_string(),
            adapter: session.renderer.gpu().info.name.clone(),
            method: method.name(),
            params: method.params(),
            volume_tiles: session.loaded.on_device.fold.tiles(),
            volume_texture: session.loaded.on_device.fold.sides(),
            table_ms: session.transfer.table_ms,
            march_table_ms: session.transfer.march_table().map(|t| t.table_ms),
            classify_ms: session.transfer.classify_ms,
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
            lights: scene.shining().into_iter().zip(shadows).map(Lit::of).collect(),
            left_out: picture.plan.left_out.clone(),
        }
    }

    fn explain(&self) {
        let say = |line: String| say("plan", &line);
        say(format!("adapter {}, times by {}", self.adapter, self.clock));
        if self.volume_tiles > 1 {
            let [x, y, z] = self.volume_texture;
            say(format!("volume folded: {} slabs of it in a texture of {x} x {y} x {z}", self.volume_tiles));
        }
        let march_table = self.march_table_ms.map(|ms| format!(", pre-compressed table {ms:.1} ms"));
        let tables = format!("tables {:.1} ms{}", self.table_ms, march_table.unwrap_or_default());
        say(format!("{tables}, bricks classified in {:.1} ms", self.classify_ms));
        let built = format!("{:.1} ms, {:.2} MB", self.build_ms, self.bytes as f64 * 1e-6);
        say(format!("shadow method {} {}: {built}", self.method, self.params));
        if self.lights.len() > 1 {
            for Lit { light, build_ms, bytes } in &self.lights {
                say(format!("light {}: {build_ms:.1} ms, {:.2} MB", light.text(), *bytes as f64 * 1e-6));
            }
        }
        say(format!("ray cast {:.1} ms", self.frame_ms));
        self.left_out.iter().for_each(|o| say(o.to_string()));
    }
}

impl Lit {
    fn of((light, shadow): (LightSource, &ShadowMap)) -> Self {
        Self { light, build_ms: shadow.report.build_ms(), bytes: shadow.report.bytes }
    }
}
