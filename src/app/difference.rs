//! The difference of the shown methods from exact as a heat map over the view: the exact answer comes from a thread of
//! its own, coarse first, and the render thread compares the methods with it.

mod legend;

use super::engine::Engine;
use super::method_choice::MethodChoice;
use super::worker::{Event, Job, Speaker, Wake};
use super::{App, Asked};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::measure::error_map::{ErrorMap, ExactView, Quantity};
use crate::render::{DisplayTexture, Work};
use crate::report::heat::{inferno, round_max};
use crate::scene::Scene;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use eframe::egui;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Pixels of the view that one pixel of the heat map covers across, one after the other.
const LIGHT_DIVISORS: [f64; 5] = [16.0, 8.0, 4.0, 2.0, 1.0];
/// Exact pictures take a hundred times as long.
const PICTURE_DIVISORS: [f64; 6] = [24.0, 12.0, 6.0, 3.0, 2.0, 1.0];
/// Of a logarithmic scale.
const DECADES: f32 = 3.0;
/// Where nothing is seen there is no error.
const NOTHING_SEEN: [u8; 4] = [28, 30, 34, 255];

/// What the exact answer depends on.
#[derive(Debug, Clone, PartialEq)]
struct Subject {
    tf: Arc<TransferFunction>,
    scene: Scene,
    quantity: Quantity,
}

/// An exact answer on its way.
struct Computing {
    views: Receiver<ExactView>,
    cancelled: Arc<AtomicBool>,
}

impl Drop for Computing {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

/// Methods to compare with an exact answer.
#[derive(Debug, Clone)]
pub struct DifferenceRequest {
    view: Arc<ExactView>,
    tf: Arc<TransferFunction>,
    methods: Vec<MethodChoice>,
    logarithmic: bool,
}

/// One method's heat map.
pub struct DifferenceSide {
    pub spec: String,
    pub map: ErrorMap,
    pub texture: Arc<DisplayTexture>,
}

/// The heat maps of the shown methods, on one scale.
pub struct Differences {
    pub view: Arc<ExactView>,
    request: Arc<DifferenceRequest>,
    /// Left and right of the split, or the only one.
    pub sides: Vec<DifferenceSide>,
    /// The error at the scale's end.
    pub largest: f32,
}

/// What the window remembers of it.
#[derive(Default)]
pub struct DifferenceState {
    /// What is shown in place of the picture.
    pub shows: Option<Quantity>,
    /// Colours show the error's logarithm.
    pub logarithmic: bool,
    /// Of what the exact answer is, or will be.
    subject: Option<Subject>,
    computing: Option<Computing>,
    /// The finest answer so far.
    view: Option<Arc<ExactView>>,
    /// What methods were compared last, and with which answer.
    asked: Option<Arc<DifferenceRequest>>,
    pub found: Option<Differences>,
}

impl DifferenceState {
    /// What was chosen, without what has been found.
    pub fn only_choices(&self) -> Self {
        Self { shows: self.shows, logarithmic: self.logarithmic, ..Self::default() }
    }

    fn clear(&mut self) {
        *self = self.only_choices();
    }

    /// Whether nothing finer will come.
    pub fn is_done(&self) -> bool {
        let compared = match (&self.asked, &self.found) {
            (Some(asked), Some(found)) => Arc::ptr_eq(asked, &found.request),
            _ => false,
        };
        self.shows.is_none() || (self.computing.is_none() && compared)
    }
}

impl Computing {
    fn start(volume: Arc<Volume>, what: Subject, wake: Wake) -> Result<Self> {
        let (send, views) = channel();
        let cancelled = Arc::new(AtomicBool::new(false));
        let theirs = Arc::clone(&cancelled);
        // One core is left to whoever moves the mouse.
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get().saturating_sub(1).max(1));
        let failed = |why: String| Error::runtime("cannot compute the exact answer", "window", why);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| failed(e.to_string()))?;
        let work = move || {
            let field = ExactField::new(&volume, &what.tf);
            let divisors: &[f64] = match what.quantity {
                Quantity::Light => &LIGHT_DIVISORS,
                Quantity::Picture => &PICTURE_DIVISORS,
            };
            for divisor in divisors {
                let side = |n: u32| ((f64::from(n) / divisor).round() as u32).max(1);
                let scene = Scene {
                    width: side(what.scene.width),
                    height: side(what.scene.height),
                    ..what.scene.clone()
                };
                let go_on = || !theirs.load(Ordering::Relaxed);
                let view = pool.install(|| ExactView::new(&field, &scene, what.quantity, go_on));
                let Ok(Some(view)) = view else { return };
                if send.send(view).is_err() {
                    return;
                }
                wake();
            }
            drop(send);
            wake();
        };
        std::thread::Builder::new().name("exact".into()).spawn(work).map_err(|e| failed(e.to_string()))?;
        Ok(Self { views, cancelled })
    }
}

