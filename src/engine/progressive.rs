//! Progressive rendering: a coarse picture at once during interaction, and full quality when the user's input pauses.

use super::cached_session::{CachedSession, DevicePages};
use super::mailbox::{EventSender, Mailbox};
use super::messages::{Event, Frame, FrameRequest, FrameSettings, MethodFrame};
use super::quality::{Quality, Speeds};
use super::reading::{OpenedVolume, suitable_shading};
use super::reduced_copy::{ReducedCopy, reserve};
use super::shadow_cache::{Building, MapCoverage, ReusePolicy, ShadowCache, Work};
use crate::error::Result;
use crate::field::DeferredPasses;
use crate::gpu::Gpu;
use crate::render::{DisabledOptimizations, DisplayTexture, LightMaps, Renderer, Screen};
use crate::scene::Scene;
use crate::shadow::{Bound, BuildReport, MethodSpec};
use crate::transfer::TransferChange;
use std::sync::Arc;
use std::time::Duration;

/// Target duration of one GPU submission during rendering, ms. It is short because the window draws through the same
/// queue. A software adapter needs tens of milliseconds for the window itself and uses `SOFTWARE_BAND_MS`.
const BAND_MS: f64 = 12.0;
const SOFTWARE_BAND_MS: f64 = 35.0;
/// Time without user input after which the picture is rendered at full quality.
const REST: Duration = Duration::from_millis(140);
/// Maximum number of picture textures that the renderer keeps for reuse, e.g. while the view is resized.
const MAX_TEXTURES: usize = 8;

/// Progressive renderer: renders each requested picture first coarsely, then at full quality.
pub struct ProgressiveRenderer {
    pub session: CachedSession,
    /// Copy of the volume for coarse pictures, if its pages exceed the device memory.
    pub reduced: ReducedCopy,
    textures: Vec<Arc<DisplayTexture>>,
    speeds: Speeds,
    /// Settings of the last picture rendered at full quality, used to skip a request for an identical picture.
    shown: Option<(Scene, Quality)>,
}

impl ProgressiveRenderer {
    pub fn new(gpu: Gpu) -> Self {
        let for_copy = gpu.memory_limit.map_or(0, reserve);
        let gpu = gpu.with_memory_reserve(for_copy);
        let software = gpu.info.device_type == wgpu::DeviceType::Cpu;
        let submission_ms = if software { SOFTWARE_BAND_MS } else { BAND_MS };
        let renderer = Arc::new(Renderer::live(gpu, submission_ms));
        let cache = ShadowCache::new(ShadowCache::INTERACTIVE, ReusePolicy::Covering);
        Self {
            session: CachedSession::new(renderer, DisabledOptimizations::NONE, cache),
            reduced: ReducedCopy::default(),
            textures: Vec::new(),
            speeds: Speeds::new(submission_ms),
            shown: None,
        }
    }

    /// Removes the volume, its lookup tables, shadow maps and picture textures, since a failure may have left them
    /// incomplete.
    pub fn reset(&mut self) {
        self.session.unload();
        self.reduced = ReducedCopy::default();
        self.textures.clear();
        self.shown = None;
    }

    /// Uploads a volume to the graphics device. On failure the previous volume stays.
    pub fn upload(&mut self, opened: Box<OpenedVolume>, events: &EventSender) -> Result<()> {
        self.session.load(Arc::clone(&opened.volume), opened.strands.clone())?;
        self.reduced = ReducedCopy::default();
        self.shown = None;
        events.send(Event::Uploaded(opened));
        Ok(())
    }

