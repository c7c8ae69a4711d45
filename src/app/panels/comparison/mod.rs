//! `File > Compare methods…`: the error-against-time table of what the view shows, made beside the window.
//!
//! The table is that of `umbravox compare` on the volume, transfer function and scene as they were when it was started;
//! what is done to them afterwards does not reach it.

mod form;
pub mod report;
mod results;
mod task;

use super::parts::complaint;
use crate::app::model::Model;
use crate::error::{Error, Result};
use crate::measure::journal::JOURNAL;
use crate::measure::progress::{StepKind, spoken};
use crate::measure::table::Row;
use crate::open::SceneSettings;
use crate::scene::Scene;
use eframe::egui;
use form::Form;
use report::Report;
use results::{Picked, Results};
use std::sync::Arc;
use std::time::Duration;
use task::{Finished, News, REMARK, Request, Task};

/// Of the window.
pub const TITLE: &str = "Comparison";

/// How often the window looks how far the table is. Each look is a frame of the interface, which takes time from methods
/// that are being timed.
const LOOK: Duration = Duration::from_millis(300);
const LOOK_WHILE_TIMING: Duration = Duration::from_millis(1000);

/// What is being done now.
struct Now {
    stage: StepKind,
    what: String,
    share: f32,
    left_s: Option<f64>,
}

/// The comparison window and what runs behind it.
#[derive(Default)]
pub struct Comparison {
    pub open: bool,
    form: Form,
    /// Fold the form away, once: rows need its place.
    fold: bool,
    running: Option<(Task, Option<Now>)>,
    /// How the last one ended.
    outcome: Option<Result<Box<Finished>>>,
    results: Results,
    pub report: Report,
}

impl Comparison {
    /// Share that is done of the one that runs.
    pub fn share(&self) -> Option<f32> {
        self.running.as_ref().map(|(_, now)| now.as_ref().map_or(0.0, |now| now.share))
    }

    /// The rows that are shown, in the table's order.
    pub fn rows(&self) -> Vec<Row> {
        self.results.rows().cloned().collect()
    }

    /// How the last comparison ended; `None` while one runs, or before the first.
    pub fn outcome(&self) -> Option<Result<(), &Error>> {
        self.outcome.as_ref().map(|outcome| outcome.as_ref().map(|_| ()))
    }

    /// Starts what the form says on what is shown.
    fn start(&mut self, model: &Model) {
        let Some(document) = &model.document else { return };
        let (methods, folder) = match (self.form.methods(), self.form.folder()) {
            (Ok(methods), Ok(folder)) => (methods, folder),
            (_, Err(e)) => return self.form.folder_error = Some(e),
            // Said beside its field.
            (Err(_), _) => return,
        };
        self.form.folder_error = None;
        let [width, height] = self.form.size;
        let scene = Scene { width, height, ..document.scene.clone() };
        let wanted = Request {
            settings: SceneSettings {
                masking: document.part_flags(),
                ..SceneSettings::of_scene(&document.spec, &scene, document.transparent)
            },
            adapter: model.adapter.clone(),
            volume: Arc::clone(&document.volume),
            strands: document.strands.clone(),
            tf: Arc::clone(&document.tf),
            scene,
            methods,
            effort: self.form.effort,
            folder,
            resume: self.form.resume,
        };
        self.results.clear();
        self.report.clear();
        self.outcome = None;
        match Task::start(wanted, Arc::clone(&model.wake)) {
            Ok(task) => {
                self.running = Some((task, None));
                self.fold = true;
            }
            Err(e) => self.outcome = Some(Err(e)),
        }
    }

    /// Takes what the comparison's thread has said, and looks again soon.
    pub fn take_news(&mut self, model: &mut Model, context: &egui::Context) {
        let Some((task, now)) = &mut self.running else { return };
        let (mut ended, rows) = (None, self.results.rows().len());
        for news in task.news() {
            match news {
                News::Starts { stage, what, share, left_s } => {
                    *now = Some(Now { stage, what, share, left_s })
                }
                News::Row { place, row } => self.results.put(place, *row),
                News::Ended(outcome) => ended = Some(outcome),
            }
        }
        let timing = now.as_ref().is_some_and(|now| now.stage == StepKind::Run);
        context.request_repaint_after(if timing { LOOK_WHILE_TIMING } else { LOOK });
        if self.results.rows().len() > rows {
            // The table takes its new height a frame later.
            context.request_repaint();
        }
        let Some(outcome) = ended else { return };
        self.running = None;
        if let Ok(finished) = &outcome {
            self.results.finish(finished.rows.clone());
        }
        if !self.open {
            let said = match &outcome {
                Ok(_) => "The comparison is done (T shows it)".to_owned(),
                Err(e) if e.is_cancelled() => "The comparison was cancelled".to_owned(),
                Err(e) => e.to_string(),
            };
            model.note(said);
        }
        self.outcome = Some(outcome);
    }

