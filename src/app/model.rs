//! What is open, and what is asked of other threads. Nothing is painted here: panels show it and change it.

use super::camera;
use super::curve::Edit;
use super::document::Document;
use super::settings::Settings;
use super::split::Split;
use crate::engine::RenderThread;
use crate::engine::mailbox::Wake;
use crate::engine::messages::{
    Aim, Event, Export, Exported, Frame, Job, ProbeRequest, ProbeResult, Subject, Wanted,
};
use crate::engine::reading::{Beginning, Opened, Reading, With};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::output::check_output;
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS};
use crate::gpu::{DeviceLoss, Gpu};
use crate::open::{SceneRequest, SceneSettings, VolumeSpec, presets};
use crate::scene::AXIS_VIEWS;
use crate::scene::{Light, Scene};
use eframe::egui::Rect;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a note stays.
const NOTE_TIME: Duration = Duration::from_secs(8);
/// Lines that are shown at once.
const MOST_MESSAGES: usize = 5;

/// A line at the bottom of the view.
#[derive(Debug, Clone)]
pub struct Message {
    /// What happened.
    pub text: String,
    /// A way out.
    pub hint: Option<String>,
    /// It stays until it is closed.
    pub is_error: bool,
    since: Instant,
}

/// An export that is running: its file and the share that is done.
pub struct Exporting {
    /// The file.
    pub path: String,
    /// Of the picture, 0 to 1.
    pub share: f32,
}

/// The window's state as far as more than one panel knows it.
pub struct Model {
    thread: RenderThread,
    /// Called by other threads when there is news.
    pub wake: Wake,
    /// The graphics adapter's whole name.
    pub adapter: String,
    loss: DeviceLoss,
    /// What is remembered from one run to the next.
    pub settings: Settings,
    /// What is open.
    pub document: Option<Document>,
    /// A volume that is being read.
    pub reading: Option<Reading>,
    /// An export that is running.
    pub exporting: Option<Exporting>,
    /// The last finished picture.
    pub frame: Option<Frame>,
    /// What was asked of the render thread last, to ask for nothing twice.
    pub asked: Option<Subject>,
    /// The last picture is whole and of what is wanted.
    pub settled: bool,
    /// How the view is divided between two methods.
    pub split: Split,
    /// The probe's last answer.
    pub probe: Option<ProbeResult>,
    /// What was shown when the probe was asked last.
    probed: Option<Subject>,
    /// The light along whose ray the probe last asked.
    probed_light: Option<Light>,
    /// What is said below the view.
    pub messages: Vec<Message>,
    /// The view on screen, points.
    pub view: Option<Rect>,
    /// Of what was wanted last.
    revision: u64,
    /// Pictures that have come from the render thread.
    pub frames: u64,
    /// Times that a change turned out to reach no picture.
    pub unchanged: u64,
}

