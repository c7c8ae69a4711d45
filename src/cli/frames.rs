//! Pictures of a full rotation of the camera or the lights, or of a time series: `render --turntable`, `--light-sweep` and
//! `--frames`.

use super::console::print_message;
use super::interrupt::Interrupt;
use super::render_progress::RenderProgress;
use crate::engine::{Building, CachedSession, MapCoverage, Prepared, Rotation, Work};
use crate::error::{Error, Result};
use crate::files::animation::{Animated, Animation, PICTURES_PER_SECOND, check_backdrop, is_animation};
use crate::files::output::{check_output, check_output_or_stdout, is_stdout};
use crate::files::picture::{Backdrop, write_picture_with};
use crate::render::Picture;
use crate::scene::Scene;
use crate::shadow::Method;
use clap::Args;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// File extensions for the pictures or the animation.
const EXTENSIONS: &[&str] = &["png", "exr", "npy", "apng", "gif"];

/// Default number of frames per second of an animation file.
const DEFAULT_FPS: f64 = 10.0;

/// Text chunks (metadata) of a picture file, as pairs of key and text.
pub type Texts = Vec<(String, String)>;

/// Flags of `render` for several pictures: a full rotation of the camera or the lights, or a time series.
#[derive(Debug, Clone, Args)]
pub struct FrameFlags {
    /// Draw N pictures of a full rotation of the camera around its target: 360/N degrees around --up each,
    /// counterclockwise from above, from the camera of the other flags on
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Rotation::MAX_PICTURES)),
        conflicts_with = "light_sweep", help_heading = "Rotation")]
    pub turntable: Option<u32>,
    /// Draw N pictures of a full rotation of the lights: directional lights by 360/N degrees around --up per picture,
    /// point lights on a circle around the line through the target along --up
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Rotation::MAX_PICTURES)),
        help_heading = "Rotation")]
    pub light_sweep: Option<u32>,
    /// Draw a picture of each of these frames of a 4-D file (time series): `all`, or FIRST:LAST, counted from 0. All have
    /// the camera of the first
    #[arg(long, value_name = "FRAMES", conflicts_with_all = ["turntable", "light_sweep", "frame"],
        help_heading = "Rotation")]
    pub frames: Option<FrameRange>,
    /// Frames per second of an .apng or .gif animation, 0.1 to 50 [default: 10]
    #[arg(long, value_name = "F", value_parser = fps, help_heading = "Rotation")]
    pub fps: Option<f64>,
}

/// Range of frames of a time series: the first, and the last or `None` for that of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    first: usize,
    last: Option<usize>,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let ends =
            text.split_once(':').and_then(|(first, last)| Some((first.parse().ok()?, last.parse().ok()?)));
        match ends {
            None if text == "all" => Ok(Self { first: 0, last: None }),
            Some((first, last)) if first <= last => Ok(Self { first, last: Some(last) }),
            _ => Err("expected `all`, or FIRST:LAST with FIRST at most LAST".into()),
        }
    }
}

impl FrameRange {
    /// First frame of the range.
    pub fn first(self) -> usize {
        self.first
    }

    /// Returns the number of pictures for a file with `frames` frames.
    fn count(self, frames: usize) -> Result<u32> {
        let refuse = |why| Error::input("cannot read frames", "--frames", why);
        let last = self.last.unwrap_or(frames.saturating_sub(1));
        if last >= frames {
            return Err(refuse(format!("the volume has {frames} frames, counted from 0")));
        }
        let count = (last + 1 - self.first) as u64;
        let most = u64::from(Rotation::MAX_PICTURES);
        u32::try_from(count)
            .ok()
            .filter(|_| count <= most)
            .ok_or_else(|| refuse(format!("at most {most} pictures")))
    }
}

fn fps(text: &str) -> Result<f64, String> {
    let [least, most] = PICTURES_PER_SECOND;
    let known = text.trim().parse().ok().filter(|fps| (least..=most).contains(fps));
    known.ok_or_else(|| format!("expected a number from {least} to {most}"))
}

