//! Heat maps that show the error of each shadow method in place of the picture. A background thread computes the
//! exact reference picture, coarse first, and the render thread compares each method with it.

mod exact;
pub mod legend;

use crate::app::model::Model;
use crate::engine::messages::{DifferenceRequest, Differences, FrameSettings, Job};
use crate::engine::task::Task;
use crate::measure::error_map::{ExactView, Quantity};
use eframe::egui;
use exact::Question;
use std::sync::Arc;
use std::sync::mpsc::TryRecvError;

/// State of the error heat maps in the viewer: displayed quantity, exact reference picture, and computed heat maps.
#[derive(Default)]
pub struct Difference {
    /// Quantity whose error the heat maps show: transmittance from the light at visible points, or picture colour.
    /// `None` shows the picture instead.
    pub shows: Option<Quantity>,
    /// Whether the colour scale of the error heat maps is logarithmic.
    pub logarithmic: bool,
    /// Inputs of the exact reference picture whose computation was started last.
    question: Option<Question>,
    computing: Option<Task<ExactView>>,
    /// Exact reference picture for the error heat maps, at the finest resolution computed so far.
    view: Option<Arc<ExactView>>,
    /// Last request to the render thread for error heat maps of the shadow methods.
    requested: Option<Arc<DifferenceRequest>>,
    pub found: Option<Differences>,
}

impl Difference {
    /// Copy of the user's choices for the error heat maps (quantity and colour scale), without computed heat maps.
    pub fn only_choices(&self) -> Self {
        Self { shows: self.shows, logarithmic: self.logarithmic, ..Self::default() }
    }

    /// Whether the error heat maps are off, or show their finest resolution.
    pub fn is_done(&self) -> bool {
        self.shows.is_none() || (self.computing.is_none() && self.is_compared())
    }

    /// Whether the error heat maps that were requested last have arrived from the render thread.
    fn is_compared(&self) -> bool {
        self.found.as_ref().is_some_and(|found| self.is_last(&found.request))
    }

    /// Restarts the computation of the exact reference picture after the scene, transfer function or quantity has
    /// changed, once the rendered picture has full quality.
    pub fn follow(&mut self, model: &mut Model) {
        let (Some(quantity), Some(document)) = (self.shows, &model.document) else {
            *self = self.only_choices();
            return;
        };
        let scene = match quantity {
            // The transmittance error is that of the edited light, independent of the light's colour.
            Quantity::Light => document.scene.under(document.light().uncolored()),
            Quantity::Picture | Quantity::Bound => document.scene.clone(),
        };
        let question = Question { tf: Arc::clone(&document.tf), scene, quantity };
        if self.question.as_ref() != Some(&question) {
            *self = self.only_choices();
            // During interaction the picture has priority.
            if !model.settled {
                return;
            }
            let subject = (Arc::clone(&document.volume), document.strands.clone());
            match exact::start(subject, question.clone(), Arc::clone(&model.wake)) {
                Ok(computing) => {
                    self.question = Some(question);
                    self.computing = Some(computing);
                }
                Err(e) => {
                    self.shows = None;
                    return model.fail(&e);
                }
            }
        }
        while let Some(computing) = &self.computing {
            // Bounds are computed for each resolution in turn, since only the render thread has work with them.
            if quantity == Quantity::Bound && self.view.is_some() && !self.is_compared() {
                break;
            }
            match computing.poll() {
                Ok(view) => self.view = Some(Arc::new(view)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => self.computing = None,
            }
        }
        self.compare(model);
    }

    /// Requests error heat maps of the shadow methods against the finest exact reference picture, unless these were
    /// requested last.
    fn compare(&mut self, model: &Model) {
        let (Some(view), Some(FrameSettings { tf, methods, .. })) = (&self.view, &model.requested) else {
            return;
        };
        let logarithmic = self.logarithmic;
        let known = self.requested.as_ref().is_some_and(|requested| {
            Arc::ptr_eq(&requested.view, view)
                && requested.methods == *methods
                && requested.logarithmic == logarithmic
        });
        if known || !model.settled {
            return;
        }
        let (view, tf, methods) = (Arc::clone(view), Arc::clone(tf), methods.clone());
        let request = Arc::new(DifferenceRequest { view, tf, methods, logarithmic });
        self.requested = Some(Arc::clone(&request));
        model.thread.push(Job::Difference(request));
    }

    /// Whether `request` is the last request for error heat maps.
    fn is_last(&self, request: &Arc<DifferenceRequest>) -> bool {
        self.requested.as_ref().is_some_and(|requested| Arc::ptr_eq(requested, request))
    }

    /// Stores error heat maps from the render thread if they belong to the last request for heat maps.
    pub fn take(&mut self, found: Differences) {
        if self.is_last(&found.request) {
            self.found = Some(found);
        }
    }

    /// Requests error heat maps again after an interruption, unless a newer request for heat maps exists.
    pub fn request_again(&mut self, request: &Arc<DifferenceRequest>) {
        if self.is_last(request) {
            self.requested = None;
        }
    }

    /// Turns the error heat maps off after the render thread failed to compute them.
    pub fn fail(&mut self) {
        if self.requested.is_some() && !self.is_compared() {
            self.shows = None;
        }
    }

    /// Shows the buttons that turn the error heat maps off or select their quantity: transmittance or picture colour.
    pub fn choice(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            ui.label("Error");
            let choices = [
                (None, "off", "Show the picture (D)"),
                (
                    Some(Quantity::Light),
                    "light",
                    "Transmittance of the edited light at visible points, method minus exact, 0 to 1 (D)",
                ),
                (
                    Some(Quantity::Picture),
                    "picture",
                    "Picture, method minus exact: the channel with the largest error, linear RGB. An exact picture \
                     takes minutes and is refined step by step (D)",
                ),
                (
                    Some(Quantity::Bound),
                    "bound",
                    "Estimated bound on the error of the picture that render --certify 0.03 draws. Both \
                     methods have to be dsm, with enclose=on, which takes many times as long to build",
                ),
            ];
            for (value, name, tooltip) in choices {
                ui.selectable_value(&mut self.shows, value, name).on_hover_text(tooltip);
            }
            if self.shows.is_some() {
                let log = ui.toggle_value(&mut self.logarithmic, "log");
                log.on_hover_text("Logarithmic scale over three decades");
            }
        });
    }

    /// Switches the error heat maps to the next of three states: off, transmittance error, colour error. Bounds, which
    /// only some methods have, are turned off.
    pub fn show_next(&mut self) {
        self.shows = match self.shows {
            None => Some(Quantity::Light),
            Some(Quantity::Light) => Some(Quantity::Picture),
            Some(Quantity::Picture | Quantity::Bound) => None,
        };
    }
}