    /// Renders a requested picture coarsely if needed, then at full quality. Returns `false` if another request
    /// interrupted it.
    pub fn show(&mut self, request: &FrameRequest, mailbox: &Mailbox, events: &EventSender) -> Result<bool> {
        if self.session.loaded.is_none() {
            return Ok(true);
        }
        let settings = &request.settings;
        let mut work = Work::default();
        let change = self.session.set_transfer(&settings.tf, &mut work)?;
        if change != TransferChange::Nothing {
            self.shown = None;
        }
        let full = Quality::full(settings);
        let shown = (settings.scene.clone(), full.clone());
        if self.shown.as_ref() == Some(&shown) {
            events.send(Event::Unchanged { revision: request.revision });
            return Ok(true);
        }
        if self.session.streams() && !self.reduce(settings, mailbox, events) {
            return Ok(false);
        }
        if let Some(coarse) = self.coarse(&full, settings) {
            self.shown = None;
            match self.draw(request, &coarse, false, work, || true) {
                Ok(frame) => frame.into_iter().for_each(|frame| events.send(Event::Frame(Box::new(frame)))),
                Err(error) if self.session.streams() => self.reduced.fail(&error, events),
                Err(error) => return Err(error),
            }
            // The full-quality picture reports the time of the tables, but not that of the coarse map.
            work.build_ms = None;
            if mailbox.wait_for_request(REST) {
                return Ok(false);
            }
        }
        let pages = self.session.pages();
        let proceed = || {
            let resident = pages.iter().map(DevicePages::resident).filter(|pages| pages.blocks.is_some());
            resident.for_each(|pages| events.send(Event::Pages(pages)));
            !mailbox.has_requests()
        };
        let frame = self.draw(request, &full, true, work, proceed)?;
        let Some(frame) = frame else { return Ok(false) };
        self.shown = Some(shown);
        events.send(Event::Frame(Box::new(frame)));
        Ok(true)
    }

    /// Makes the reduced copy of a volume that is drawn block by block. Returns `false` if a request ended the wait for it.
    fn reduce(&mut self, settings: &FrameSettings, mailbox: &Mailbox, events: &EventSender) -> bool {
        let set = |copy: &mut CachedSession| copy.set_transfer(&settings.tf, &mut Work::default());
        match self.reduced.session(&self.session, mailbox).and_then(|copy| copy.map(set).transpose()) {
            Ok(Some(_)) => true,
            Ok(None) => !mailbox.has_requests(),
            Err(error) => {
                self.reduced.fail(&error, events);
                true
            }
        }
    }

    /// Returns the quality of a coarse picture that comes before one at full quality; `None` if that takes little time, or
    /// if the volume is drawn block by block and has no reduced copy.
    fn coarse(&mut self, full: &Quality, settings: &FrameSettings) -> Option<Quality> {
        if self.session.streams() {
            return Some(self.speeds.coarse(full, settings, self.reduced.ready()?));
        }
        let is_fast = self.speeds.is_fast(full, settings, &self.session);
        let coarse = (!is_fast).then(|| self.speeds.coarse(full, settings, &self.session))?;
        (coarse != *full).then_some(coarse)
    }

    /// Renders the picture of each shadow method at a given quality. Returns `None` if `proceed` stopped the
    /// rendering.
    fn draw(
        &mut self,
        request: &FrameRequest,
        quality: &Quality,
        is_final: bool,
        mut work: Work,
        proceed: impl Fn() -> bool,
    ) -> Result<Option<Frame>> {
        let Quality { width, height, step, .. } = *quality;
        let scene = &request.settings.scene;
        // A request may be older than the volume on the device.
        let drawn_by = drawn_by(&mut self.session, &mut self.reduced, is_final);
        let shading = suitable_shading(scene.shading, drawn_by.has_strands());
        let scene = Scene { width, height, step, shading, ..scene.clone() };
        let mut sides = Vec::with_capacity(2);
        let mut longest_band_ms = 0.0_f64;
        let gpu = self.session.renderer.gpu();
        let joint = gpu.tuning.joint_submission && gpu.timestamp_period_ns.is_some();
        for spec in &quality.methods {
            let side = self.draw_side(spec, &scene, is_final, joint, &mut work, &proceed)?;
            let Some((side, band_ms)) = side else { return Ok(None) };
            longest_band_ms = longest_band_ms.max(band_ms);
            sides.push(side);
        }
        let latency_ms = request.since.elapsed().as_secs_f64() * 1e3;
        tracing::debug!(
            "{width} x {height}, {:#}: {work:?}, rays {:.1} ms, longest band {longest_band_ms:.1} ms, latency \
             {latency_ms:.0} ms",
            quality.methods[0],
            sides.iter().map(|side| side.frame_ms).sum::<f64>(),
        );
        let mut sides = sides.into_iter();
        let Some(main) = sides.next() else { return Ok(None) };
        let pages = self.session.pages().map(|pages| pages.resident());
        let (other, revision) = (sides.next(), request.revision);
        let is_reduced = !is_final && self.session.streams();
        Ok(Some(Frame {
            main,
            other,
            is_final,
            is_reduced,
            work,
            latency_ms,
            longest_band_ms,
            pages,
            revision,
        }))
    }

