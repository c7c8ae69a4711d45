//! What the render thread does for one wanted picture: coarse at once while a hand moves, whole when it rests.

use super::method_choice::MethodChoice;
use super::open::Opened;
use super::worker::{Event, Frame, Mailbox, Side, Speaker, Wanted};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::render::{DisplayTexture, Kept, LoadedVolume, Pace, Renderer, Screen, Stage, Work};
use crate::scene::Scene;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A submission keeps the queue, which the window draws through too, no longer than about this. A software adapter draws
/// the window in tens of milliseconds itself: shorter bands would leave it most of the time.
const BAND_MS: f64 = 12.0;
const SOFTWARE_BAND_MS: f64 = 35.0;
/// What a picture may take while a hand moves, shadow map included.
const MOVING_MS: f64 = 75.0;
/// A whole picture that takes no longer is drawn at once.
const AT_ONCE_MS: f64 = 90.0;
/// The hand rests when it has not moved for so long.
const REST: Duration = Duration::from_millis(140);
/// Sides of a coarse map and divisors of a coarse picture: few, so that neighbouring pictures look alike.
const MAP_SIDES: [u32; 7] = [512, 384, 256, 192, 128, 96, 64];
const DIVISORS: [f64; 9] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0];
/// The eye-ray step is this much longer while a hand moves, and longer still where pixels alone would become too large.
const MOVING_STEP: f64 = 2.0;
const LONGEST_MOVING_STEP: f64 = 5.0;
/// Pixels so large ask for the longer step, and pixels so small for the shorter one.
const TOO_LARGE: f64 = 6.0;
const SMALL_ENOUGH: f64 = 2.0;

/// How a picture is drawn.
#[derive(Debug, Clone, PartialEq)]
struct Quality {
    width: u32,
    height: u32,
    step: f64,
    /// For each of the two methods.
    choices: Vec<MethodChoice>,
}

/// A picture as drawn, to tell when there is nothing to do.
#[derive(Debug, Clone, PartialEq)]
struct Shown {
    scene: Scene,
    quality: Quality,
}

/// What the last pictures have taught about this adapter and scene.
struct Speeds {
    whole: Pace,
    moving: Pace,
    /// Milliseconds that a texel of a shadow map takes to build, by method.
    build_ms_per_texel: Vec<(&'static str, f64)>,
    /// How much longer the step is while a hand moves.
    moving_step: f64,
}

pub struct Engine {
    pub(super) renderer: Renderer,
    pub(super) loaded: Option<LoadedVolume>,
    pub(super) kept: Kept,
    textures: Vec<Arc<DisplayTexture>>,
    speeds: Speeds,
    shown: Option<Shown>,
}

impl Engine {
    pub fn new(gpu: Gpu) -> Self {
        let software = gpu.info.device_type == wgpu::DeviceType::Cpu;
        let submission_ms = if software { SOFTWARE_BAND_MS } else { BAND_MS };
        let (whole, moving) = (Pace::new(submission_ms), Pace::new(submission_ms));
        Self {
            renderer: Renderer::live(gpu, submission_ms),
            loaded: None,
            kept: Kept::default(),
            textures: Vec::new(),
            speeds: Speeds { whole, moving, build_ms_per_texel: Vec::new(), moving_step: MOVING_STEP },
            shown: None,
        }
    }

    /// Lets go of everything that may be half made.
    pub fn forget(&mut self) {
        self.loaded = None;
        self.kept = Kept::default();
        self.textures.clear();
        self.shown = None;
    }

    /// Takes a volume onto the device; where that fails the old one stays.
    pub fn upload(&mut self, mut opened: Opened, speaker: &Speaker) -> Result<()> {
        let loaded = self.renderer.load(Arc::clone(&opened.volume))?;
        opened.bricks = loaded.bricks.len();
        self.loaded = Some(loaded);
        self.kept = Kept::default();
        self.shown = None;
        speaker.say(Event::Opened(Box::new(opened)));
        Ok(())
    }

