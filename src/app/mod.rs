//! The window: a client of the library that holds no rendering logic.
//!
//! ```text
//!  hands ──> Document (volume, transfer function, method, scene) ──> Wanted ──> Worker (render thread) ──> Engine
//!                ^                                                                  │
//!                └── panels, editor, view  <── Event (frame, probe, export) <───────┘
//! ```
//! The window's thread draws widgets and the last finished picture, and never waits: volumes are read, tables and maps
//! made and pictures drawn elsewhere. The device is shared, so a picture is shown from the memory it was drawn into.

pub mod camera;
mod comparison;
pub mod curve;
pub mod difference;
mod document;
mod editor;
mod engine;
mod flicker;
mod grips;
mod help;
mod jobs;
pub mod method_choice;
mod open;
mod opening;
pub mod presets;
mod probe_panel;
mod prompt;
mod resume;
mod script;
mod settings;
mod shown;
mod side;
mod slices;
mod strands_panel;
mod timings;
mod top_bar;
mod viewport;
mod widgets;
mod window;
mod worker;

pub use comparison::Comparison;
pub use document::Document;
pub use jobs::{Aim, ProbeResult};
pub use open::With;
pub use prompt::Purpose;
pub use resume::Resume;
pub use script::Script;
pub use settings::Settings;
pub use window::{Start, run};
pub use worker::{Frame, Side};

use crate::error::{Error, Result};
use crate::files::picture::Backdrop;
use crate::gpu::{DeviceLoss, Gpu};
use crate::scene::{Camera, Scene};
use crate::transfer::TransferFunction;
use curve::{Edit, History};
use eframe::egui;
use eframe::egui_wgpu::RenderState;
use jobs::{Export, ProbeRequest};
use method_choice::MethodChoice;
use open::Opening;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use worker::{Event, Job, Wake, Wanted, Worker};

/// Two edits of one kind within this time are one step of undo.
const ONE_EDIT: Duration = Duration::from_millis(700);

/// A line at the bottom of the view.
#[derive(Debug, Clone)]
pub struct Message {
    pub text: String,
    pub hint: Option<String>,
    pub is_error: bool,
    since: Instant,
}

/// An export that is running: its file and the share that is done.
struct Exporting {
    path: String,
    share: f32,
}

/// The window's contents, apart from the window itself.
pub struct App {
    worker: Worker,
    adapter: String,
    loss: DeviceLoss,
    pub settings: Settings,
    pub document: Option<Document>,
    history: History,
    last_edit: Option<(std::mem::Discriminant<Edit>, Instant)>,
    opening: Option<Opening>,
    exporting: Option<Exporting>,
    /// The last finished picture.
    pub frame: Option<Frame>,
    /// What was asked of the render thread last, to ask for nothing twice.
    asked: Option<Asked>,
    /// Split between the two methods, as a share of the view's width.
    pub split: Option<f32>,
    /// Both pictures of the split in turn over the whole view.
    flicker: Option<flicker::Flicker>,
    pub probe: Option<ProbeResult>,
    /// Where to probe again whenever something changes, world mm.
    probe_at: Option<glam::DVec3>,
    probed: Option<Asked>,
    pub messages: Vec<Message>,
    view: viewport::ViewState,
    editor: editor::EditorState,
    slices: slices::SliceState,
    /// Small pictures of the presets.
    pub presets: presets::PresetState,
    /// Heat maps of the shown methods' errors.
    pub difference: difference::DifferenceState,
    prompt: prompt::PromptState,
    strands: strands_panel::StrandsState,
    pub comparison: Comparison,
    timings: timings::Timings,
    show_help: bool,
    /// Of what was wanted last.
    revision: u64,
    /// Pictures that have come from the render thread.
    pub frames: u64,
    /// Times that a change turned out to reach no picture.
    pub unchanged: u64,
    wake: Wake,
    /// What was open on a device that was lost, until its volume is on the new one.
    resuming: Option<(Document, History, Option<Camera>)>,
}

/// All that decides a picture.
#[derive(Debug, Clone, PartialEq)]
struct Asked {
    tf: Arc<TransferFunction>,
    method: MethodChoice,
    other: Option<MethodChoice>,
    scene: Scene,
}