    /// Shows the window while it is open.
    pub fn show(&mut self, context: &egui::Context, model: &mut Model) {
        if !self.open {
            return;
        }
        let mut open = true;
        let view = model.view.unwrap_or(context.content_rect());
        let most = context.content_rect().size() - egui::vec2(40.0, 70.0);
        egui::Window::new(TITLE)
            .id(egui::Id::unique(TITLE))
            .open(&mut open)
            .default_pos(view.left_top() + egui::vec2(16.0, 16.0))
            // All columns, where the view has room for them.
            .default_size(egui::vec2((view.width() - 40.0).clamp(760.0, 1040.0), 660.0).min(most))
            .max_size(most)
            .vscroll(true)
            .show(context, |ui| self.contents(ui, model));
        self.open = open;
    }

    fn contents(&mut self, ui: &mut egui::Ui, model: &mut Model) {
        let running = self.running.is_some();
        let view_size = model.document.as_ref().map(|d| [d.scene.width, d.scene.height]);
        let title = egui::RichText::new("What to compare").strong();
        let fold = std::mem::take(&mut self.fold).then_some(false);
        egui::CollapsingHeader::new(title).default_open(true).open(fold).show(ui, |ui| {
            ui.add_enabled_ui(!running, |ui| self.form.show(ui, view_size));
        });
        ui.add_space(4.0);
        ui.horizontal_wrapped(|ui| self.buttons(ui, model));
        ui.weak(
            "The window draws with the same processor: left alone, it disturbs the times least. Every row says in its \
             note that it was open.",
        );
        self.show_outcome(ui);
        if self.results.rows().len() == 0 {
            return;
        }
        ui.separator();
        let current = model.document.as_ref().map(|d| d.method.clone());
        let picked = self.results.show(ui, current.as_ref());
        if let (Some(Picked { choice, shift }), Some(document)) = (picked, &mut model.document) {
            if shift {
                document.other = choice;
                model.split.share.get_or_insert(0.5);
            } else {
                document.method = choice;
            }
        }
    }

    /// Start, or how far it is, and Cancel.
    fn buttons(&mut self, ui: &mut egui::Ui, model: &Model) {
        if let Some((task, now)) = &self.running {
            let cancel = ui.add_enabled(!task.is_cancelled(), egui::Button::new("Cancel comparison"));
            if cancel
                .on_hover_text("Ends with the step that is being done; what is measured is kept")
                .clicked()
            {
                task.cancel();
            }
            let (share, what) = match now {
                _ if task.is_cancelled() => (now.as_ref().map_or(0.0, |n| n.share), "ending …".to_owned()),
                Some(now) => {
                    let left = now.left_s.map_or(String::new(), |s| format!(", about {} left", spoken(s)));
                    (now.share, format!("{}{left}", now.what))
                }
                None => (0.0, "opening the device".to_owned()),
            };
            let bar = egui::ProgressBar::new(share).desired_width(160.0).show_percentage();
            ui.add(bar).accessible_name("comparison progress");
            ui.label(what);
            return;
        }
        let ready = model.document.is_some() && self.form.methods().is_ok();
        let start = ui.add_enabled(ready, egui::Button::new("Start"));
        if start.on_hover_text("Measures what the view shows now, on a device of its own").clicked() {
            self.start(model);
        }
        match self.form.methods() {
            Ok(methods) => _ = ui.weak(format!("{} rows", methods.len())),
            Err(e) => complaint(ui, &e),
        }
    }

    fn show_outcome(&mut self, ui: &mut egui::Ui) {
        match &self.outcome {
            None => {}
            Some(Ok(finished)) => {
                self.report.show(ui, &finished.files.report);
                let others = finished.notes.iter().filter(|note| *note != REMARK);
                others.for_each(|note| _ = ui.weak(note));
            }
            Some(Err(e)) if e.is_cancelled() => {
                let kept = self.results.rows().filter(|row| !row.has_failed()).count();
                ui.label(format!(
                    "Cancelled at {}. {kept} rows are kept in {JOURNAL}, to go on with what the folder holds.",
                    e.place
                ));
            }
            Some(Err(e)) => {
                ui.colored_label(ui.visuals().error_fg_color, e.to_string());
                if let Some(hint) = &e.hint {
                    ui.weak(hint);
                }
            }
        }
    }
}
