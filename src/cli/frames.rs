//! Pictures of a full rotation of the camera or the lights: `render --turntable` and `render --light-sweep`.

use super::console::{print_message, progress_bar};
use super::interrupt::Interrupt;
use crate::engine::{CachedSession, MapCoverage, Prepared, RotatedScene, Rotation, Work};
use crate::error::{Error, Result};
use crate::files::animation::{Animated, Animation, PICTURES_PER_SECOND, check_backdrop, is_animation};
use crate::files::output::check_output;
use crate::files::picture::{Backdrop, write_picture_with};
use crate::render::Picture;
use crate::scene::Scene;
use crate::shadow::Method;
use clap::Args;
use std::path::{Path, PathBuf};

/// File extensions for the pictures or the animation of a camera or light rotation.
const EXTENSIONS: &[&str] = &["png", "exr", "npy", "apng", "gif"];

/// Default number of frames per second of an animation file.
const DEFAULT_FPS: f64 = 10.0;

/// Text chunks (metadata) of a picture file, as pairs of key and text.
pub type Texts = Vec<(String, String)>;

/// Flags of `render` for a full rotation of the camera or the lights.
#[derive(Debug, Clone, Args)]
pub struct FrameFlags {
    /// Draw N pictures of a full rotation of the camera around its target: 360/N degrees around --up per picture,
    /// counterclockwise as seen from above. The first picture is the one drawn without this flag
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Rotation::MAX_PICTURES)),
        conflicts_with = "light_sweep", help_heading = "Rotation")]
    pub turntable: Option<u32>,
    /// Draw N pictures of a full rotation of the lights: directional lights by 360/N degrees around --up per picture,
    /// point lights on a circle around the line through the target along --up
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Rotation::MAX_PICTURES)),
        help_heading = "Rotation")]
    pub light_sweep: Option<u32>,
    /// Frames per second of an .apng or .gif animation, 0.1 to 50 [default: 10]
    #[arg(long, value_name = "F", value_parser = fps, help_heading = "Rotation")]
    pub fps: Option<f64>,
}

fn fps(text: &str) -> Result<f64, String> {
    let [least, most] = PICTURES_PER_SECOND;
    let known = text.trim().parse().ok().filter(|fps| (least..=most).contains(fps));
    known.ok_or_else(|| format!("expected a number from {least} to {most}"))
}

impl FrameFlags {
    /// Returns the turntable or light sweep animation that the flags request, with its output file; `None` for a
    /// single picture.
    ///
    /// # Errors
    /// `--fps` without an animation, or an output that cannot be written.
    pub fn plan(&self, output: &Path) -> Result<Option<RotationPlan>> {
        let rotation = self.turntable.map(|count| (Rotation::Camera, count));
        let rotation = rotation.or(self.light_sweep.map(|count| (Rotation::Lights, count)));
        if self.fps.is_some() && !(rotation.is_some() && is_animation(output)) {
            let why = "it needs --turntable or --light-sweep and an .apng or .gif file";
            return Err(Error::input("bad command line", "--fps", why));
        }
        let Some((rotation, count)) = rotation else { return Ok(None) };
        let plan =
            RotationPlan { rotation, count, fps: self.fps.unwrap_or(DEFAULT_FPS), output: output.into() };
        check_output(output, EXTENSIONS)?;
        if !is_animation(output) {
            (0..count)
                .find(|i| plan.frame_path(*i).is_dir())
                .map_or(Ok(()), |taken| check_output(&plan.frame_path(taken), EXTENSIONS))?;
        }
        Ok(Some(plan))
    }
}

/// Planned turntable or light sweep: a full rotation of the camera or the lights in equal steps, with its output
/// file.
#[derive(Debug, Clone)]
pub struct RotationPlan {
    rotation: Rotation,
    count: u32,
    fps: f64,
    output: PathBuf,
}

impl RotationPlan {
    /// Checks that the format of the output file supports the requested background, opaque or transparent.
    ///
    /// # Errors
    /// A file format that does not support this background.
    pub fn check(&self, backdrop: Backdrop) -> Result<()> {
        check_backdrop(&self.output, backdrop)
    }

    /// Path of a numbered picture of a turntable or light sweep: `DIR/frame_0000.png` for `DIR/frame.png`.
    fn frame_path(&self, number: u32) -> PathBuf {
        let mut name = self.output.file_stem().unwrap_or_default().to_owned();
        name.push(format!("_{number:04}."));
        name.push(self.output.extension().unwrap_or_default());
        self.output.with_file_name(name)
    }
}

/// Record of one picture of a turntable or light sweep for `render --json`: file, angle, times and reuse of shadow
/// maps.
#[derive(Debug, serde::Serialize)]
pub struct FrameRecord {
    /// Path of the picture file; `None` if all pictures are in one animation file.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    angle_deg: f64,
    built: usize,
    kept: usize,
    build_ms: f64,
    frame_ms: f64,
    frame_wall_ms: f64,
}