impl App {
    /// Starts the render thread on `gpu`; `context` is woken when there is news.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn new(gpu: Gpu, context: &egui::Context, settings: Settings) -> Result<Self> {
        let (adapter, loss) = (gpu.info.name.clone(), gpu.loss());
        let context = context.clone();
        let wake: Wake = Arc::new(move || context.request_repaint());
        Ok(Self {
            worker: Worker::start(gpu, Arc::clone(&wake))?,
            adapter,
            loss,
            settings,
            document: None,
            history: History::default(),
            last_edit: None,
            opening: None,
            exporting: None,
            frame: None,
            asked: None,
            split: None,
            flicker: None,
            probe: None,
            probe_at: None,
            probed: None,
            messages: Vec::new(),
            view: Default::default(),
            editor: Default::default(),
            slices: Default::default(),
            presets: Default::default(),
            difference: Default::default(),
            prompt: Default::default(),
            strands: Default::default(),
            comparison: Default::default(),
            timings: Default::default(),
            show_help: false,
            revision: 0,
            frames: 0,
            unchanged: 0,
            wake,
            resuming: None,
        })
    }

    /// Says that something failed; what is shown stays.
    pub fn fail(&mut self, error: &Error) {
        tracing::info!("{error}");
        self.say(error.to_string(), error.hint.clone(), true);
    }

    fn note(&mut self, text: impl Into<String>) {
        self.say(text.into(), None, false);
    }

    fn say(&mut self, text: String, hint: Option<String>, is_error: bool) {
        self.messages.retain(|m| m.text != text);
        self.messages.push(Message { text, hint, is_error, since: Instant::now() });
        if self.messages.len() > 5 {
            self.messages.remove(0);
        }
    }

    /// Edits the transfer function; edits of one kind in quick succession are one step of undo.
    pub fn edit(&mut self, edit: Edit) {
        let Some(document) = &mut self.document else { return };
        match curve::apply(&document.tf, edit) {
            Ok(tf) if tf == *document.tf => {}
            Ok(tf) => {
                let kind = std::mem::discriminant(&edit);
                let goes_on = self.last_edit.is_some_and(|(k, when)| k == kind && when.elapsed() < ONE_EDIT);
                if !goes_on {
                    self.history.note(Arc::clone(&document.tf));
                }
                self.last_edit = Some((kind, Instant::now()));
                document.tf = Arc::new(tf);
            }
            Err(why) => self.note(why),
        }
    }

    /// Puts another transfer function in place, as one step of undo.
    fn replace_tf(&mut self, tf: TransferFunction, source: Option<String>) {
        let Some(document) = &mut self.document else { return };
        self.history.note(Arc::clone(&document.tf));
        self.last_edit = None;
        document.tf = Arc::new(tf);
        if let Some(source) = source {
            document.tf_source = (source, Arc::clone(&document.tf));
        }
        self.editor.selected = None;
    }

    /// Takes a transfer function from a preset's name or a file.
    pub fn load_tf(&mut self, name_or_path: &str) {
        let Some(document) = &self.document else {
            return self.note("open a volume first: a transfer function has no meaning without one");
        };
        match crate::open::presets::resolve(name_or_path, &document.volume) {
            Ok(found) => {
                self.replace_tf(found.tf, Some(name_or_path.to_owned()));
                self.messages.extend(found.note.map(|text| Message {
                    text,
                    hint: None,
                    is_error: false,
                    since: Instant::now(),
                }));
            }
            Err(e) => self.fail(&e),
        }
    }

    /// Writes the transfer function's file.
    pub fn save_tf(&mut self, path: &Path) {
        let Some(document) = &mut self.document else { return };
        match document.tf.write(path) {
            Ok(()) => {
                document.tf_source = (path.display().to_string(), Arc::clone(&document.tf));
                self.note(format!("saved {}", path.display()));
            }
            Err(e) => self.fail(&e),
        }
    }

    /// Writes a scene file that the command line draws to the same pixels.
    pub fn save_scene(&mut self, path: &Path) {
        let Some(document) = &self.document else { return };
        match document.write_scene(path) {
            Ok(()) => self.note(format!("saved {}", path.display())),
            Err(e) => self.fail(&e),
        }
    }

    /// Draws and writes a picture of any size, away from the window, with or without its background.
    pub fn export(&mut self, path: &Path, [width, height]: [u32; 2], backdrop: Backdrop) {
        let Some(document) = &self.document else { return };
        if let Err(e) = crate::files::output::check_output(path, crate::files::picture::PICTURE_EXTENSIONS) {
            return self.fail(&e);
        }
        // What is to go over another background is drawn over black: nothing has to be taken away again.
        let background = match backdrop {
            Backdrop::Drawn => document.scene.background,
            Backdrop::LeftOut => [0.0; 3],
        };
        self.worker.push(Job::Export(Export {
            path: path.into(),
            tf: Arc::clone(&document.tf),
            method: document.method.clone(),
            scene: Scene { width, height, background, ..document.scene.clone() },
            backdrop,
        }));
        self.exporting = Some(Exporting { path: path.display().to_string(), share: 0.0 });
    }

    pub fn undo(&mut self) {
        let Some(document) = &mut self.document else { return };
        if let Some(tf) = self.history.undo(&document.tf) {
            document.tf = tf;
            self.last_edit = None;
        }
    }

    pub fn redo(&mut self) {
        let Some(document) = &mut self.document else { return };
        if let Some(tf) = self.history.redo(&document.tf) {
            document.tf = tf;
            self.last_edit = None;
        }
    }

    /// Probes what is seen along a ray, or a point.
    pub fn probe(&mut self, aim: Aim) {
        let Some(document) = &self.document else { return };
        let mut methods = vec![document.method.clone()];
        if self.split.is_some() && document.other != document.method {
            methods.push(document.other.clone());
        }
        // A setting that is being typed has no answer.
        methods.retain(|m| m.method().is_ok());
        self.worker.push(Job::Probe(ProbeRequest {
            aim,
            tf: Arc::clone(&document.tf),
            light: document.scene.light,
            ambient: document.scene.ambient,
            methods,
        }));
    }

    /// Whether the last picture is of full quality and of what is wanted now.
    pub fn is_settled(&self) -> bool {
        self.opening.is_none() && self.exporting.is_none() && self.view.settled
    }

    /// Takes what other threads have done.
    fn take_news(&mut self) {
        if let Some(outcome) = self.opening.as_ref().and_then(|o| o.poll(&self.worker)) {
            self.opening = None;
            if let Err(e) = outcome {
                self.view.next_method = None;
                self.fail(&e);
            }
        }
        let events: Vec<Event> = self.worker.events().collect();
        for event in events {
            match event {
                Event::Opened(opened) => self.take_volume(*opened),
                Event::Frame(frame) => {
                    self.frames += 1;
                    self.timings.note(&frame);
                    self.view.settled = frame.whole && frame.revision == self.revision;
                    self.frame = Some(*frame);
                }
                Event::Unchanged { revision } => {
                    self.unchanged += 1;
                    self.view.settled = revision == self.revision;
                }
                Event::Probed(result) => {
                    self.probe_at = Some(result.point);
                    self.editor.picked = Some(result.value);
                    self.slices.go_to(self.document.as_ref(), result.point);
                    self.probe = Some(*result);
                }
                Event::Thumbnail(thumbnail) => self.take_thumbnail(*thumbnail),
                Event::Differences(found) => self.take_differences(*found),
                Event::ExportProgress(share) => {
                    if let Some(exporting) = &mut self.exporting {
                        exporting.share = share;
                    }
                }
                Event::Exported(exported) => {
                    self.exporting = None;
                    match exported.result {
                        Ok(true) => self.note(format!("wrote {}", exported.path.display())),
                        Ok(false) => self.note("export cancelled; nothing was written"),
                        Err(e) => self.fail(&e),
                    }
                }
                Event::DifferenceUnfinished(request) => self.difference_unfinished(&request),
                Event::Failed(error) => {
                    self.difference_failed();
                    self.view.settled = true;
                    self.fail(&error);
                }
            }
        }
        // Notes leave by themselves, errors stay until they are closed.
        self.messages.retain(|m| m.is_error || m.since.elapsed() < Duration::from_secs(8));
    }

    /// Asks for a picture of what the document says now, unless that was asked last.
    fn ask(&mut self) {
        let Some(document) = &self.document else { return };
        if document.method.method().is_err() {
            return;
        }
        let other = self.split.is_some().then(|| document.other.clone()).filter(|o| o.method().is_ok());
        let now = Asked {
            tf: Arc::clone(&document.tf),
            method: document.method.clone(),
            other,
            scene: document.scene.clone(),
        };
        if self.asked.as_ref() != Some(&now) {
            self.view.settled = false;
            self.revision += 1;
            self.worker.want(Wanted {
                tf: Arc::clone(&now.tf),
                method: now.method.clone(),
                other: now.other.clone(),
                scene: now.scene.clone(),
                since: Instant::now(),
                revision: self.revision,
            });
            self.asked = Some(now);
        }
        // The probe's curves follow once the hand rests.
        if let Some(point) = self.probe_at.filter(|_| self.view.settled && self.probe.is_some()) {
            let differs = |a: &Asked, b: &Asked| {
                a.tf != b.tf || a.method != b.method || a.other != b.other || a.scene.light != b.scene.light
            };
            let stale = match (&self.probed, &self.asked) {
                (Some(before), Some(now)) => differs(before, now),
                _ => false,
            };
            if stale {
                self.probe(Aim::Point(point));
            }
            self.probed.clone_from(&self.asked);
        }
    }

    /// One frame of the interface. Without a `render_state` pictures are drawn but not shown (tests).
    pub fn show(&mut self, ui: &mut egui::Ui, render_state: Option<&RenderState>) {
        self.take_news();
        self.take_comparison_news(ui.ctx());
        let theme = if self.settings.dark { egui::Theme::Dark } else { egui::Theme::Light };
        ui.ctx().set_theme(theme);
        self.take_dropped_files(ui.ctx());
        self.shortcuts(ui.ctx());
        self.top_bar(ui);
        self.side_panel(ui);
        self.editor_panel(ui, render_state);
        self.central(ui, render_state);
        self.comparison_window(ui.ctx());
        self.prompt_window(ui.ctx());
        self.probe_window(ui.ctx());
        self.help_window(ui.ctx());
        self.ask();
        self.follow_difference();
        self.tick_flicker(ui.ctx());
        if self.opening.is_some() {
            ui.ctx().request_repaint_after(Duration::from_millis(100));
        }
    }
}

/// The frame of a panel without its fill: the window is cleared to that colour.
fn unfilled(ui: &egui::Ui) -> egui::Frame {
    egui::Frame::side_top_panel(ui.style()).fill(egui::Color32::TRANSPARENT)
}