    /// Renders the picture of one shadow method. With `joint`, the builds of its shadow maps are submitted with the
    /// picture. Returns also the longest time of a submission, ms; `None` if `proceed` stopped the rendering.
    fn draw_side(
        &mut self,
        spec: &MethodSpec,
        scene: &Scene,
        is_final: bool,
        joint: bool,
        work: &mut Work,
        proceed: &impl Fn() -> bool,
    ) -> Result<Option<(MethodFrame, f64)>> {
        let method = spec.method()?;
        let mut built = Work::default();
        let deferred = DeferredPasses::default();
        let extent = (scene, MapCoverage::Picture);
        let streams = self.session.streams();
        let session = drawn_by(&mut self.session, &mut self.reduced, is_final);
        let go_on = streams.then_some(proceed as &dyn Fn() -> bool);
        let building = Building { deferred: joint.then_some(&deferred), watch: None, go_on };
        let made = match session.prepare_with(method.as_ref(), extent, &mut built, building) {
            Err(error) if error.is_cancelled() => return Ok(None),
            made => made?,
        };
        let map = made.shadows.iter().map(|map| map.light_space.map_size).max().unwrap_or(0);
        let is_built = deferred.is_empty();
        // Builds block by block do not tell how long those of the copy take.
        let learns = !(streams && is_final);
        if is_built {
            record_build(learns.then_some(&mut self.speeds), (spec, map), built, work);
        }
        if !proceed() {
            return Ok(None);
        }
        let texture = take_texture(&mut self.textures, made.renderer.gpu(), scene.width, scene.height)?;
        let pace = if is_final { &mut self.speeds.full } else { &mut self.speeds.moving };
        let screen = Screen { target: &texture, pace };
        let shadows = LightMaps::from(made.shadows).after(&deferred);
        let drawn = made.renderer.draw_to(screen, (made.loaded, made.transfer), shadows, scene, proceed)?;
        let session = drawn_by(&mut self.session, &mut self.reduced, is_final);
        let is_complete = session.complete(method.as_ref(), deferred, &mut built)?;
        let Some(drawn) = drawn else { return Ok(None) };
        if !is_complete {
            // A map lacks memory: it is built alone, and grows.
            return self.draw_side(spec, scene, is_final, false, work, proceed);
        }
        if !is_built {
            record_build(learns.then_some(&mut self.speeds), (spec, map), built, work);
        }
        let session = drawn_by(&mut self.session, &mut self.reduced, is_final);
        let made = session.prepare(method.as_ref(), extent, &mut Work::default())?;
        let side = MethodFrame {
            texture,
            spec: format!("{spec:#}"),
            report: BuildReport::of_all(made.shadows.iter().copied()),
            bound: Bound::of_all(made.shadows.iter().map(|map| map.bound)),
            skipped: drawn.plan.left_out,
            frame_ms: drawn.span.best().0,
        };
        Ok(Some((side, drawn.longest_band_ms)))
    }
}

/// Returns the session that draws a picture: before the final one of a volume that is drawn block by block, that of its
/// reduced copy.
fn drawn_by<'a>(
    full: &'a mut CachedSession,
    reduced: &'a mut ReducedCopy,
    is_final: bool,
) -> &'a mut CachedSession {
    match reduced.ready() {
        Some(copy) if full.streams() && !is_final => copy,
        _ => full,
    }
}

/// Adds the build time of the shadow maps of a method to the work of a picture, and records it for later pictures.
fn record_build(speeds: Option<&mut Speeds>, (spec, map): (&MethodSpec, u32), built: Work, work: &mut Work) {
    if let Some(ms) = built.build_ms {
        *work.build_ms.get_or_insert(0.0) += ms;
        if let Some(speeds) = speeds {
            speeds.record_build(spec, map, ms / built.built.max(1) as f64);
        }
    }
}

/// Returns a texture of the given size for a picture: one that the window does not show any more, or a new one.
fn take_texture(
    textures: &mut Vec<Arc<DisplayTexture>>,
    gpu: &Gpu,
    width: u32,
    height: u32,
) -> Result<Arc<DisplayTexture>> {
    let is_free = |t: &Arc<DisplayTexture>| Arc::strong_count(t) == 1;
    let fits = |t: &Arc<DisplayTexture>| (t.width, t.height) == (width, height);
    if let Some(found) = textures.iter().find(|t| is_free(t) && fits(t)) {
        return Ok(Arc::clone(found));
    }
    if textures.len() >= MAX_TEXTURES {
        textures.retain(|t| !is_free(t));
    }
    let texture = Arc::new(DisplayTexture::new(gpu, width, height)?);
    textures.push(Arc::clone(&texture));
    Ok(texture)
}
