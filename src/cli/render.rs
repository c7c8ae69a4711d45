//! `umbravox render`: one picture, or those of a turn.

use super::console::{load_scene, print_json, print_message};
use super::frames::{Drawer, Frame, FrameFlags, Texts};
use crate::engine::{DrawnPicture, Sequence};
use crate::error::Result;
use crate::files::animation::is_animation;
use crate::files::output::check_output;
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS, write_picture_with};
use crate::gpu::Clock;
use crate::open::provenance::picture_texts;
use crate::open::{Loaded, SceneArgs, SceneRequest};
use crate::render::{Omission, Session};
use crate::scene::{LightSource, Scene};
use crate::shadow::{Bound, BuildReport, Method, NoShadows, ShadowMap};
use clap::Args;
use std::path::{Path, PathBuf};

/// Draw one picture, or those of a camera or of lights that turn
#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub frames: FrameFlags,
    /// The picture: .png (8-bit sRGB), .exr or .npy (float32, height x width x 4, linear RGB and opacity). With
    /// --background none a .png has straight alpha, and .exr and .npy hold colours times opacity. A .png holds as text
    /// the scene file that draws it. With --turntable or --light-sweep frame.png stands for frame_0000.png and so on, and
    /// .apng and .gif are one animated file
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Bad input, a failure of the device or disk, or an interruption between the pictures of a turn.
pub fn run(args: RenderArgs) -> Result<()> {
    let turn = args.frames.turn(&args.output)?;
    if turn.is_none() {
        let hint = "--turntable and --light-sweep make one animated file";
        let animated = is_animation(&args.output);
        check_output(&args.output, PICTURE_EXTENSIONS)
            .map_err(|e| if animated { e.hint(hint) } else { e })?;
    }
    let SceneRequest { settings, run } = args.scene.into_request()?;
    let method = settings.method()?;
    let backdrop = if settings.is_transparent() { Backdrop::LeftOut } else { Backdrop::Drawn };
    turn.iter().try_for_each(|turn| turn.check(backdrop))?;
    let Loaded { volume, strands, tf, tf_source, scene, suiting, .. } = load_scene(&settings)?;
    let session =
        Session::open(run.adapter.as_deref(), volume, &tf, settings.forced())?.with_strands(strands);
    let adapter = session.renderer.gpu().info.name.clone();
    let texts = |scene: &Scene| -> Result<Texts> {
        let mut whole = settings.resolved(scene, &tf_source, suiting);
        whole.shadow = Some(settings.method_spec());
        picture_texts(&adapter, Some(&whole))
    };
    let mut sequence = Sequence::new(&session, method.as_ref());
    let needed = needed_method(&session, &scene, method.as_ref());
    let summary_of = |drawn: &DrawnPicture, shadows: &[&ShadowMap]| {
        Summary::of(&args.output, &session, needed, (shadows, &scene), drawn)
    };
    let summary = match &turn {
        None => {
            let drawn = sequence.draw(&scene)?;
            write_picture_with(&args.output, &drawn.picture.pixels, backdrop, &texts(&scene)?)?;
            summary_of(&drawn, &sequence.shadows())
        }
        Some(turn) => {
            let drawer = Drawer { turn, backdrop, texts: &texts };
            let (first, frames) = drawer.draw(&mut sequence, &scene, summary_of)?;
            Summary { frames: Some(frames), ..first }
        }
    };
    if run.explain {
        summary.explain();
    }
    if run.json {
        print_json(&summary)?;
    }
    Ok(())
}

/// The method asked for, or none where no light can be kept from a sample: the map is then not even built.
fn needed_method<'a>(session: &Session, scene: &Scene, method: &'a dyn Method) -> &'a dyn Method {
    match session.needs_shadows(scene) {
        Ok(()) => method,
        Err(_) => &NoShadows,
    }
}

/// What `--json` prints: of a turn the first picture's, and each picture in `frames`.
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
    #[serde(skip_serializing_if = "Option::is_none")]
    frames: Option<Vec<Frame>>,
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
        (shadows, scene): (&[&ShadowMap], &Scene),
        DrawnPicture { picture, .. }: &DrawnPicture,
    ) -> Self {
        let (frame_ms, clock) = picture.span.best();
        let maps = || shadows.iter().copied();
        let (report, bound) = (BuildReport::of_all(maps()), Bound::of_all(maps()));
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
            lights: scene.shining().into_iter().zip(maps()).map(Lit::of).collect(),
            left_out: picture.plan.left_out.clone(),
            frames: None,
        }
    }

    fn explain(&self) {
        let say = |line: String| print_message("plan", &line);
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
        if let Some(frames) = &self.frames {
            say(Frame::explained(frames));
        }
    }
}

impl Lit {
    fn of((light, shadow): (LightSource, &ShadowMap)) -> Self {
        Self { light, build_ms: shadow.report.build_ms(), bytes: shadow.report.bytes }
    }
}