impl Engine {
    /// Compares methods with an exact answer.
    pub fn difference(
        &mut self,
        request: &Arc<DifferenceRequest>,
        go_on: impl Fn() -> bool,
        speaker: &Speaker,
    ) -> Result<()> {
        let Some(loaded) = &self.loaded else { return Ok(()) };
        let mut work = Work::default();
        self.kept.set_transfer(&self.renderer, loaded, &request.tf, &mut work)?;
        let scene = &request.view.scene;
        let mut found = Vec::new();
        for choice in &request.methods {
            let (spec, method) = (choice.spec(), choice.method()?);
            self.kept.prepare(&self.renderer, loaded, (&spec, method.as_ref()), scene, &mut work)?;
            let (Some(transfer), Some(shadow)) = (self.kept.transfer(), self.kept.shadow(&spec, scene.light))
            else {
                return Ok(());
            };
            let Some(map) = request.view.errors(&self.renderer, loaded, transfer, shadow, &go_on)? else {
                speaker.say(Event::DifferenceUnfinished(Arc::clone(request)));
                return Ok(());
            };
            found.push((spec, map));
        }
        let largest = found.iter().map(|(_, map)| round_max(&map.errors.mapv(f32::abs))).fold(0.0, f32::max);
        let sides = found
            .into_iter()
            .map(|(spec, map)| {
                let pixels: Vec<u8> =
                    map.errors.iter().flat_map(|e| colour(*e, largest, request.logarithmic)).collect();
                let gpu = self.renderer.gpu();
                let texture = Arc::new(DisplayTexture::from_srgb8(gpu, scene.width, scene.height, &pixels)?);
                Ok(DifferenceSide { spec, map, texture })
            })
            .collect::<Result<Vec<_>>>()?;
        let view = Arc::clone(&request.view);
        speaker.say(Event::Differences(Box::new(Differences {
            view,
            request: Arc::clone(request),
            sides,
            largest,
        })));
        Ok(())
    }
}

fn colour(error: f32, largest: f32, logarithmic: bool) -> [u8; 4] {
    if error.is_nan() {
        return NOTHING_SEEN;
    }
    let share = error.abs() / largest.max(f32::MIN_POSITIVE);
    let share = if logarithmic { 1.0 + share.log10() / DECADES } else { share };
    let [r, g, b] = inferno(f64::from(share)).0;
    [r, g, b, 255]
}

impl App {
    /// Keeps the exact answer in step with what is shown: begun when the hand rests, ended when anything changes.
    pub(super) fn follow_difference(&mut self) {
        let (Some(quantity), Some(document)) = (self.difference.shows, &self.document) else {
            self.difference.clear();
            return;
        };
        let subject = Subject { tf: Arc::clone(&document.tf), scene: document.scene.clone(), quantity };
        if self.difference.subject.as_ref() != Some(&subject) {
            self.difference.clear();
            // While a hand moves the picture is what is of interest.
            if !self.view.settled {
                return;
            }
            let volume = Arc::clone(&document.volume);
            match Computing::start(volume, subject.clone(), Arc::clone(&self.wake)) {
                Ok(computing) => {
                    self.difference.subject = Some(subject);
                    self.difference.computing = Some(computing);
                }
                Err(e) => {
                    self.difference.shows = None;
                    return self.fail(&e);
                }
            }
        }
        self.take_exact_views();
        self.compare_with_exact();
    }

    fn take_exact_views(&mut self) {
        let Some(computing) = &self.difference.computing else { return };
        loop {
            match computing.views.try_recv() {
                Ok(view) => self.difference.view = Some(Arc::new(view)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    self.difference.computing = None;
                    break;
                }
            }
        }
    }

