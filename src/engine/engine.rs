//! What the render thread does for one wanted picture: coarse at once while a hand moves, whole when it rests.

use super::device::OnDevice;
use super::mailbox::{Mailbox, Speaker};
use super::messages::{Event, Frame, Side, Wanted};
use super::quality::{Quality, Speeds};
use crate::engine::reading::{Opened, suited_shading};
use crate::engine::{MapCoverage, Stage, Work};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::render::{DisplayTexture, Screen};
use crate::scene::Scene;
use crate::shadow::{Bound, BuildReport};
use std::sync::Arc;
use std::time::Duration;

/// A submission keeps the queue, which the window draws through too, no longer than about this. A software adapter draws
/// the window in tens of milliseconds itself: shorter bands would leave it most of the time.
const BAND_MS: f64 = 12.0;
const SOFTWARE_BAND_MS: f64 = 35.0;
/// The hand rests when it has not moved for so long.
const REST: Duration = Duration::from_millis(140);

/// Draws pictures of what is on the device.
pub struct Engine {
    pub device: OnDevice,
    textures: Vec<Arc<DisplayTexture>>,
    speeds: Speeds,
    /// The picture as drawn, to tell when there is nothing to do.
    shown: Option<(Scene, Quality)>,
}

impl Engine {
    pub fn new(gpu: Gpu) -> Self {
        let software = gpu.info.device_type == wgpu::DeviceType::Cpu;
        let submission_ms = if software { SOFTWARE_BAND_MS } else { BAND_MS };
        Self {
            device: OnDevice::new(gpu, submission_ms),
            textures: Vec::new(),
            speeds: Speeds::new(submission_ms),
            shown: None,
        }
    }

    /// Lets go of everything that may be half made.
    pub fn forget(&mut self) {
        self.device.forget();
        self.textures.clear();
        self.shown = None;
    }

    /// Takes a volume onto the device; where that fails the old one stays.
    pub fn upload(&mut self, opened: Box<Opened>, speaker: &Speaker) -> Result<()> {
        self.device.load(&opened)?;
        self.shown = None;
        speaker.say(Event::Uploaded(opened));
        Ok(())
    }

    /// Draws what is wanted and says so; refines it unless something else comes up meanwhile. Whether it is done: what a
    /// probe interrupts has to be asked for again.
    pub fn show(&mut self, wanted: &Wanted, mailbox: &Mailbox, speaker: &Speaker) -> Result<bool> {
        if self.device.loaded.is_none() {
            return Ok(true);
        }
        let subject = &wanted.subject;
        let mut work = Work::default();
        let change = self.device.set_transfer(&subject.tf, &mut work)?;
        if change.is_some_and(|c| c.invalidates(Stage::Frame)) {
            self.shown = None;
        }
        let whole = Quality::whole(subject);
        let shown = (subject.scene.clone(), whole.clone());
        if self.shown.as_ref() == Some(&shown) {
            speaker.say(Event::Unchanged { revision: wanted.revision });
            return Ok(true);
        }
        if !self.speeds.at_once(&whole, subject, &self.device) {
            let moving = self.speeds.moving(&whole, subject, &self.device);
            if moving != whole {
                self.shown = None;
                if let Some(frame) = self.draw(wanted, &moving, false, work, || true)? {
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

    /// Draws every side; `None` where `go_on` ended it.
    fn draw(
        &mut self,
        wanted: &Wanted,
        quality: &Quality,
        whole: bool,
        mut work: Work,
        go_on: impl Fn() -> bool,
    ) -> Result<Option<Frame>> {
        let Quality { width, height, step, .. } = *quality;
        let scene = &wanted.subject.scene;
        // What is wanted may be of the volume before, for as long as nobody has heard of the one that is here.
        let shading = suited_shading(scene.shading, self.device.is_of_strands());
        let scene = Scene { width, height, step, shading, ..scene.clone() };
        let mut sides = Vec::with_capacity(2);
        let mut longest_band_ms = 0.0_f64;
        for choice in &quality.choices {
            let mut built = Work::default();
            let missing = self.device.missing(choice, &scene).max(1);
            let made = self.device.prepare(choice, (&scene, MapCoverage::Picture), &mut built)?;
            if let Some(ms) = built.build_ms {
                *work.build_ms.get_or_insert(0.0) += ms;
                let map = made.shadows.iter().map(|map| map.light_space.map_size).max().unwrap_or(0);
                self.speeds.learn_build(choice, map, ms / missing as f64);
            }
            if !go_on() {
                return Ok(None);
            }
            let texture = take_texture(&mut self.textures, made.renderer.gpu(), width, height)?;
            let pace = if whole { &mut self.speeds.whole } else { &mut self.speeds.moving };
            let screen = Screen { target: &texture, pace };
            let field = (made.loaded, made.transfer);
            let report = BuildReport::of_all(made.shadows.iter().copied());
            let bound = Bound::of_all(made.shadows.iter().copied());
            let drawn = made.renderer.draw_to(screen, field, made.shadows, &scene, &go_on)?;
            let Some(drawn) = drawn else { return Ok(None) };
            longest_band_ms = longest_band_ms.max(drawn.longest_band_ms);
            sides.push(Side {
                texture,
                spec: made.spec,
                report,
                bound,
                left_out: drawn.plan.left_out,
                frame_ms: drawn.span.best().0,
            });
        }
        let drawn_ms = sides.iter().map(|s: &Side| s.frame_ms).sum::<f64>();
        let latency_ms = wanted.since.elapsed().as_secs_f64() * 1e3;
        tracing::debug!(
            "{width} x {height}, {}: {work:?}, rays {drawn_ms:.1} ms, longest band {longest_band_ms:.1} ms, \
             {latency_ms:.0} ms since the hand",
            quality.choices[0].spec(),
        );
        let mut sides = sides.into_iter();
        let Some(main) = sides.next() else { return Ok(None) };
        let (other, revision) = (sides.next(), wanted.revision);
        Ok(Some(Frame { main, other, whole, work, latency_ms, longest_band_ms, revision }))
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