impl FrameFlags {
    /// Returns the pictures that the flags request, with their output file; `None` for a single picture. `prints_json`:
    /// the result in JSON goes to standard output.
    ///
    /// # Errors
    /// `--fps` without an animation, or an output that cannot be written.
    pub fn plan(&self, output: &Path, prints_json: bool) -> Result<Option<FramePlan>> {
        let of_camera = self.turntable.map(|count| (Frames::Rotation(Rotation::Camera), count));
        let of_lights = self.light_sweep.map(|count| (Frames::Rotation(Rotation::Lights), count));
        // The number of frames is known when the file is read.
        let of_series = self.frames.map(|range| (Frames::Series(range), 1));
        let frames = of_camera.or(of_lights).or(of_series);
        if self.fps.is_some() && !(frames.is_some() && is_animation(output)) {
            let why = "it needs --turntable, --light-sweep or --frames and an .apng or .gif file";
            return Err(Error::input("bad command line", "--fps", why));
        }
        let Some((frames, count)) = frames else { return Ok(None) };
        let plan = FramePlan { frames, count, fps: self.fps.unwrap_or(DEFAULT_FPS), output: output.into() };
        check_output_or_stdout(output, EXTENSIONS, prints_json)?;
        plan.check_paths()?;
        Ok(Some(plan))
    }
}

/// Kind of several pictures.
#[derive(Debug, Clone, Copy)]
pub enum Frames {
    /// Full rotation of the camera or the lights in equal steps.
    Rotation(Rotation),
    /// Frames of a time series.
    Series(FrameRange),
}

/// Plan of several pictures, with their output file.
#[derive(Debug, Clone)]
pub struct FramePlan {
    /// Kind of the pictures.
    pub frames: Frames,
    count: u32,
    fps: f64,
    output: PathBuf,
}

/// Place of a picture among several.
#[derive(Debug, Clone, Copy, serde::Serialize)]
#[serde(untagged)]
pub enum Position {
    /// Angle of a rotation.
    Angle {
        /// Angle by which camera or lights are rotated, degrees.
        angle_deg: f64,
    },
    /// Frame of a time series.
    Frame {
        /// Index of the frame, from 0.
        frame: usize,
    },
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Angle { angle_deg } => write!(f, "{angle_deg:.1} degrees"),
            Self::Frame { frame } => write!(f, "frame {frame}"),
        }
    }
}

impl FramePlan {
    /// Returns the number of pictures.
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// Sets the number of pictures of a time series, from the number of frames of its file.
    ///
    /// # Errors
    /// The file has fewer frames than requested, or too many.
    pub fn set_file_frames(&mut self, frames: usize) -> Result<()> {
        if let Frames::Series(range) = self.frames {
            self.count = range.count(frames)?;
        }
        self.check_paths()
    }

    /// Refuses numbered pictures whose paths are folders.
    fn check_paths(&self) -> Result<()> {
        if is_animation(&self.output) || is_stdout(&self.output) {
            return Ok(());
        }
        let taken = (0..self.count).map(|number| self.frame_path(number)).find(|path| path.is_dir());
        taken.map_or(Ok(()), |path| check_output(&path, EXTENSIONS))
    }

    /// Returns the position of a numbered picture.
    fn position(&self, number: u32) -> Position {
        match self.frames {
            Frames::Rotation(_) => {
                Position::Angle { angle_deg: 360.0 * f64::from(number) / f64::from(self.count) }
            }
            Frames::Series(range) => Position::Frame { frame: range.first + number as usize },
        }
    }

    /// Checks that the format of the output file supports the requested background, opaque or transparent.
    ///
    /// # Errors
    /// A file format that does not support this background.
    pub fn check(&self, backdrop: Backdrop) -> Result<()> {
        check_backdrop(&self.output, backdrop)
    }

    /// Path of a numbered picture: `DIR/frame_0000.png` for `DIR/frame.png`, and `-` for
    /// standard output.
    fn frame_path(&self, number: u32) -> PathBuf {
        if is_stdout(&self.output) {
            return self.output.clone();
        }
        with_suffix(&self.output, &format!("_{number:04}"))
    }
}

/// Returns a path with a suffix before the extension of its file name.
pub fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("{suffix}."));
    name.push(path.extension().unwrap_or_default());
    path.with_file_name(name)
}

/// Record of one of several pictures for `render --json`: file, position, times and reuse of shadow maps.
#[derive(Debug, serde::Serialize)]
pub struct FrameRecord {
    /// Path of the picture file; `None` if all pictures are in one animation file.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    #[serde(flatten)]
    position: Position,
    built: usize,
    kept: usize,
    build_ms: f64,
    frame_ms: f64,
    frame_wall_ms: f64,
}

