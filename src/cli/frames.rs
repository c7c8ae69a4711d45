//! The pictures of a turn: `render --turntable` and `--light-sweep`.

use super::console::print_message;
use super::interrupt::Interrupt;
use crate::engine::{DrawnPicture, Sequence, Turned, Turning};
use crate::error::{Error, Result};
use crate::files::animation::{Animated, Animation, PICTURES_PER_SECOND, check_backdrop, is_animation};
use crate::files::output::check_output;
use crate::files::picture::{Backdrop, write_picture_with};
use crate::scene::Scene;
use crate::shadow::ShadowMap;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};

/// Everything that pictures of a turn can be written to.
const EXTENSIONS: &[&str] = &["png", "exr", "npy", "apng", "gif"];

/// Pictures a second where nothing is said.
const DEFAULT_FPS: f64 = 10.0;

/// Texts by their keys.
pub type Texts = Vec<(String, String)>;

/// What turns, and how fast it is shown.
#[derive(Debug, Clone, Args)]
pub struct FrameFlags {
    /// Draw N pictures of a whole turn, the camera going around its target: 360/N degrees around --up from one to the next,
    /// counterclockwise as seen from above. The first is the picture without this flag
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Turning::MOST)),
        conflicts_with = "light_sweep", help_heading = "Turn")]
    pub turntable: Option<u32>,
    /// The same with a camera that stays and lights that turn: directions by 360/N degrees around --up, points along a
    /// circle around the line through the target along --up
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(Turning::MOST)),
        help_heading = "Turn")]
    pub light_sweep: Option<u32>,
    /// Pictures a second of an .apng or .gif file, 0.1 to 50 [default: 10]
    #[arg(long, value_name = "F", value_parser = fps, help_heading = "Turn")]
    pub fps: Option<f64>,
}

fn fps(text: &str) -> Result<f64, String> {
    let [least, most] = PICTURES_PER_SECOND;
    let known = text.trim().parse().ok().filter(|fps| (least..=most).contains(fps));
    known.ok_or_else(|| format!("expected a number from {least} to {most}"))
}

impl FrameFlags {
    /// The turn that is asked for, if any.
    ///
    /// # Errors
    /// A pace where nothing is animated, or pictures that cannot be written there.
    pub fn turn(&self, output: &Path) -> Result<Option<Turn>> {
        let turning = self.turntable.map(|count| (Turning::Camera, count));
        let turning = turning.or(self.light_sweep.map(|count| (Turning::Lights, count)));
        if self.fps.is_some() && !(turning.is_some() && is_animation(output)) {
            let why = "it is of --turntable and --light-sweep into an .apng or .gif file";
            return Err(Error::input("bad command line", "--fps", why));
        }
        let Some((turning, count)) = turning else { return Ok(None) };
        let turn = Turn { turning, count, fps: self.fps.unwrap_or(DEFAULT_FPS), output: output.into() };
        check_output(output, EXTENSIONS)?;
        if !is_animation(output) {
            (0..count)
                .find(|i| turn.frame_path(*i).is_dir())
                .map_or(Ok(()), |taken| check_output(&turn.frame_path(taken), EXTENSIONS))?;
        }
        Ok(Some(turn))
    }
}

/// A whole turn in so many pictures.
#[derive(Debug, Clone)]
pub struct Turn {
    turning: Turning,
    count: u32,
    fps: f64,
    output: PathBuf,
}

impl Turn {
    /// Refuses what the file's format cannot show.
    ///
    /// # Errors
    /// That, as a fault of the command line.
    pub fn check(&self, backdrop: Backdrop) -> Result<()> {
        check_backdrop(&self.output, backdrop)
    }

    /// `DIR/frame.png` numbered: `DIR/frame_0000.png`.
    fn frame_path(&self, number: u32) -> PathBuf {
        let mut name = self.output.file_stem().unwrap_or_default().to_owned();
        name.push(format!("_{number:04}."));
        name.push(self.output.extension().unwrap_or_default());
        self.output.with_file_name(name)
    }
}

/// A picture of a turn, for `--json`.
#[derive(Debug, serde::Serialize)]
pub struct Frame {
    /// `None` where all are in one file.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    angle_deg: f64,
    built: usize,
    kept: usize,
    build_ms: f64,
    frame_ms: f64,
    frame_wall_ms: f64,
}

impl Frame {
    fn of(file: Option<&Path>, angle_deg: f64, drawn: &DrawnPicture) -> Self {
        let DrawnPicture { picture, built, kept, build_ms } = drawn;
        Self {
            file: file.map(|path| path.display().to_string()),
            angle_deg,
            built: *built,
            kept: *kept,
            build_ms: *build_ms,
            frame_ms: picture.span.best().0,
            frame_wall_ms: picture.span.wall_ms,
        }
    }