    /// Draws what is wanted and says so; refines it unless something else comes up meanwhile. Whether it is done: what a
    /// probe interrupts has to be asked for again.
    pub fn show(&mut self, wanted: &Wanted, mailbox: &Mailbox, speaker: &Speaker) -> Result<bool> {
        let Some(loaded) = &self.loaded else { return Ok(true) };
        let mut work = Work::default();
        let change = self.kept.set_transfer(&self.renderer, loaded, &wanted.tf, &mut work)?;
        if change.is_some_and(|c| c.invalidates(Stage::Frame)) {
            self.shown = None;
        }
        let whole = self.whole(wanted);
        let shown = Shown { scene: wanted.scene.clone(), quality: whole.clone() };
        if self.shown.as_ref() == Some(&shown) {
            speaker.say(Event::Unchanged { revision: wanted.revision });
            return Ok(true);
        }
        if self.expected_ms(&whole, wanted) > AT_ONCE_MS {
            let moving = self.moving(wanted);
            if moving != whole {
                self.shown = None;
                let frame = self.draw(wanted, &moving, false, work, || true)?;
                if let Some(frame) = frame {
                    speaker.say(Event::Frame(Box::new(frame)));
                }
                // What the change cost counts for the whole picture, too, but not the coarse map.
                work.build_ms = None;
                if mailbox.wait_for_news(REST) {
                    return Ok(false);
                }
            }
        }
        let frame = self.draw(wanted, &whole, true, work, || !mailbox.interrupted())?;
        let Some(frame) = frame else { return Ok(false) };
        self.shown = Some(shown);
        speaker.say(Event::Frame(Box::new(frame)));
        Ok(true)
    }

    fn whole(&self, wanted: &Wanted) -> Quality {
        let choices = std::iter::once(&wanted.method).chain(&wanted.other).cloned().collect();
        let Scene { width, height, step, .. } = wanted.scene;
        Quality { width, height, step, choices }
    }

    /// Milliseconds that a map would take to build, where it has to be; unknown before the first of its kind.
    fn build_ms(&self, choice: &MethodChoice, wanted: &Wanted) -> f64 {
        let made = |loaded: &LoadedVolume| self.kept.has(loaded, &choice.spec(), &wanted.scene);
        if self.loaded.as_ref().is_some_and(made) {
            return 0.0;
        }
        let Some(map) = choice.map() else { return 0.0 };
        let known = self.speeds.build_ms_per_texel.iter().find(|(name, _)| *name == choice.name);
        known.map_or(MOVING_MS, |(_, ms)| ms * f64::from(map) * f64::from(map))
    }

    fn expected_ms(&self, quality: &Quality, wanted: &Wanted) -> f64 {
        let pixels = f64::from(quality.width) * f64::from(quality.height) * quality.choices.len() as f64;
        let build: f64 = quality.choices.iter().map(|c| self.build_ms(c, wanted)).sum();
        build + pixels / self.speeds.whole.pixels_per_ms()
    }

    /// What can be drawn in the time that a moving hand leaves.
    fn moving(&mut self, wanted: &Wanted) -> Quality {
        let whole = self.whole(wanted);
        let count = whole.choices.len() as f64;
        let choices: Vec<MethodChoice> = whole
            .choices
            .iter()
            .map(|choice| {
                let fits =
                    |side: &&u32| self.build_ms(&choice.coarse(**side), wanted) <= 0.5 * MOVING_MS / count;
                choice.coarse(MAP_SIDES.iter().find(fits).copied().unwrap_or(MAP_SIDES[MAP_SIDES.len() - 1]))
            })
            .collect();
        let build: f64 = choices.iter().map(|c| self.build_ms(c, wanted)).sum();
        let left_ms = (MOVING_MS - build).max(0.3 * MOVING_MS) / count;
        let pixels = f64::from(whole.width) * f64::from(whole.height);
        let fits = |d: &&f64| pixels / (*d * *d) <= left_ms * self.speeds.moving.pixels_per_ms();
        let divisor = DIVISORS.iter().find(fits).copied().unwrap_or(DIVISORS[DIVISORS.len() - 1]);
        if divisor > TOO_LARGE {
            self.speeds.moving_step = LONGEST_MOVING_STEP;
        } else if divisor <= SMALL_ENOUGH {
            self.speeds.moving_step = MOVING_STEP;
        }
        let side = |n: u32| ((f64::from(n) / divisor).round() as u32).max(1);
        Quality {
            width: side(whole.width),
            height: side(whole.height),
            step: (whole.step * self.speeds.moving_step).min(8.0).max(whole.step),
            choices,
        }
    }