impl FrameRecord {
    /// Summary text of several pictures: numbers of shadow maps built and reused, and total times.
    pub fn summary(frames: &[Self]) -> String {
        let sum = |of: fn(&Self) -> usize| frames.iter().map(of).sum::<usize>();
        let ms = |of: fn(&Self) -> f64| frames.iter().map(of).sum::<f64>();
        format!(
            "{} pictures: {} shadow structures built ({:.1} ms), {} reused, \
             ray casts {:.1} ms",
            frames.len(),
            sum(|f| f.built),
            ms(|f| f.build_ms),
            sum(|f| f.kept),
            ms(|f| f.frame_ms)
        )
    }
}

/// Renders several pictures and writes them to files.
pub struct FrameWriter<'a> {
    pub plan: &'a FramePlan,
    pub backdrop: Backdrop,
    /// Function that returns the text chunks (metadata) for the picture file of a scene.
    pub texts: &'a dyn Fn(&Scene, Position) -> Result<Texts>,
    /// Function that puts the volume of a picture into the session, and returns the scene of the picture.
    pub scene: &'a dyn Fn(&mut CachedSession, Position) -> Result<Scene>,
    pub progress: &'a RenderProgress,
}

impl FrameWriter<'_> {
    /// Renders and writes all pictures. Each file is written completely or not at all.
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
        let FramePlan { frames: kind, count, fps, output } = self.plan;
        let written = match is_animation(output) {
            _ if is_stdout(output) => "written pictures are kept",
            false => "written pictures are kept",
            true => "nothing is written",
        };
        // Created before any file is started, so that an interruption leaves no unfinished file.
        let interrupt = Interrupt::between_steps(written);
        let mut animation = None;
        if is_animation(output) {
            let (size, texts) = ([scene.width, scene.height], (self.texts)(scene, self.plan.position(0))?);
            let settings = Animated { size, frames: *count, fps: *fps, backdrop: self.backdrop, texts };
            animation = Some(Animation::begin(output, settings)?);
        }
        if matches!(kind, Frames::Rotation(rotation) if !rotation.changes(scene)) {
            print_message("note", &"every light lies on the rotation axis: all pictures are identical");
        }
        let (mut first, mut frames) = (None, Vec::new());
        for position in (0..*count).map(|number| self.plan.position(number)) {
            if interrupt.is_requested() {
                let why = format!("{} of {count} pictures are drawn; {written}", frames.len());
                return Err(Error::runtime("interrupted", output.display(), why));
            }
            self.progress.begin_picture(&position);
            let scene = (self.scene)(session, position)?;
            let mut work = Work::default();
            let show_map = |number, count| self.progress.show_map(number, count);
            let building = Building { watch: Some(&show_map), ..Building::default() };
            let prepared =
                session.prepare_with(method, (&scene, MapCoverage::Picture), &mut work, building)?;
            self.progress.show_rays(0.0);
            let picture = prepared.render_watched(&scene, |share| self.progress.show_rays(share))?;
            let pixels = &picture.pixels;
            let file = match &mut animation {
                Some(animation) => animation.add(pixels).map(|()| None),
                None => {
                    let path = self.plan.frame_path(frames.len() as u32);
                    write_picture_with(&path, pixels, self.backdrop, &(self.texts)(&scene, position)?)
                        .map(|()| Some(path))
                }
            }?;
            frames.push(FrameRecord {
                file: file.map(|path| path.display().to_string()),
                position,
                built: work.built,
                kept: prepared.shadows.len() - work.built,
                build_ms: work.build_ms.unwrap_or(0.0),
                frame_ms: picture.span.best().0,
                frame_wall_ms: picture.span.wall_ms,
            });
            first.get_or_insert_with(|| on_first(&prepared, &picture));
            self.progress.end_picture();
        }
        self.progress.finish_and_clear();
        if animation.is_some() && interrupt.is_requested() {
            let why = format!("all {count} pictures are drawn; {written}");
            return Err(Error::runtime("interrupted", output.display(), why));
        }
        match animation {
            Some(animation) => animation.finish()?,
            None => self.warn_of_others(),
        }
        let none = || Error::runtime("cannot render", output.display(), "there are no pictures");
        Ok((first.ok_or_else(none)?, frames))
    }

    /// Warns if the output folder has a further numbered picture that an earlier run with more pictures left behind.
    fn warn_of_others(&self) {
        let next = self.plan.frame_path(self.plan.count);
        if !is_stdout(&next) && next.exists() {
            print_message(
                "warning",
                &format_args!("{} is from an earlier run with more pictures", next.display()),
            );
        }
    }
}
