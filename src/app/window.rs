//! The window itself: eframe's, on the device that pictures are drawn with.

use super::contents::App;
use super::paint::widgets::Widgets;
use super::resume::Resume;
use super::script::Script;
use super::settings::Settings;
use super::surface::Surface;
use crate::engine::reading::With;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::open::{SceneRequest, SceneSettings};
use eframe::{egui, egui_wgpu, wgpu};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How the window starts.
#[derive(Debug, Clone)]
pub struct Start {
    /// What to open; `None` opens what was open last.
    pub scene: Option<SceneSettings>,
    /// Part of the adapter's name; `None`: the system's choice.
    pub adapter: Option<String>,
    /// Neither read nor keep settings.
    pub clean: bool,
    /// Input to replay, after which the window closes.
    pub script: Option<Script>,
}

/// A scene file that was kept is no larger.
const MAX_SCENE_BYTES: usize = 1 << 20;

/// How a window ended.
enum Ended {
    Closed(Result<()>),
    /// Its device was lost; the rest of a script goes on.
    Lost(Box<Resume>, Option<Box<Script>>),
}

/// What a window begins with.
#[derive(Default)]
struct Begin {
    settings: Settings,
    scene: Option<SceneSettings>,
    script: Option<Script>,
    resume: Option<Resume>,
}

/// A device that is lost sooner would be lost again and again.
const LEAST_LIFE: Duration = Duration::from_secs(2);
/// Nor is it worth while to begin for ever.
const MOST_LOSSES: usize = 3;
const LOSSES_WITHIN: Duration = Duration::from_secs(60);

/// Opens the window and returns when it is closed. Where its device is lost another window takes its place, with what
/// was open.
///
/// # Errors
/// No display, no adapter, a system that refuses the window, or a device that is lost again at once.
pub fn run(start: Start) -> Result<()> {
    let settings = if start.clean { Settings::default() } else { Settings::read() };
    let scene = start.scene.or_else(|| last_scene(&settings.last_scene));
    let mut begin =
        Begin { settings, scene: Some(scene.unwrap_or_default()), script: start.script, resume: None };
    let mut losses: Vec<Instant> = Vec::new();
    loop {
        let since = Instant::now();
        match open(start.adapter.as_deref(), start.clean, begin)? {
            Ended::Closed(outcome) => return outcome,
            Ended::Lost(resume, script) => {
                losses.retain(|lost| lost.elapsed() < LOSSES_WITHIN);
                losses.push(Instant::now());
                if since.elapsed() < LEAST_LIFE || losses.len() >= MOST_LOSSES {
                    return Err(resume.give_up(Resume::kept_scene()));
                }
                let settings = resume.settings.clone();
                let script = script.map(|script| *script);
                begin = Begin { settings, scene: None, script, resume: Some(*resume) };
            }
        }
    }
}

fn open(adapter: Option<&str>, clean: bool, begin: Begin) -> Result<Ended> {
    let Begin { settings, scene, script, resume } = begin;
    let setup = egui_wgpu::WgpuSetupCreateNew {
        native_adapter_selector: adapter.map(select_by_name),
        device_descriptor: Arc::new(Gpu::device_descriptor),
        ..egui_wgpu::WgpuSetupCreateNew::without_display_handle()
    };
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_app_id("umbravox")
            .with_title("umbravox")
            .with_inner_size(script.as_ref().and_then(Script::window).unwrap_or(settings.window))
            .with_min_inner_size([640.0, 480.0])
            .with_drag_and_drop(true),
        // Dithering costs a software adapter more than it shows.
        dithering: false,
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: egui_wgpu::WgpuConfiguration {
            wgpu_setup: egui_wgpu::WgpuSetup::CreateNew(setup),
            ..Default::default()
        },
        ..Default::default()
    };
    let failed = |why: String| {
        // Of winit's message only what went wrong, not where in its own sources that was noticed.
        let why = if why.contains(".rs:") { why.rsplit(": ").next().unwrap_or(&why) } else { &why };
        Error::runtime("cannot open the window", "display", why)
            .hint("a display is needed (DISPLAY or WAYLAND_DISPLAY); `render` and `compare` need none")
    };
    // What ends a script badly is said once the window is gone.
    let outcome = Arc::new(Mutex::new(Ended::Closed(Ok(()))));
    let theirs = Arc::clone(&outcome);
    // Where no window comes, what was open is still here.
    let resume = Arc::new(Mutex::new(resume));
    let to_resume = Arc::clone(&resume);
    let create: eframe::AppCreator<'_> = Box::new(move |context| {
        let state = context.wgpu_render_state.as_ref().ok_or("the window has no wgpu device")?;
        if let Some(widgets) = Widgets::for_software(state) {
            context.egui_ctx.add_plugin(widgets);
        }
        let gpu = Gpu::from_parts(&state.adapter, state.device.clone(), state.queue.clone());
        let surface = Surface::of(&gpu);
        let mut app = App::new(gpu, &context.egui_ctx, settings)?;
        if let Some(resume) = lock(&to_resume).take() {
            app.resume(resume);
        }
        if let Some(scene) = scene {
            app.model.open(scene.spec(), With::Settings(Box::new(scene)));
        }
        let kept = (!clean).then(Instant::now);
        Ok(Box::new(Window { app, surface, kept, script, outcome: theirs, ended: false }))
    });
    let ran = eframe::run_native("umbravox", options, create);
    if let (Err(_), Some(resume)) = (&ran, lock(&resume).take()) {
        return Err(resume.give_up(Resume::kept_scene()));
    }
    ran.map_err(|e| failed(e.to_string()))?;
    Ok(std::mem::replace(&mut *lock(&outcome), Ended::Closed(Ok(()))))
}

fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The scene that was kept, where it can still be read.
fn last_scene(text: &str) -> Option<SceneSettings> {
    if text.is_empty() || text.len() > MAX_SCENE_BYTES {
        None
    } else {
        SceneRequest::from_toml(text).ok().map(|request| request.settings)
    }
}

/// The adapter whose name contains `name`, any case.
fn select_by_name(name: &str) -> egui_wgpu::NativeAdapterSelectorMethod {
    let wanted = name.to_lowercase();
    Arc::new(move |adapters: &[wgpu::Adapter], _| {
        let names = || adapters.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
        let found = adapters.iter().find(|a| a.get_info().name.to_lowercase().contains(&wanted));
        found.cloned().ok_or_else(|| format!("no adapter's name contains `{wanted}`; there is: {}", names()))
    })
}

/// The application as eframe sees it.
struct Window {
    app: App,
    surface: Surface,
    /// When settings were kept last; `None`: never, as `--clean` says.
    kept: Option<Instant>,
    script: Option<Script>,
    outcome: Arc<Mutex<Ended>>,
    /// The device is lost and the window on its way out.
    ended: bool,
}

impl Window {
    fn keep(&mut self, context: &egui::Context) {
        let size = context.input(|i| i.viewport().inner_rect.map(|r| r.size()));
        if let Some(size) = size {
            self.app.model.settings.window = [size.x, size.y];
        }
        if let Some(document) = &self.app.model.document {
            // A function that was edited lives in a file beside the settings.
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

/// Between two times that settings are kept.
const KEEP_EVERY: Duration = Duration::from_secs(20);

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        if let Some(why) = self.app.model.lost().filter(|_| !self.ended) {
            self.ended = true;
            let resume = Box::new(self.app.into_resume(why));
            *lock(&self.outcome) = Ended::Lost(resume, self.script.take().map(Box::new));
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        if self.ended {
            return;
        }
        if let Some(e) = self.surface.before_frame(ui.ctx(), frame) {
            self.app.model.fail(&e);
        }
        if let Some(script) = &mut self.script
            && let Some(outcome) = script.after_frame(&mut self.app)
        {
            *lock(&self.outcome) = Ended::Closed(outcome);
            self.script = None;
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        if self.script.as_mut().is_some_and(Script::loses_device)
            && let Some(state) = frame.wgpu_render_state()
        {
            state.device.destroy();
            // A device that is destroyed, not lost, says so when it is next asked.
            let _ = state.device.poll(wgpu::PollType::wait_indefinitely());
        }
        self.app.show(ui, frame.wgpu_render_state());
        if let Some(script) = &mut self.script {
            script.look(ui.ctx());
        }
        if self.kept.is_some_and(|when| when.elapsed() > KEEP_EVERY)
            || (self.kept.is_some() && ui.input(|i| i.viewport().close_requested()))
        {
            self.keep(ui.ctx());
            self.kept = Some(Instant::now());
        }
    }

    /// The panels' own colour: they paint none, which spares a software adapter most of the window's pixels.
    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        visuals.panel_fill.to_normalized_gamma_f32()
    }

    fn raw_input_hook(&mut self, context: &egui::Context, input: &mut egui::RawInput) {
        if let Some(script) = &mut self.script {
            script.before_frame(&self.app, context, input);
        }
    }
}
