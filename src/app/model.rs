//! State that the panels of the viewer window share: the open volume with its settings, and requests to background
//! threads.

use super::camera;
use super::curve::Edit;
use super::document::Document;
use super::settings::Settings;
use super::split::Split;
use crate::engine::messages::{
    Export, Exported, Frame, FrameRequest, FrameSettings, Job, ProbeRequest, ProbeResult, ProbeTarget,
};
use crate::engine::reading::{InitialState, OpenMode, OpenedVolume, ReadTask};
use crate::engine::task::Wake;
use crate::engine::{RenderThread, ResidentPages};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::output::check_output;
use crate::files::picture::{Backdrop, PICTURE_EXTENSIONS};
use crate::gpu::{DeviceLoss, Gpu};
use crate::open::{RunFlags, SceneRequest, SceneSettings, VolumeSpec, presets};
use crate::scene::{AXIS_VIEWS, Light, Scene};
use crate::shadow::{METHODS, MethodSpec};
use eframe::egui::{self, Rect};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Time for which a note stays in the viewer window. Error messages stay until the user closes them.
const NOTE_TIME: Duration = Duration::from_secs(8);
/// Maximum number of messages shown at once in the viewer window.
const MAX_MESSAGES: usize = 5;

/// Message to the user, shown at the bottom of the picture: an error or a note.
#[derive(Debug, Clone)]
pub struct Message {
    /// Text of a message that the viewer window shows to the user.
    pub text: String,
    /// Advice on how to correct the error that a message in the viewer window reports, if any.
    pub hint: Option<String>,
    /// Whether a message in the viewer window is an error. Errors stay on screen until the user closes them; notes
    /// disappear.
    pub is_error: bool,
    since: Instant,
}

/// Progress of the picture export that is running.
pub struct Exporting {
    /// Path of the picture file that is being exported.
    pub path: String,
    /// Completed fraction, 0 to 1.
    pub share: f32,
    /// Set to end the export.
    pub cancelled: Arc<AtomicBool>,
}

/// State that the panels of the viewer window share: the open volume, results of background threads, and messages.
pub struct Model {
    /// Handle of the render thread, which renders pictures, computes transmittance curves and exports picture files.
    pub thread: RenderThread,
    /// Callback by which a background thread wakes the viewer window when it has a result.
    pub wake: Wake,
    /// Choice of the graphics adapter that renders the pictures, and the limit on its memory.
    pub device: RunFlags,
    loss: DeviceLoss,
    /// User settings of the viewer window, saved between sessions.
    pub settings: Settings,
    /// Open volume with its settings; `None` before a volume is opened.
    pub document: Option<Document>,
    /// Background task that reads a volume; `None` if no volume is being read.
    pub reading: Option<ReadTask>,
    /// Whether the render thread uploads a volume that was read, which does not yet belong to `document`.
    pub uploading: bool,
    /// Picture export that is running, with its progress; `None` if there is none.
    pub exporting: Option<Exporting>,
    /// Last picture received from the render thread, coarse or at full quality.
    pub frame: Option<Frame>,
    /// Pages of the volume on the device; `None` if it is one texture.
    pub pages: Option<ResidentPages>,
    /// Settings of the last requested picture, used to skip a request for an identical picture.
    pub requested: Option<FrameSettings>,
    /// Whether the picture on screen has full quality and belongs to the last picture request.
    pub settled: bool,
    /// Division of the picture between two shadow methods: split line or flicker.
    pub split: Split,
    /// Last result of the probe: transmittance curves along the light ray through a point that the user clicked.
    pub probe: Option<ProbeResult>,
    /// Settings of the picture at the last request for transmittance curves (probe). The curves are updated if the
    /// settings differ.
    probed: Option<FrameSettings>,
    /// Light for which transmittance curves (probe) were requested last.
    probed_light: Option<Light>,
    /// Errors and notes shown to the user at the bottom of the picture.
    pub messages: Vec<Message>,
    /// Rectangle of the window in which the picture is shown, screen points; `None` before the first frame.
    pub view: Option<Rect>,
    /// Index of the last picture request; it grows by one with each request.
    revision: u64,
    /// Number of pictures received from the render thread since the start.
    pub frames: u64,
    /// Number of edits since the start that did not alter the picture, e.g. because no voxel has the edited scalar
    /// values.
    pub unchanged: u64,
}