    /// Draws every side; `None` where `go_on` ended it.
    fn draw(
        &mut self,
        wanted: &Wanted,
        quality: &Quality,
        whole: bool,
        mut work: Work,
        go_on: impl Fn() -> bool,
    ) -> Result<Option<Frame>> {
        let Some(loaded) = &self.loaded else { return Ok(None) };
        let scene = Scene {
            width: quality.width,
            height: quality.height,
            step: quality.step,
            ..wanted.scene.clone()
        };
        let mut sides = Vec::with_capacity(2);
        let mut longest_band_ms = 0.0_f64;
        for choice in &quality.choices {
            let (spec, method) = (choice.spec(), choice.method()?);
            let mut built = Work::default();
            self.kept.prepare(&self.renderer, loaded, (&spec, method.as_ref()), &scene, &mut built)?;
            if let Some(ms) = built.build_ms {
                *work.build_ms.get_or_insert(0.0) += ms;
                self.speeds.learn_build(choice, ms);
            }
            if !go_on() {
                return Ok(None);
            }
            let texture =
                take_texture(&mut self.textures, self.renderer.gpu(), quality.width, quality.height)?;
            let missing = || Error::runtime("cannot draw", "shadow map", "it was not kept");
            let transfer = self.kept.transfer().ok_or_else(missing)?;
            let shadow = self.kept.shadow(&spec, scene.light).ok_or_else(missing)?;
            let pace = if whole { &mut self.speeds.whole } else { &mut self.speeds.moving };
            let screen = Screen { target: &texture, pace };
            let drawn = self.renderer.draw_to(screen, (loaded, transfer), shadow, &scene, &go_on)?;
            let Some(drawn) = drawn else { return Ok(None) };
            longest_band_ms = longest_band_ms.max(drawn.longest_band_ms);
            sides.push(Side {
                texture,
                spec,
                report: shadow.report,
                bound: shadow.bound,
                left_out: drawn.plan.left_out,
                frame_ms: drawn.span.best().0,
            });
        }
        let drawn_ms = sides.iter().map(|s: &Side| s.frame_ms).sum::<f64>();
        let Quality { width, height, .. } = *quality;
        tracing::debug!(
            "{width} x {height}, {}: {work:?}, rays {drawn_ms:.1} ms, longest band {longest_band_ms:.1} ms, \
             {:.0} ms since the hand",
            quality.choices[0].spec(),
            wanted.since.elapsed().as_secs_f64() * 1e3
        );
        let mut sides = sides.into_iter();
        let Some(main) = sides.next() else { return Ok(None) };
        Ok(Some(Frame {
            main,
            other: sides.next(),
            whole,
            work,
            latency_ms: Instant::now().duration_since(wanted.since).as_secs_f64() * 1e3,
            longest_band_ms,
            revision: wanted.revision,
        }))
    }
}

impl Speeds {
    fn learn_build(&mut self, choice: &MethodChoice, ms: f64) {
        let Some(map) = choice.map() else { return };
        let now = ms / (f64::from(map) * f64::from(map)).max(1.0);
        match self.build_ms_per_texel.iter_mut().find(|(name, _)| *name == choice.name) {
            Some((_, known)) => *known = 0.5 * (*known + now),
            None => self.build_ms_per_texel.push((choice.name, now)),
        }
    }
}

/// A texture of that size which nobody shows any more.
fn take_texture(
    textures: &mut Vec<Arc<DisplayTexture>>,
    gpu: &Gpu,
    width: u32,
    height: u32,
) -> Result<Arc<DisplayTexture>> {
    let free = |t: &Arc<DisplayTexture>| Arc::strong_count(t) == 1;
    let fits = |t: &Arc<DisplayTexture>| (t.width, t.height) == (width, height);
    if let Some(found) = textures.iter().find(|t| free(t) && fits(t)) {
        return Ok(Arc::clone(found));
    }
    // A view that is resized leaves textures of every size behind.
    if textures.len() >= 8 {
        textures.retain(|t| !free(t));
    }
    let made = Arc::new(DisplayTexture::new(gpu, width, height)?);
    textures.push(Arc::clone(&made));
    Ok(made)
}