impl FrameRecord {
    /// Summary text of a turntable or light sweep: numbers of shadow maps built and reused, and total times.
    pub fn summary(frames: &[Self]) -> String {
        let sum = |of: fn(&Self) -> usize| frames.iter().map(of).sum::<usize>();
        let ms = |of: fn(&Self) -> f64| frames.iter().map(of).sum::<f64>();
        format!(
            "{} pictures: tables made once, {} shadow structures built ({:.1} ms), {} reused, \
             ray casts {:.1} ms",
            frames.len(),
            sum(|f| f.built),
            ms(|f| f.build_ms),
            sum(|f| f.kept),
            ms(|f| f.frame_ms)
        )
    }
}

/// Renders the pictures of a turntable or light sweep and writes them to files.
pub struct RotationWriter<'a> {
    pub plan: &'a RotationPlan,
    pub backdrop: Backdrop,
    /// Function that returns the text chunks (metadata) for the picture file of a scene.
    pub texts: &'a dyn Fn(&Scene) -> Result<Texts>,
}

impl RotationWriter<'_> {
    /// Renders and writes all pictures of a turntable or light sweep. Each file is written completely or not at all.
    /// Returns the result of `on_first` for the first picture, and a record of each picture.
    ///
    /// # Errors
    /// A picture that cannot be drawn; a file that cannot be written; an interruption between two pictures.
    pub fn write<T>(
        &self,
        session: &mut CachedSession,
        method: &dyn Method,
        scene: &Scene,
        on_first: impl Fn(&Prepared<'_>, &Picture) -> T,
    ) -> Result<(T, Vec<FrameRecord>)> {
        let RotationPlan { rotation, count, fps, output } = self.plan;
        let written = match is_animation(output) {
            false => "written pictures are kept",
            true => "nothing is written",
        };
        // Created before any file is started, so that an interruption leaves no unfinished file.
        let interrupt = Interrupt::between_steps(written);
        let mut animation = None;
        if is_animation(output) {
            let (size, texts) = ([scene.width, scene.height], (self.texts)(scene)?);
            let settings = Animated { size, frames: *count, fps: *fps, backdrop: self.backdrop, texts };
            animation = Some(Animation::begin(output, settings)?);
        }
        if !rotation.changes(scene) {
            print_message("note", &"every light lies on the rotation axis: all pictures are identical");
        }
        let bar = progress_bar((*count).into(), "{bar:20} {pos}/{len} about {eta} left, {wide_msg}")?;
        let (mut first, mut frames) = (None, Vec::new());
        for RotatedScene { angle_deg, scene } in rotation.scenes(scene, *count) {
            if interrupt.is_requested() {
                bar.finish_and_clear();
                let why = format!("{} of {count} pictures are drawn; {written}", frames.len());
                return Err(Error::runtime("interrupted", output.display(), why));
            }
            bar.set_message(format!("{angle_deg:.1} degrees"));
            let mut work = Work::default();
            let prepared = session.prepare(method, (&scene, MapCoverage::Picture), &mut work)?;
            let picture = prepared.render(&scene)?;
            let pixels = &picture.pixels;
            let file = match &mut animation {
                Some(animation) => animation.add(pixels).map(|()| None),
                None => {
                    let path = self.plan.frame_path(frames.len() as u32);
                    write_picture_with(&path, pixels, self.backdrop, &(self.texts)(&scene)?)
                        .map(|()| Some(path))
                }
            }?;
            frames.push(FrameRecord {
                file: file.map(|path| path.display().to_string()),
                angle_deg,
                built: work.built,
                kept: prepared.shadows.len() - work.built,
                build_ms: work.build_ms.unwrap_or(0.0),
                frame_ms: picture.span.best().0,
                frame_wall_ms: picture.span.wall_ms,
            });
            first.get_or_insert_with(|| on_first(&prepared, &picture));
            bar.inc(1);
        }
        bar.finish_and_clear();
        if animation.is_some() && interrupt.is_requested() {
            let why = format!("all {count} pictures are drawn; {written}");
            return Err(Error::runtime("interrupted", output.display(), why));
        }
        match animation {
            Some(animation) => animation.finish()?,
            None => self.warn_of_others(),
        }
        let none = || Error::runtime("cannot render", output.display(), "the rotation has no pictures");
        Ok((first.ok_or_else(none)?, frames))
    }

    /// Warns if the output folder has a further numbered picture that an earlier, longer rotation left behind.
    fn warn_of_others(&self) {
        let next = self.plan.frame_path(self.plan.count);
        if next.exists() {
            print_message("warning", &format_args!("{} is from an earlier rotation", next.display()));
        }
    }
}