impl Model {
    /// Creates the viewer state and starts the render thread on `gpu`. The thread calls `wake` for each result.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn new(gpu: Gpu, wake: Wake, settings: Settings) -> Result<Self> {
        Ok(Self {
            device: RunFlags::of(&gpu),
            loss: gpu.loss(),
            thread: RenderThread::start(gpu, Arc::clone(&wake))?,
            wake,
            settings,
            document: None,
            reading: None,
            uploading: false,
            exporting: None,
            frame: None,
            pages: None,
            requested: None,
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

    /// Shows an error to the user at the bottom of the picture and writes it to the log.
    pub fn fail(&mut self, error: &Error) {
        tracing::info!("{error}");
        self.add_message(error.to_string(), error.hint.clone(), true);
    }

    /// Shows a note to the user at the bottom of the picture for a few seconds.
    pub fn note(&mut self, text: impl Into<String>) {
        self.add_message(text.into(), None, false);
    }

    /// Shows a message to the user at the bottom of the picture. Errors stay until the user closes them.
    pub fn add_message(&mut self, text: String, hint: Option<String>, is_error: bool) {
        self.messages.retain(|m| m.text != text);
        self.messages.push(Message { text, hint, is_error, since: Instant::now() });
        if self.messages.len() > MAX_MESSAGES {
            self.messages.remove(0);
        }
    }

    /// Shows a note that a file was saved, or the error that prevented it.
    fn report_saved(&mut self, path: &Path, outcome: Result<()>) {
        match outcome {
            Ok(()) => self.note(format!("saved {}", path.display())),
            Err(e) => self.fail(&e),
        }
    }

    /// Reason for the loss of the graphics device; `None` while the device works.
    pub fn lost(&self) -> Option<String> {
        self.loss.reason()
    }

    // Document.

    /// Applies an edit to the transfer function of the open volume. Successive edits of one kind form one undo step.
    pub fn edit(&mut self, edit: Edit) {
        if let Some(Err(why)) = self.document.as_mut().map(|d| d.edit(edit)) {
            self.note(why);
        }
    }

    /// Loads a transfer function for the open volume, by preset name or file path.
    pub fn load_tf(&mut self, name_or_path: &str) {
        let Some(document) = &mut self.document else {
            return self.note("open a volume before a transfer function");
        };
        match presets::resolve_as(name_or_path, &document.volume, document.suiting) {
            Ok(found) => {
                document.replace_tf(found.tf, name_or_path.to_owned());
                found.warnings.into_iter().chain(found.notes).for_each(|text| self.note(text));
            }
            Err(e) => self.fail(&e),
        }
    }

    /// Writes the transfer function of the open volume to a file.
    pub fn save_tf(&mut self, path: &Path) {
        let Some(document) = &mut self.document else { return };
        let outcome = document.tf.write(path);
        if outcome.is_ok() {
            document.tf_source = (path.display().to_string(), Arc::clone(&document.tf));
            // The written transfer function includes the opacity scale.
            document.suiting.opacity_scale = None;
        }
        self.report_saved(path, outcome);
    }

    /// Writes a scene file with the name of the open volume and all its settings. The command line reads it with
    /// `--scene`.
    pub fn save_scene(&mut self, path: &Path) {
        let Some(document) = &self.document else { return };
        let outcome = document.write_scene(path);
        self.report_saved(path, outcome);
    }

    /// Undoes the last edit of the transfer function of the open volume.
    pub fn undo(&mut self) {
        if let Some(document) = &mut self.document {
            document.history.undo(&mut document.tf);
        }
    }

    /// Redoes the edit of the transfer function that was undone last.
    pub fn redo(&mut self) {
        if let Some(document) = &mut self.document {
            document.history.redo(&mut document.tf);
        }
    }

    /// Moves the camera to one of the six axis views, given by its index in `AXIS_VIEWS`.
    pub fn look_from(&mut self, index: usize) {
        if let (Some(document), Some(view)) = (&mut self.document, AXIS_VIEWS.get(index)) {
            camera::look_from(&mut document.scene.camera, view);
        }
    }

    /// Restores the camera that the open volume had at first.
    pub fn reset_camera(&mut self) {
        if let Some(document) = &mut self.document {
            document.scene.camera = document.home;
        }
    }

    // Opening of volumes.

    /// Starts to read a volume in the background. The open volume stays until the new one is ready. Errors of
    /// earlier volumes are removed.
    pub fn open(&mut self, spec: VolumeSpec, with: OpenMode) {
        self.messages.retain(|message| !message.is_error);
        match ReadTask::start(spec, with, Arc::clone(&self.wake)) {
            Ok(reading) => self.reading = Some(reading),
            Err(e) => self.fail(&e),
        }
    }

    /// Opens a volume by its path or name with the current light and picture settings, or a `.toml` scene file with
    /// its own settings.
    pub fn open_source(&mut self, source: &str) {
        if source.to_lowercase().ends_with(".toml") {
            match SceneRequest::read(Path::new(source)).map(|request| request.settings) {
                Ok(settings) => self.open(settings.spec(), OpenMode::Settings(Box::new(settings))),
                Err(e) => self.fail(&e),
            }
        } else {
            self.open_as_is(VolumeSpec::new(source));
        }
    }

    fn open_as_is(&mut self, spec: VolumeSpec) {
        let with = match &self.document {
            Some(document) => OpenMode::Scene(Box::new(document.scene.clone())),
            None => OpenMode::Settings(Box::new(SceneSettings::of_volume(&spec))),
        };
        self.open(spec, with);
    }

    /// Progress of the volume that is being read; `None` if no volume is being read.
    pub fn loading(&self) -> Option<Arc<Loading>> {
        self.reading.as_ref().map(|o| Arc::clone(&o.loading))
    }

    /// Checks whether the background task has finished reading a volume, and sends that volume to the render thread
    /// for upload.
    pub fn take_reading(&mut self) {
        let Some(outcome) = self.reading.as_ref().and_then(ReadTask::poll) else { return };
        self.reading = None;
        match outcome {
            Ok(opened) => {
                self.uploading = true;
                self.thread.push(Job::Upload(Box::new(opened)));
            }
            Err(e) => self.fail(&e),
        }
    }

    /// Continues after a loss of the graphics device: uploads the volume that was open to the new device.
    pub fn resume(&mut self, document: Document) {
        self.thread.push(Job::Upload(Box::new(document.opened())));
        self.document = Some(document);
    }

    /// Makes a volume the open one after the render thread has uploaded it. Returns `false` if the volume must be
    /// read again.
    pub fn take_volume(&mut self, mut opened: OpenedVolume) -> bool {
        self.uploading = false;
        self.settings.opened(&opened.spec.source);
        let notes = std::mem::take(&mut opened.notes);
        match (opened.initial.take(), &mut self.document) {
            (Some(initial), _) => self.begin(opened, initial),
            // The document that was open when the device was lost.
            (None, Some(document)) if Arc::ptr_eq(&document.volume, &opened.volume) => {}
            (None, Some(document)) if document.spec.source == opened.spec.source => {
                document.take_voxels(opened);
            }
            // Another volume was opened meanwhile, so the settings for these strands are gone.
            _ => {
                self.open_as_is(opened.spec);
                return false;
            }
        }
        self.probe = None;
        self.requested = None;
        notes.into_iter().for_each(|n| self.note(n));
        true
    }

    fn begin(&mut self, opened: OpenedVolume, mut initial: InitialState) {
        let old = self.document.take();
        initial.transparent.get_or_insert(old.as_ref().is_some_and(|d| d.transparent));
        let method = initial.method.take().or_else(|| old.as_ref().map(|d| d.method.clone()));
        let first = || MethodSpec::default_of(METHODS[0]);
        let methods = [method, old.map(|d| d.other)].map(|method| method.unwrap_or_else(first));
        self.document = Some(Document::new(opened, initial, methods));
        self.frame = None;
        self.pages = None;
        self.settled = false;
    }

    // Render thread.

    /// Whether the viewer is idle: the picture on screen is current and at full quality, and no volume is read and no
    /// picture exported.
    pub fn is_settled(&self) -> bool {
        self.reading.is_none() && self.exporting.is_none() && self.settled
    }

    /// Stores a picture from the render thread, to show it in the window.
    pub fn take_frame(&mut self, frame: Frame) {
        self.frames += 1;
        self.settled = frame.is_final && frame.revision == self.revision;
        self.pages = frame.pages;
        self.frame = Some(frame);
    }

    /// Handles the render thread's message that the last edit does not alter the picture.
    pub fn take_unchanged(&mut self, revision: u64) {
        self.unchanged += 1;
        self.settled = revision == self.revision;
    }

    /// Requests the export of a picture of a width and height, pixels, to a file.
    pub fn export(&mut self, path: &Path, [width, height]: [u32; 2], backdrop: Backdrop) {
        let Some(document) = &self.document else { return };
        if let Err(e) = check_output(path, PICTURE_EXTENSIONS) {
            return self.fail(&e);
        }
        // A transparent picture is drawn over black, so that nothing has to be removed.
        let background = match backdrop {
            Backdrop::Drawn => document.scene.background,
            Backdrop::LeftOut => [0.0; 3],
        };
        let cancelled = Arc::default();
        self.thread.push(Job::Export(Box::new(Export {
            path: path.into(),
            tf: Arc::clone(&document.tf),
            method: document.method.clone(),
            scene: Scene { width, height, background, ..document.scene.clone() },
            backdrop,
            cancelled: Arc::clone(&cancelled),
        })));
        self.exporting = Some(Exporting { path: path.display().to_string(), share: 0.0, cancelled });
    }

    /// Reports the result of a picture export to the user.
    pub fn take_exported(&mut self, exported: Exported) {
        self.exporting = None;
        match exported.result {
            Ok(true) => self.note(format!("wrote {}", exported.path.display())),
            Ok(false) => self.note("export cancelled; nothing was written"),
            Err(e) => self.fail(&e),
        }
    }

    /// Requests a probe: transmittance curves of the current shadow methods along the light ray through a point.
    pub fn probe(&mut self, target: ProbeTarget) {
        let Some(document) = &self.document else { return };
        let light = document.light().light;
        self.probed_light = Some(light);
        let other = self.split.share.map(|_| &document.other).filter(|other| **other != document.method);
        self.thread.push(Job::Probe(ProbeRequest {
            target,
            tf: Arc::clone(&document.tf),
            light,
            ambient: document.scene.ambient,
            methods: std::iter::once(&document.method).chain(other).cloned().collect(),
        }));
    }

    /// Requests a picture of the open volume from the render thread, unless the last request had identical settings.
    pub fn ask(&mut self) {
        let Some(document) = &self.document else { return };
        let other = self.split.share.map(|_| &document.other);
        let settings = FrameSettings {
            tf: Arc::clone(&document.tf),
            methods: std::iter::once(&document.method).chain(other).cloned().collect(),
            scene: document.scene.clone(),
        };
        if self.requested.as_ref() != Some(&settings) {
            self.settled = false;
            self.revision += 1;
            let (since, revision) = (Instant::now(), self.revision);
            self.thread.request_frame(FrameRequest { settings: settings.clone(), since, revision });
            self.requested = Some(settings);
        }
        // The probe's curves follow when the picture is final.
        if let Some(point) = self.probe.as_ref().map(|p| p.point).filter(|_| self.settled) {
            let differs = |(a, b): (&FrameSettings, &FrameSettings)| a.tf != b.tf || a.methods != b.methods;
            let elsewhere = self.probed_light != Some(document.light().light);
            if self
                .probed
                .as_ref()
                .zip(self.requested.as_ref())
                .is_some_and(|both| elsewhere || differs(both))
            {
                self.probe(ProbeTarget::Point(point));
            }
            self.probed.clone_from(&self.requested);
        }
    }

    /// Side of the split view that flicker shows now (0 left, 1 right), and the time until it shows the other side,
    /// s. `None` without flicker.
    pub fn flicker(&self, context: &egui::Context) -> Option<(usize, f64)> {
        self.frame.as_ref()?.other.as_ref()?;
        self.split.flicker_at(context.input(|i| i.time), self.settings.flicker_hz)
    }

    /// Removes notes that have been long enough in the viewer window. Error messages stay until the user closes them.
    pub fn forget_notes(&mut self) {
        self.messages.retain(|m| m.is_error || m.since.elapsed() < NOTE_TIME);
    }
}
