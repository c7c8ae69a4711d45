//! Window (`File > Compare methods…`) that compares shadow methods on the open volume in the background. It measures
//! the same table as `umbravox compare`.
//!
//! Volume, transfer function and scene are copied at the start; later edits do not change the table.

mod form;
mod results;
mod task;

use super::widgets::error_label;
use crate::app::model::Model;
use crate::engine::task::Task;
use crate::error::{Error, Result};
use crate::measure::journal::JOURNAL;
use crate::measure::progress::{StepKind, spoken};
use crate::measure::table::Row;
use crate::open::SceneSettings;
use crate::render::DisabledOptimizations;
use crate::report::make::Subject;
use crate::scene::Scene;
use eframe::egui;
use form::Form;
use results::Results;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::TryRecvError;
use std::time::Duration;
use task::{CurrentStep, FinishedTable, REMARK, TableRequest, Update};

/// Title of the window that compares shadow methods.
pub const TITLE: &str = "Comparison";

/// Maximum time for which closing the window waits for the current measurement of a comparison of shadow methods.
const LAST_STEP: Duration = Duration::from_secs(3);
/// Interval between two updates of the progress display while shadow methods are compared. Each update draws a frame
/// of the user interface, which disturbs timings.
const REFRESH: Duration = Duration::from_millis(300);
const REFRESH_WHILE_TIMING: Duration = Duration::from_millis(1000);

/// Function that opens a file in another program, such as the report of a comparison of shadow methods in a web
/// browser.
pub type Opener = fn(&Path) -> std::io::Result<()>;

/// Window that compares shadow methods on the open volume in a background task.
#[derive(Default)]
pub struct Comparison {
    pub open: bool,
    form: Form,
    /// Whether the comparison form collapses in the next frame, to make space for the table of measured results.
    collapse: bool,
    running: Option<(Task<Update>, Option<CurrentStep>)>,
    outcome: Option<Result<Box<FinishedTable>>>,
    results: Results,
    /// Function that opens the report of a comparison of shadow methods. `None` uses the system's default program.
    pub opener: Option<Opener>,
    open_error: Option<Error>,
}

impl Drop for Comparison {
    /// Cancels a running comparison of shadow methods and waits for its current measurement, which uses the graphics
    /// device.
    fn drop(&mut self) {
        self.running.iter().for_each(|(task, _)| task.end_within(LAST_STEP));
    }
}

impl Comparison {
    /// Completed fraction of the running comparison of shadow methods, 0 to 1; `None` while none runs.
    pub fn share(&self) -> Option<f32> {
        self.running.as_ref().map(|(_, step)| step.as_ref().map_or(0.0, |step| step.share))
    }

    /// Rows measured so far of the table that compares shadow methods, unsorted.
    pub fn rows(&self) -> Vec<Row> {
        self.results.rows().cloned().collect()
    }

    /// Success or error of the last comparison of shadow methods; `None` while one runs, or before the first.
    pub fn outcome(&self) -> Option<Result<(), &Error>> {
        self.outcome.as_ref().map(|outcome| outcome.as_ref().map(|_| ()))
    }

    fn start(&mut self, model: &Model) {
        let (Some(document), Ok(methods)) = (&model.document, self.form.methods()) else { return };
        let folder = match self.form.folder() {
            Ok(folder) => folder,
            Err(e) => return self.form.folder_error = Some(e),
        };
        let [width, height] = self.form.size;
        let scene = Scene { width, height, ..document.scene.clone() };
        let request = TableRequest {
            settings: SceneSettings {
                masking: document.part_flags(),
                ..SceneSettings::of_scene(&document.spec, &scene, document.transparent)
            },
            device: model.device.clone(),
            subject: Subject {
                volume: Arc::clone(&document.volume),
                strands: document.strands.clone(),
                tf: (*document.tf).clone(),
                scene,
                forced: DisabledOptimizations::NONE,
            },
            methods,
            effort: self.form.effort,
            folder,
            resume: self.form.resume,
        };
        self.results.replace(Vec::new());
        (self.form.folder_error, self.open_error, self.outcome) = (None, None, None);
        match task::start(request, Arc::clone(&model.wake)) {
            Ok(task) => (self.running, self.collapse) = (Some((task, None)), true),
            Err(e) => self.outcome = Some(Err(e)),
        }
    }