    fn compare_with_exact(&mut self) {
        let state = &self.difference;
        let (Some(view), Some(Subject { tf, .. }), Some(Asked { method, other, .. })) =
            (&state.view, &state.subject, &self.asked)
        else {
            return;
        };
        let methods: Vec<_> = std::iter::once(method).chain(other).cloned().collect();
        let logarithmic = self.difference.logarithmic;
        let known = self.difference.asked.as_ref().is_some_and(|asked| {
            Arc::ptr_eq(&asked.view, view) && asked.methods == methods && asked.logarithmic == logarithmic
        });
        if known || !self.view.settled {
            return;
        }
        let (view, tf) = (Arc::clone(view), Arc::clone(tf));
        let request = Arc::new(DifferenceRequest { view, tf, methods, logarithmic });
        self.difference.asked = Some(Arc::clone(&request));
        self.worker.push(Job::Difference(request));
    }

    /// Takes heat maps, unless they are of something that is no longer shown.
    pub(super) fn take_differences(&mut self, found: Differences) {
        let wanted = self.difference.asked.as_ref().is_some_and(|a| Arc::ptr_eq(a, &found.request));
        if wanted {
            self.difference.found = Some(found);
        }
    }

    /// Asks again for what something else came before, unless that was a newer request.
    pub(super) fn difference_unfinished(&mut self, request: &Arc<DifferenceRequest>) {
        if self.difference.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, request)) {
            self.difference.asked = None;
        }
    }

    /// Shows the picture again where a comparison has failed; why is said.
    pub(super) fn difference_failed(&mut self) {
        let waits = match (&self.difference.asked, &self.difference.found) {
            (Some(asked), Some(found)) => !Arc::ptr_eq(asked, &found.request),
            (asked, _) => asked.is_some(),
        };
        if waits {
            self.difference.shows = None;
        }
    }

    /// What is compared, as a choice.
    pub(super) fn difference_choice(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            ui.label("Error");
            let choices = [
                (None, "off", "Show the picture (D)"),
                (
                    Some(Quantity::Light),
                    "light",
                    "Light on what each pixel sees, method less exact: transmittance, 0 to 1 (D)",
                ),
                (
                    Some(Quantity::Picture),
                    "picture",
                    "The picture without shading, method less exact: the channel that is farthest off, linear RGB. \
                     An exact picture takes minutes; it is shown as it grows (D)",
                ),
            ];
            for (value, name, tooltip) in choices {
                ui.selectable_value(&mut self.difference.shows, value, name).on_hover_text(tooltip);
            }
            if self.difference.shows.is_some() {
                let log = ui.toggle_value(&mut self.difference.logarithmic, "log");
                log.on_hover_text("Three decades of the error: small ones show beside large ones");
            }
        });
    }

    /// Off, light, picture, off.
    pub(super) fn next_difference(&mut self) {
        self.difference.shows = match self.difference.shows {
            None => Some(Quantity::Light),
            Some(Quantity::Light) => Some(Quantity::Picture),
            Some(Quantity::Picture) => None,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_errors_are_lighter_on_both_scales() {
        for logarithmic in [false, true] {
            let light = |error: f32| {
                let [r, g, b, _] = colour(error, 0.5, logarithmic).map(f64::from);
                0.2126 * r + 0.7152 * g + 0.0722 * b
            };
            let steps = [0.01, 0.05, 0.1, 0.25, 0.5].map(light);
            assert!(steps.windows(2).all(|w| w[0] < w[1]), "{steps:?}");
            assert_eq!(colour(-0.3, 0.5, logarithmic), colour(0.3, 0.5, logarithmic));
            assert_eq!(colour(f32::INFINITY, 0.5, logarithmic), colour(0.5, 0.5, logarithmic));
            assert_eq!(
                colour(0.0, 0.5, logarithmic),
                colour(1e-9, 0.5, logarithmic),
                "the scale's beginning"
            );
            assert_eq!(colour(f32::NAN, 0.5, logarithmic), NOTHING_SEEN);
        }
        // A thousandth of the largest is the beginning of the logarithmic scale.
        assert_eq!(colour(0.5e-3, 0.5, true), colour(0.0, 0.5, true));
        assert!(colour(0.5e-2, 0.5, true)[0] > 50);
    }
}