    /// What was kept from picture to picture, in a line.
    pub fn explained(frames: &[Self]) -> String {
        let sum = |of: fn(&Self) -> usize| frames.iter().map(of).sum::<usize>();
        let ms = |of: fn(&Self) -> f64| frames.iter().map(of).sum::<f64>();
        format!(
            "{} pictures: tables made once, {} shadow structures built ({:.1} ms) and {} kept from the picture before, \
             ray casts {:.1} ms",
            frames.len(),
            sum(|f| f.built),
            ms(|f| f.build_ms),
            sum(|f| f.kept),
            ms(|f| f.frame_ms)
        )
    }
}

/// Where pictures go.
enum Sink {
    Numbered,
    Animated(Box<Animation>),
}

/// Draws the pictures of a turn and writes them.
pub struct Drawer<'a> {
    pub turn: &'a Turn,
    pub backdrop: Backdrop,
    /// What the picture of a scene carries.
    pub texts: &'a dyn Fn(&Scene) -> Result<Texts>,
}

impl Drawer<'_> {
    /// Does it, each file whole or not at all; gives what `of_first` makes of the first picture, and a line for each.
    ///
    /// # Errors
    /// As [`Sequence::draw`]; a file that cannot be written; an interruption, which ends it between two pictures.
    pub fn draw<T>(
        &self,
        sequence: &mut Sequence<'_>,
        scene: &Scene,
        of_first: impl FnOnce(&DrawnPicture, &[&ShadowMap]) -> T,
    ) -> Result<(T, Vec<Frame>)> {
        let Turn { turning, count, fps, output } = self.turn;
        let kept = match is_animation(output) {
            false => "pictures that are written are kept",
            true => "nothing is written",
        };
        // Before a file is begun, so that none is left.
        let interrupt = Interrupt::between_steps(kept);
        let mut sink = match is_animation(output) {
            false => Sink::Numbered,
            true => {
                let (size, backdrop, texts) =
                    ([scene.width, scene.height], self.backdrop, (self.texts)(scene)?);
                let of = Animated { size, frames: *count, fps: *fps, backdrop, texts };
                Sink::Animated(Box::new(Animation::begin(output, of)?))
            }
        };
        if !turning.changes(scene) {
            print_message(
                "note",
                &"every light is on the axis that it is turned around: all pictures are the same",
            );
        }
        let bar = progress_bar(*count)?;
        let (mut of_first, mut first, mut frames) = (Some(of_first), None, Vec::new());
        for Turned { angle_deg, scene } in turning.scenes(scene, *count) {
            if interrupt.has_come() {
                bar.finish_and_clear();
                let why = format!("{} of {count} pictures are drawn; {kept}", frames.len());
                return Err(Error::runtime("interrupted", output.display(), why));
            }
            bar.set_message(format!("{angle_deg:.1} degrees"));
            let drawn = sequence.draw(&scene)?;
            let pixels = &drawn.picture.pixels;
            let file = match &mut sink {
                Sink::Animated(animation) => animation.add(pixels).map(|()| None),
                Sink::Numbered => {
                    let path = self.turn.frame_path(frames.len() as u32);
                    write_picture_with(&path, pixels, self.backdrop, &(self.texts)(&scene)?)
                        .map(|()| Some(path))
                }
            }?;
            frames.push(Frame::of(file.as_deref(), angle_deg, &drawn));
            if let Some(of_first) = of_first.take() {
                first = Some(of_first(&drawn, &sequence.shadows()));
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        if matches!(sink, Sink::Animated(_)) && interrupt.has_come() {
            let why = format!("all {count} pictures are drawn; {kept}");
            return Err(Error::runtime("interrupted", output.display(), why));
        }
        match sink {
            Sink::Animated(animation) => animation.finish()?,
            Sink::Numbered => self.warn_of_others(),
        }
        let none = || Error::runtime("cannot render", output.display(), "there is no picture to a turn");
        Ok((first.ok_or_else(none)?, frames))
    }

    /// A longer turn may have been written there before: what shows all that is there would show its end.
    fn warn_of_others(&self) {
        let next = self.turn.frame_path(self.turn.count);
        if next.exists() {
            print_message(
                "warning",
                &format_args!("{} is from before and none of these pictures", next.display()),
            );
        }
    }
}

/// Shown on stderr where that is a terminal.
fn progress_bar(count: u32) -> Result<ProgressBar> {
    let style = ProgressStyle::with_template("{bar:20} {pos}/{len} about {eta} left, {wide_msg}")
        .map_err(|e| Error::runtime("cannot show progress", "stderr", e))?;
    Ok(ProgressBar::new(count.into()).with_style(style))
}