    /// Handles the progress, table rows and final result that the background comparison of shadow methods has sent.
    pub fn take_updates(&mut self, model: &mut Model, context: &egui::Context) {
        let Some((task, step)) = &mut self.running else { return };
        let (mut ended, rows) = (None, self.results.rows().len());
        while ended.is_none() {
            match task.poll() {
                Ok(Update::Step(current)) => *step = Some(current),
                Ok(Update::Row(place, row)) => self.results.put(place, *row),
                Ok(Update::Ended(outcome)) => ended = Some(outcome),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    ended =
                        Some(Err(Error::runtime("cannot compare", "window", "an internal error occurred")));
                }
            }
        }
        let timing = step.as_ref().is_some_and(|step| step.kind == StepKind::Run);
        context.request_repaint_after(if timing { REFRESH_WHILE_TIMING } else { REFRESH });
        if self.results.rows().len() > rows {
            // The table takes its new height one frame later.
            context.request_repaint();
        }
        let Some(outcome) = ended else { return };
        self.running = None;
        if let Ok(finished) = &outcome {
            self.results.replace(finished.rows.clone());
        }
        if !self.open {
            model.note(match &outcome {
                Ok(_) => "The comparison is done (T shows it)".to_owned(),
                Err(e) if e.is_cancelled() => "The comparison was cancelled".to_owned(),
                Err(e) => e.to_string(),
            });
        }
        self.outcome = Some(outcome);
    }

    /// Shows the window that compares shadow methods, if it is open.
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
            // Wide enough for all columns where possible.
            .default_size(egui::vec2((view.width() - 40.0).clamp(760.0, 1040.0), 660.0).min(most))
            .max_size(most)
            .vscroll(true)
            .show(context, |ui| self.contents(ui, model));
        self.open = open;
    }

    fn contents(&mut self, ui: &mut egui::Ui, model: &mut Model) {
        let is_idle = self.running.is_none();
        let view_size = model.document.as_ref().map(|d| [d.scene.width, d.scene.height]);
        let title = egui::RichText::new("What to compare").strong();
        let collapse = std::mem::take(&mut self.collapse).then_some(false);
        egui::CollapsingHeader::new(title).default_open(true).open(collapse).show(ui, |ui| {
            ui.add_enabled_ui(is_idle, |ui| self.form.show(ui, view_size));
        });
        ui.add_space(4.0);
        ui.horizontal_wrapped(|ui| self.buttons(ui, model));
        ui.weak("The window draws with the same processor: leave it alone for the best timing.");
        self.show_outcome(ui);
        if self.results.rows().len() == 0 {
            return;
        }
        ui.separator();
        let Some(document) = &mut model.document else { return };
        match self.results.show(ui, &document.method) {
            Some((method, false)) => document.method = method,
            Some((method, true)) => {
                document.other = method;
                model.split.share.get_or_insert(0.5);
            }
            None => {}
        }
    }

    /// Shows the Start button of the comparison window; while shadow methods are compared, shows the progress and a
    /// Cancel button.
    fn buttons(&mut self, ui: &mut egui::Ui, model: &Model) {
        if let Some((task, step)) = &self.running {
            let cancel = ui.add_enabled(!task.is_cancelled(), egui::Button::new("Cancel comparison"));
            if cancel.on_hover_text("Ends after the current step; measured rows stay").clicked() {
                task.cancel();
            }
            let what = match step {
                _ if task.is_cancelled() => "cancelling …".to_owned(),
                Some(CurrentStep { what, left_s: Some(s), .. }) => {
                    format!("{what}, about {} left", spoken(*s))
                }
                Some(step) => step.what.clone(),
                None => "opening the device".to_owned(),
            };
            let bar = egui::ProgressBar::new(self.share().unwrap_or(0.0));
            ui.add(bar.desired_width(160.0).show_percentage()).accessible_name("comparison progress");
            ui.label(what);
            return;
        }
        let methods = self.form.methods();
        let start = ui.add_enabled(model.document.is_some() && methods.is_ok(), egui::Button::new("Start"));
        if start.on_hover_text("Compares methods on the current document, on a separate device").clicked() {
            self.start(model);
        }
        match methods {
            Ok(methods) => _ = ui.weak(format!("{} rows", methods.len())),
            Err(e) => error_label(ui, &e),
        }
    }

    fn show_outcome(&mut self, ui: &mut egui::Ui) {
        match &self.outcome {
            None => {}
            Some(Ok(finished)) => {
                let path = &finished.files.report;
                let text = path.display().to_string();
                ui.horizontal_wrapped(|ui| {
                    let button =
                        ui.button("Open report").on_hover_text("Table, plots and pictures in one page");
                    if button.clicked() {
                        let failed = |e| Error::runtime("cannot open the report", path.display(), e);
                        let opener = self.opener.unwrap_or(|path| open::that_detached(path));
                        self.open_error = opener(path).err().map(failed);
                    }
                    if ui.button("Copy path").clicked() {
                        ui.ctx().copy_text(text.clone());
                    }
                });
                ui.add(egui::Label::new(egui::RichText::new(text).monospace()).wrap());
                if let Some(e) = &self.open_error {
                    ui.colored_label(ui.visuals().error_fg_color, e.to_string());
                }
                finished.notes.iter().filter(|note| *note != REMARK).for_each(|note| _ = ui.weak(note));
            }
            Some(Err(e)) if e.is_cancelled() => {
                let rows = self.results.rows().filter(|row| !row.has_failed()).count();
                ui.label(format!(
                    "Cancelled at {}. {rows} rows are in {JOURNAL}; Resume reuses them.",
                    e.place
                ));
            }
            Some(Err(e)) => {
                ui.colored_label(ui.visuals().error_fg_color, e.to_string());
                e.hint.iter().for_each(|hint| _ = ui.weak(hint));
            }
        }
    }
}
