//! The difference of the shown methods from exact as a heat map over the view: the exact answer comes from a thread of
//! its own, coarse first, and the render thread compares the methods with it.

mod exact;
pub mod legend;

use crate::app::model::Model;
use crate::engine::messages::{DifferenceRequest, Differences, FrameSettings, Job};
use crate::measure::error_map::{ExactView, Quantity};
use eframe::egui;
use exact::{Computing, Question};
use std::sync::Arc;

/// What is compared, and what has been found.
#[derive(Default)]
pub struct Difference {
    /// What is shown in place of the picture.
    pub shows: Option<Quantity>,
    /// Colours show the error's logarithm.
    pub logarithmic: bool,
    /// What the exact answer is, or will be, to.
    question: Option<Question>,
    computing: Option<Computing>,
    /// The finest answer so far.
    view: Option<Arc<ExactView>>,
    /// What methods were compared last, and with which answer.
    asked: Option<Arc<DifferenceRequest>>,
    pub found: Option<Differences>,
}

impl Difference {
    /// What was chosen, without what has been found.
    pub fn only_choices(&self) -> Self {
        Self { shows: self.shows, logarithmic: self.logarithmic, ..Self::default() }
    }

    /// Whether nothing finer will come.
    pub fn is_done(&self) -> bool {
        let compared = match (&self.asked, &self.found) {
            (Some(asked), Some(found)) => Arc::ptr_eq(asked, &found.request),
            _ => false,
        };
        self.shows.is_none() || (self.computing.is_none() && compared)
    }

    /// Keeps the exact answer in step with what is shown: begun when the hand rests, ended when anything changes.
    pub fn follow(&mut self, model: &mut Model) {
        let (Some(quantity), Some(document)) = (self.shows, &model.document) else {
            *self = self.only_choices();
            return;
        };
        let scene = match quantity {
            // Transmittance is from the light that is edited, whatever its colour.
            Quantity::Light => document.scene.under(document.light().light.into()),
            Quantity::Picture => document.scene.clone(),
        };
        let question = Question { tf: Arc::clone(&document.tf), scene, quantity };
        if self.question.as_ref() != Some(&question) {
            *self = self.only_choices();
            // While a hand moves the picture is what is of interest.
            if !model.settled {
                return;
            }
            let subject = (Arc::clone(&document.volume), document.strands.clone());
            match Computing::start(subject, question.clone(), Arc::clone(&model.wake)) {
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
            match computing.poll() {
                (Some(view), _) => self.view = Some(Arc::new(view)),
                (None, true) => break,
                (None, false) => self.computing = None,
            }
        }
        self.compare(model);
    }

    /// Asks the render thread to compare what is shown with the finest answer, unless that was asked last.
    fn compare(&mut self, model: &Model) {
        let (Some(view), Some(FrameSettings { tf, methods, .. })) = (&self.view, &model.asked) else {
            return;
        };
        let logarithmic = self.logarithmic;
        let known = self.asked.as_ref().is_some_and(|asked| {
            Arc::ptr_eq(&asked.view, view) && asked.methods == *methods && asked.logarithmic == logarithmic
        });
        if known || !model.settled {
            return;
        }
        let (view, tf, methods) = (Arc::clone(view), Arc::clone(tf), methods.clone());
        let request = Arc::new(DifferenceRequest { view, tf, methods, logarithmic });
        self.asked = Some(Arc::clone(&request));
        model.push(Job::Difference(request));
    }

    fn was_asked(&self, request: &Arc<DifferenceRequest>) -> bool {
        self.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, request))
    }

    /// Takes heat maps, unless they are of something that is no longer shown.
    pub fn take(&mut self, found: Differences) {
        if self.was_asked(&found.request) {
            self.found = Some(found);
        }
    }

    /// Asks again for what something else came before, unless that was a newer request.
    pub fn ask_again(&mut self, request: &Arc<DifferenceRequest>) {
        if self.was_asked(request) {
            self.asked = None;
        }
    }

    /// Shows the picture again where a comparison has failed; why is said.
    pub fn fail(&mut self) {
        let waits = match (&self.asked, &self.found) {
            (Some(asked), Some(found)) => !Arc::ptr_eq(asked, &found.request),
            (asked, _) => asked.is_some(),
        };
        if waits {
            self.shows = None;
        }
    }

    /// What is compared, as a choice.
    pub fn choice(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            ui.label("Error");
            let choices = [
                (None, "off", "Show the picture (D)"),
                (
                    Some(Quantity::Light),
                    "light",
                    "Light on what each pixel sees, of the light that is edited, method less exact: transmittance, \
                     0 to 1 (D)",
                ),
                (
                    Some(Quantity::Picture),
                    "picture",
                    "The picture, method less exact: the channel that is farthest off, linear RGB. \
                     An exact picture takes minutes; it is shown as it grows (D)",
                ),
            ];
            for (value, name, tooltip) in choices {
                ui.selectable_value(&mut self.shows, value, name).on_hover_text(tooltip);
            }
            if self.shows.is_some() {
                let log = ui.toggle_value(&mut self.logarithmic, "log");
                log.on_hover_text("Three decades of the error: small ones show beside large ones");
            }
        });
    }

    /// Off, light, picture, off.
    pub fn show_next(&mut self) {
        self.shows = match self.shows {
            None => Some(Quantity::Light),
            Some(Quantity::Light) => Some(Quantity::Picture),
            Some(Quantity::Picture) => None,
        };
    }
}
