//! Native viewer window, which shares its graphics device with the render thread.

use super::contents::App;
use super::resume::Resume;
use super::settings::Settings;
use super::surface::Surface;
use crate::engine::reading::OpenMode;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Tuning};
use crate::open::{RunFlags, SceneRequest, SceneSettings};
use eframe::{egui, egui_wgpu, wgpu};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Options with which the viewer window starts.
pub struct Start {
    /// Scene that the window opens at its start. `None` opens the last scene of the previous session.
    pub scene: Option<SceneSettings>,
    /// Choice of the graphics adapter, and the limit on its memory.
    pub run: RunFlags,
    /// Disables reading and writing of the window's settings file.
    pub clean: bool,
    /// Optional callbacks in every frame of the window, for tests and screenshots.
    pub hook: Option<Box<dyn FrameHook>>,
}

/// Callbacks in every frame of the viewer window. They can replace the user in tests and screenshots.
pub trait FrameHook: Send {
    /// Initial size of the viewer window, screen points. `None` selects the size in the user's settings.
    fn window_size(&self) -> Option<[f32; 2]>;
    /// Adds simulated user input before a frame of the window.
    fn input(&mut self, app: &App, context: &egui::Context, input: &mut egui::RawInput);
    /// Called before the user interface of a window frame is built. A returned result closes the window and becomes
    /// the window's result.
    fn before_frame(&mut self, app: &mut App, frame: &eframe::Frame) -> Option<Result<()>>;
    /// Called after all widgets of a window frame have been laid out.
    fn after_frame(&mut self, context: &egui::Context);
}

/// Reason why a viewer window ended: closed, or the graphics device was lost.
enum Ended {
    Closed(Result<()>),
    /// The graphics device was lost. The open volume, and the frame hook if any, move to the next window.
    Lost(Box<Resume>, Option<Box<dyn FrameHook>>),
}

/// Minimum time between the start and the loss of a graphics device. A device lost sooner is not replaced by a new
/// one.
const MIN_LIFETIME: Duration = Duration::from_secs(2);
/// Number of device losses within `LOSSES_WITHIN` after which the viewer gives up.
const MAX_LOSSES: usize = 3;
const LOSSES_WITHIN: Duration = Duration::from_secs(60);

/// Opens the viewer window and returns when it is closed. After a loss of the graphics device, a new window continues
/// with the same volume and settings.
///
/// # Errors
/// No display, no adapter, a system that refuses the window, or a device that is lost again at once.
pub fn run(start: Start) -> Result<()> {
    let Start { scene, run, clean, mut hook } = start;
    let mut settings = if clean { Settings::default() } else { Settings::read() };
    let scene = scene.or_else(|| last_scene(&settings.last_scene)).unwrap_or_default();
    let (mut scene, mut resume) = (Some(scene), None);
    let mut losses: Vec<Instant> = Vec::new();
    loop {
        let since = Instant::now();
        match open(&run, clean, settings, (scene.take(), resume.take()), hook)? {
            Ended::Closed(outcome) => return outcome,
            Ended::Lost(lost, next_hook) => {
                losses.retain(|loss| loss.elapsed() < LOSSES_WITHIN);
                losses.push(Instant::now());
                if since.elapsed() < MIN_LIFETIME || losses.len() >= MAX_LOSSES {
                    return Err(lost.give_up(Resume::recovery_path()));
                }
                (settings, hook) = (lost.settings.clone(), next_hook);
                resume = Some(*lost);
            }
        }
    }
}

/// Opens one viewer window with a scene, or with the volume that was open when the graphics device was lost.
fn open(
    run: &RunFlags,
    clean: bool,
    settings: Settings,
    (scene, resume): (Option<SceneSettings>, Option<Resume>),
    hook: Option<Box<dyn FrameHook>>,
) -> Result<Ended> {
    // eframe would report a bad value as a missing display.
    Tuning::CARD.with_environment()?;
    let setup = egui_wgpu::WgpuSetupCreateNew {
        native_adapter_selector: run.adapter.as_deref().map(select_by_name),
        device_descriptor: Arc::new(Gpu::device_descriptor),
        ..egui_wgpu::WgpuSetupCreateNew::without_display_handle()
    };
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_app_id("umbravox")
            .with_title("umbravox")
            .with_inner_size(hook.as_ref().and_then(|hook| hook.window_size()).unwrap_or(settings.window))
            .with_min_inner_size([640.0, 480.0])
            .with_drag_and_drop(true),
        // Dithering is slow on a software adapter.
        dithering: false,
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: egui_wgpu::WgpuConfiguration {
            wgpu_setup: egui_wgpu::WgpuSetup::CreateNew(setup),
            ..Default::default()
        },
        ..Default::default()
    };
    let failed = |why: String| {
        // winit's message without the location in its sources.
        let why = if why.contains(".rs:") { why.rsplit(": ").next().unwrap_or(&why) } else { &why };
        Error::runtime("cannot open the window", "display", why)
            .hint("a display is needed (DISPLAY or WAYLAND_DISPLAY); `render` and `compare` need none")
    };
    // An error is reported after the window has closed.
    let outcome = Arc::new(Mutex::new(Ended::Closed(Ok(()))));
    let reported = Arc::clone(&outcome);
    // If no window opens, the document is still in `resume`.
    let resume = Arc::new(Mutex::new(resume));
    let to_resume = Arc::clone(&resume);
    let memory_limit = run.memory_limit();
    let create: eframe::AppCreator<'_> = Box::new(move |context| {
        let state = context.wgpu_render_state.as_ref().ok_or("the window has no wgpu device")?;
        let gpu = Gpu::from_parts(&state.adapter, state.device.clone(), state.queue.clone())?;
        let gpu = gpu.with_memory_limit(memory_limit);
        let surface = Surface::of(&gpu);
        let mut app = App::new(gpu, &context.egui_ctx, settings)?;
        if let Some(resume) = lock(&to_resume).take() {
            app.resume(resume);
        }
        if let Some(scene) = scene {
            app.model.open(scene.spec(), OpenMode::Settings(Box::new(scene)));
        }
        let last_write = (!clean).then(Instant::now);
        Ok(Box::new(Window { app, surface, last_write, hook, outcome: reported, ended: false }))
    });
    let ran = eframe::run_native("umbravox", options, create);
    if let (Err(_), Some(resume)) = (&ran, lock(&resume).take()) {
        return Err(resume.give_up(Resume::recovery_path()));
    }
    if let Err(e) = ran {
        // The windowing library fails in the same way without a display and without a graphics driver.
        run.gpu()?;
        return Err(failed(e.to_string()));
    }
    Ok(std::mem::replace(&mut *lock(&outcome), Ended::Closed(Ok(()))))
}

fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Parses the last scene that is saved in the user's settings; `None` if it is missing or invalid.
fn last_scene(text: &str) -> Option<SceneSettings> {
    if text.is_empty() { None } else { SceneRequest::from_toml(text).ok().map(|request| request.settings) }
}

/// Returns a selector of the graphics adapter whose name contains `name`, ignoring case.
fn select_by_name(name: &str) -> egui_wgpu::NativeAdapterSelectorMethod {
    let wanted = name.to_lowercase();
    Arc::new(move |adapters: &[wgpu::Adapter], _| {
        let names = || adapters.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
        let found = adapters.iter().find(|a| a.get_info().name.to_lowercase().contains(&wanted));
        found.cloned().ok_or_else(|| format!("no adapter's name contains `{wanted}`; there is: {}", names()))
    })
}

/// Viewer window as an application of the eframe library.
struct Window {
    app: App,
    surface: Surface,
    /// Time at which the user settings were written to their file last; `None` with `--clean`, which never writes
    /// them.
    last_write: Option<Instant>,
    hook: Option<Box<dyn FrameHook>>,
    outcome: Arc<Mutex<Ended>>,
    /// Whether the graphics device is lost and the window is closing.
    ended: bool,
}

impl Window {
    fn write_settings(&mut self, context: &egui::Context) {
        let size = context.input(|i| i.viewport().inner_rect.map(|r| r.size()));
        if let Some(size) = size {
            self.app.model.settings.window = [size.x, size.y];
        }
        if let Some(document) = &self.app.model.document {
            // An edited function is written to a file beside the settings.
            let beside = Settings::path().map(|p| p.with_file_name("last.tf.json"));
            let tf = match beside.filter(|_| document.tf_edited()) {
                Some(path) => document.tf.write(&path).ok().map(|()| path.display().to_string()),
                None => Some(document.tf_source.0.clone()),
            };
            if let Some(Ok(text)) = tf.map(|tf| document.scene_text(&tf)) {
                self.app.model.settings.last_scene = text;
            }
        }
        self.app.model.settings.write();
    }
}

/// Time between two writes of the user settings while the window is open.
const WRITE_INTERVAL: Duration = Duration::from_secs(20);

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        if let Some(why) = self.app.model.lost().filter(|_| !self.ended) {
            self.ended = true;
            let resume = Box::new(self.app.into_resume(why));
            *lock(&self.outcome) = Ended::Lost(resume, self.hook.take());
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        if self.ended {
            return;
        }
        if let Some(e) = self.surface.before_frame(ui.ctx(), frame) {
            self.app.model.fail(&e);
        }
        if let Some(hook) = &mut self.hook
            && let Some(outcome) = hook.before_frame(&mut self.app, frame)
        {
            *lock(&self.outcome) = Ended::Closed(outcome);
            self.hook = None;
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        self.app.show(ui, frame.wgpu_render_state());
        if let Some(hook) = &mut self.hook {
            hook.after_frame(ui.ctx());
        }
        if self.last_write.is_some_and(|when| when.elapsed() > WRITE_INTERVAL)
            || (self.last_write.is_some() && ui.input(|i| i.viewport().close_requested()))
        {
            self.write_settings(ui.ctx());
            self.last_write = Some(Instant::now());
        }
    }

    /// Clears the window to the panel colour. The panels need no fill of their own, which saves most pixels on a
    /// software adapter.
    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        visuals.panel_fill.to_normalized_gamma_f32()
    }

    fn raw_input_hook(&mut self, context: &egui::Context, input: &mut egui::RawInput) {
        if let Some(hook) = &mut self.hook {
            hook.input(&self.app, context, input);
        }
    }
}