impl Model {
    /// Starts the render thread on `gpu`; `wake` is called when there is news.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn new(gpu: Gpu, wake: Wake, settings: Settings) -> Result<Self> {
        Ok(Self {
            adapter: gpu.info.name.clone(),
            loss: gpu.loss(),
            thread: RenderThread::start(gpu, Arc::clone(&wake))?,
            wake,
            settings,
            document: None,
            reading: None,
            exporting: None,
            frame: None,
            asked: None,
            settled: false,
            split: Split::default(),
            probe: None,
            probed: None,
            probed_light: None,
            messages: Vec::new(),
            view: None,
            revision: 0,
            frames: 0,
            unchanged: 0,
        })
    }

    /// Says that something failed; what is shown stays.
    pub fn fail(&mut self, error: &Error) {
        tracing::info!("{error}");
        self.say(error.to_string(), error.hint.clone(), true);
    }

    /// Says something that leaves by itself.
    pub fn note(&mut self, text: impl Into<String>) {
        self.say(text.into(), None, false);
    }

    /// Says something; errors stay until they are closed.
    pub fn say(&mut self, text: String, hint: Option<String>, is_error: bool) {
        self.messages.retain(|m| m.text != text);
        self.messages.push(Message { text, hint, is_error, since: Instant::now() });
        if self.messages.len() > MOST_MESSAGES {
            self.messages.remove(0);
        }
    }

    /// Says that a file was written, or why not.
    fn say_saved(&mut self, path: &Path, outcome: Result<()>) {
        match outcome {
            Ok(()) => self.note(format!("saved {}", path.display())),
            Err(e) => self.fail(&e),
        }
    }

    /// Whether the device is lost, and why.
    pub fn lost(&self) -> Option<String> {
        self.loss.reason()
    }

    // The document.

    /// Edits the transfer function; edits of one kind in quick succession are one step of undo.
    pub fn edit(&mut self, edit: Edit) {
        if let Some(Err(why)) = self.document.as_mut().map(|d| d.edit(edit)) {
            self.note(why);
        }
    }

    /// Takes a transfer function from a preset's name or a file.
    pub fn load_tf(&mut self, name_or_path: &str) {
        let Some(document) = &mut self.document else {
            return self.note("open a volume first: a transfer function has no meaning without one");
        };
        match presets::resolve_as(name_or_path, &document.volume, document.suiting) {
            Ok(found) => {
                document.replace_tf(found.tf, name_or_path.to_owned());
                found.warnings.into_iter().chain(found.notes).for_each(|text| self.note(text));
            }
            Err(e) => self.fail(&e),
        }
    }

    /// Writes the transfer function's file.
    pub fn save_tf(&mut self, path: &Path) {
        let Some(document) = &mut self.document else { return };
        let outcome = document.tf.write(path);
        if outcome.is_ok() {
            document.tf_source = (path.display().to_string(), Arc::clone(&document.tf));
            // It is in what was written.
            document.suiting.opacity_scale = None;
        }
        self.say_saved(path, outcome);
    }

    /// Writes a scene file that the command line draws to the same pixels.
    pub fn save_scene(&mut self, path: &Path) {
        let Some(document) = &self.document else { return };
        let outcome = document.write_scene(path);
        self.say_saved(path, outcome);
    }

    /// Takes back the last edit of the transfer function.
    pub fn undo(&mut self) {
        if let Some(document) = &mut self.document {
            document.history.undo(&mut document.tf);
        }
    }

    /// Does again what was taken back.
    pub fn redo(&mut self) {
        if let Some(document) = &mut self.document {
            document.history.redo(&mut document.tf);
        }
    }

    /// Looks from one of the six directions.
    pub fn look_from(&mut self, index: usize) {
        if let (Some(document), Some(view)) = (&mut self.document, AXIS_VIEWS.get(index)) {
            camera::look_from(&mut document.scene.camera, view);
        }
    }

    /// Back to the camera that the volume was opened with.
    pub fn reset_camera(&mut self) {
        if let Some(document) = &mut self.document {
            document.scene.camera = document.home;
        }
    }

    // Volumes on their way in.

    /// Starts to open a volume; the one that is open stays until the new one is there.
    pub fn open(&mut self, spec: VolumeSpec, with: With) {
        let wake = Arc::clone(&self.wake);
        match Reading::start(spec, with, move || wake()) {
            Ok(reading) => self.reading = Some(reading),
            Err(e) => self.fail(&e),
        }
    }

    /// Opens another volume by its path or name, with the scene's light and settings.
    pub fn open_source(&mut self, source: &str) {
        if source.to_lowercase().ends_with(".toml") {
            match SceneRequest::read(Path::new(source)).map(|request| request.settings) {
                Ok(settings) => self.open(settings.spec(), With::Settings(Box::new(settings))),
                Err(e) => self.fail(&e),
            }
        } else {
            self.open_as_is(VolumeSpec::new(source));
        }
    }

    fn open_as_is(&mut self, spec: VolumeSpec) {
        let with = match &self.document {
            Some(document) => With::Scene(Box::new(document.scene.clone())),
            None => With::Settings(Box::new(SceneSettings::of_volume(&spec))),
        };
        self.open(spec, with);
    }

    /// What is being read, while it is.
    pub fn loading(&self) -> Option<Arc<Loading>> {
        self.reading.as_ref().map(|o| Arc::clone(&o.loading))
    }

    /// Hands what has been read on to the device.
    pub fn take_reading(&mut self) {
        let Some(outcome) = self.reading.as_ref().and_then(Reading::poll) else { return };
        self.reading = None;
        match outcome {
            Ok(opened) => self.push(Job::Upload(Box::new(opened))),
            Err(e) => self.fail(&e),
        }
    }

    /// Goes on with what was open on a device that was lost.
    pub fn resume(&mut self, document: Document) {
        self.push(Job::Upload(Box::new(document.opened())));
        self.document = Some(document);
    }

    /// Shows a volume that is on the device now; `false` where it has to be read again.
    pub fn take_volume(&mut self, mut opened: Opened) -> bool {
        self.settings.opened(&opened.spec.source);
        let notes = std::mem::take(&mut opened.notes);
        match (opened.beginning.take(), &mut self.document) {
            (Some(beginning), _) => self.begin(opened, beginning),
            // It was open on a device that was lost.
            (None, Some(document)) if Arc::ptr_eq(&document.volume, &opened.volume) => {}
            (None, Some(document)) if document.spec.source == opened.spec.source => {
                document.take_voxels(opened);
            }
            // Something else was opened meanwhile: these are strands that nothing is known of any more.
            _ => {
                self.open_as_is(opened.spec);
                return false;
            }
        }
        self.probe = None;
        self.asked = None;
        notes.into_iter().for_each(|n| self.note(n));
        true
    }

    fn begin(&mut self, opened: Opened, mut beginning: Beginning) {
        let old = self.document.take();
        beginning.transparent.get_or_insert(old.as_ref().is_some_and(|d| d.transparent));
        let method = beginning.method.take().or_else(|| old.as_ref().map(|d| d.method.clone()));
        let methods = [method, old.map(|d| d.other)].map(Option::unwrap_or_default);
        self.document = Some(Document::new(opened, beginning, methods));
        self.frame = None;
    }

    // The render thread.

    /// Asks the render thread for something besides the picture.
    pub fn push(&self, job: Job) {
        self.thread.push(job);
    }

    /// What the render thread has said since the last time.
    pub fn events(&self) -> Vec<Event> {
        self.thread.events()
    }

    /// Whether the last picture is of full quality and of what is wanted now.
    pub fn is_settled(&self) -> bool {
        self.reading.is_none() && self.exporting.is_none() && self.settled
    }

    /// Takes a picture.
    pub fn take_frame(&mut self, frame: Frame) {
        self.frames += 1;
        self.settled = frame.whole && frame.revision == self.revision;
        self.frame = Some(frame);
    }

    /// Takes that a change reached no picture.
    pub fn take_unchanged(&mut self, revision: u64) {
        self.unchanged += 1;
        self.settled = revision == self.revision;
    }

    /// Draws and writes a picture of any size, away from the window, with or without its background.
    pub fn export(&mut self, path: &Path, [width, height]: [u32; 2], backdrop: Backdrop) {
        let Some(document) = &self.document else { return };
        if let Err(e) = check_output(path, PICTURE_EXTENSIONS) {
            return self.fail(&e);
        }
        // What is to go over another background is drawn over black: nothing has to be taken away again.
        let background = match backdrop {
            Backdrop::Drawn => document.scene.background,
            Backdrop::LeftOut => [0.0; 3],
        };
        self.push(Job::Export(Export {
            path: path.into(),
            tf: Arc::clone(&document.tf),
            method: document.method.clone(),
            scene: Scene { width, height, background, ..document.scene.clone() },
            backdrop,
        }));
        self.exporting = Some(Exporting { path: path.display().to_string(), share: 0.0 });
    }

    /// Ends the export that is running, soon.
    pub fn cancel_export(&self) {
        self.thread.cancel_export();
    }

    /// Takes how an export ended.
    pub fn take_exported(&mut self, exported: Exported) {
        self.exporting = None;
        match exported.result {
            Ok(true) => self.note(format!("wrote {}", exported.path.display())),
            Ok(false) => self.note("export cancelled; nothing was written"),
            Err(e) => self.fail(&e),
        }
    }

    /// Probes what is seen along a ray, or a point.
    pub fn probe(&mut self, aim: Aim) {
        let Some(document) = &self.document else { return };
        let light = document.light().light;
        self.probed_light = Some(light);
        let other = self.split.share.map(|_| &document.other).filter(|other| **other != document.method);
        let methods = std::iter::once(&document.method).chain(other).cloned();
        self.push(Job::Probe(ProbeRequest {
            aim,
            tf: Arc::clone(&document.tf),
            light,
            ambient: document.scene.ambient,
            // A setting that is being typed has no answer.
            methods: methods.filter(|m| m.method().is_ok()).collect(),
        }));
    }

    /// Asks for a picture of what the document says now, unless that was asked last.
    pub fn ask(&mut self) {
        let Some(document) = &self.document else { return };
        if document.method.method().is_err() {
            return;
        }
        let other = self.split.share.map(|_| &document.other).filter(|other| other.method().is_ok());
        let subject = Subject {
            tf: Arc::clone(&document.tf),
            methods: std::iter::once(&document.method).chain(other).cloned().collect(),
            scene: document.scene.clone(),
        };
        if self.asked.as_ref() != Some(&subject) {
            self.settled = false;
            self.revision += 1;
            let (since, revision) = (Instant::now(), self.revision);
            self.thread.want(Wanted { subject: subject.clone(), since, revision });
            self.asked = Some(subject);
        }
        // The probe's curves follow once the hand rests.
        if let Some(point) = self.probe.as_ref().map(|p| p.point).filter(|_| self.settled) {
            let differs = |(a, b): (&Subject, &Subject)| a.tf != b.tf || a.methods != b.methods;
            let elsewhere = self.probed_light != Some(document.light().light);
            if self.probed.as_ref().zip(self.asked.as_ref()).is_some_and(|both| elsewhere || differs(both)) {
                self.probe(Aim::Point(point));
            }
            self.probed.clone_from(&self.asked);
        }
    }

    /// Lets notes leave by themselves; errors stay until they are closed.
    pub fn forget_notes(&mut self) {
        self.messages.retain(|m| m.is_error || m.since.elapsed() < NOTE_TIME);
    }
}
