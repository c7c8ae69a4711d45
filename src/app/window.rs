//! The window itself: eframe's, on the device that pictures are drawn with.

use super::widgets::Widgets;
use super::{App, Script, Settings, With};
use crate::cli::scene_args::{SceneArgs, SceneRequest};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::scene::Shading;
use eframe::{egui, egui_wgpu, wgpu};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How the window starts.
#[derive(Debug, Clone)]
pub struct Start {
    /// What to open; `None` opens what was open last.
    pub request: Option<SceneRequest>,
    pub adapter: Option<String>,
    /// Neither read nor keep settings.
    pub clean: bool,
    /// Input to replay, after which the window closes.
    pub script: Option<Script>,
}

/// The shading of the window, where nothing is said: surfaces read better while they turn.
const SHADING: Shading = Shading::Lambert;

/// A scene file that was kept is no larger.
const MAX_SCENE_BYTES: usize = 1 << 20;

/// What an empty window opens a volume with.
///
/// # Errors
/// None that is known of.
pub fn default_request() -> Result<SceneRequest> {
    let request = SceneArgs::default().into_request()?;
    Ok(SceneRequest { shading: Some(SHADING), ..request })
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// No display, no adapter, or a system that refuses the window.
pub fn run(start: Start) -> Result<()> {
    let settings = if start.clean { Settings::default() } else { Settings::read() };
    let setup = egui_wgpu::WgpuSetupCreateNew {
        native_adapter_selector: start.adapter.clone().map(|name| select_by_name(&name)),
        device_descriptor: Arc::new(Gpu::device_descriptor),
        ..egui_wgpu::WgpuSetupCreateNew::without_display_handle()
    };
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_app_id("umbravox")
            .with_title("umbravox")
            .with_inner_size(start.script.as_ref().and_then(Script::window).unwrap_or(settings.window))
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
    let outcome = Arc::new(Mutex::new(Ok(())));
    let theirs = Arc::clone(&outcome);
    let create: eframe::AppCreator<'_> = Box::new(move |context| {
        let state = context.wgpu_render_state.as_ref().ok_or("the window has no wgpu device")?;
        if let Some(widgets) = Widgets::for_software(state) {
            context.egui_ctx.add_plugin(widgets);
        }
        let gpu = Gpu::from_parts(&state.adapter, state.device.clone(), state.queue.clone());
        let mut app = App::new(gpu, &context.egui_ctx, settings)?;
        let request = match start.request {
            Some(request) => Some(request),
            None => last_scene(&app.settings.last_scene).or_else(|| default_request().ok()),
        };
        if let Some(request) = request {
            app.open(request.volume.clone(), With::Request(Box::new(request)));
        }
        let kept = (!start.clean).then(Instant::now);
        Ok(Box::new(Window { app, kept, script: start.script, outcome: theirs }))
    });
    eframe::run_native("umbravox", options, create).map_err(|e| failed(e.to_string()))?;
    let outcome = outcome.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    outcome.clone()
}

/// The scene that was kept, where it can still be read.
fn last_scene(text: &str) -> Option<SceneRequest> {
    if text.is_empty() || text.len() > MAX_SCENE_BYTES {
        return None;
    }
    let folder = tempfile::tempdir().ok()?;
    let path = folder.path().join("last.toml");
    std::fs::write(&path, text).ok()?;
    SceneArgs { scene: vec![path], ..Default::default() }.into_request().ok()
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
    /// When settings were kept last; `None`: never, as `--clean` says.
    kept: Option<Instant>,
    script: Option<Script>,
    outcome: Arc<Mutex<Result<()>>>,
}

impl Window {
    fn keep(&mut self, context: &egui::Context) {
        let size = context.input(|i| i.viewport().inner_rect.map(|r| r.size()));
        if let Some(size) = size {
            self.app.settings.window = [size.x, size.y];
        }
        if let Some(document) = &self.app.document {
            // A function that was edited lives in a file beside the settings.
            let beside = Settings::path().map(|p| p.with_file_name("last.tf.json"));
            let tf = match beside.filter(|_| document.tf_edited()) {
                Some(path) => document.tf.write(&path).ok().map(|()| path.display().to_string()),
                None => Some(document.tf_source.0.clone()),
            };
            if let Some(tf) = tf {
                self.app.settings.last_scene = document.scene_text(&tf);
            }
        }
        self.app.settings.write();
    }
}

/// Between two times that settings are kept.
const KEEP_EVERY: Duration = Duration::from_secs(20);

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        if let Some(script) = &mut self.script
            && let Some(outcome) = script.after_frame(&mut self.app)
        {
            *self.outcome.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = outcome;
            self.script = None;
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        self.app.show(ui, frame.wgpu_render_state());
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
