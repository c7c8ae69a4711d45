//! Tests of the window on the real renderer without a native window: input is injected as events.
#![cfg(feature = "gui")]

#[path = "../common/mod.rs"]
mod common;
mod comparison;
mod cube;
mod difference;
mod drivers;
mod files;
mod gradient;
mod layout;
mod loss;
mod masks;
mod opening;
mod panels;
mod pointer;
mod presets;
mod prompts;
mod resizes;
mod streaming;

use eframe::egui::{self, Event, Modifiers, PointerButton, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::time::{Duration, Instant};
use umbravox::app::{App, OpenMode, Purpose, Settings};
use umbravox::gpu::Gpu;
use umbravox::open::SceneArgs;
use umbravox::render::DisplayTexture;

/// Time limit for waiting, long enough for a busy machine without a GPU.
const PATIENCE: Duration = Duration::from_secs(90);

/// Size of the window, points.
pub const SIZE: egui::Vec2 = egui::vec2(1200.0, 800.0);

/// Window without a screen under test, with the device that draws its pictures.
pub struct Bench {
    pub harness: Harness<'static, App>,
    pub device: eframe::wgpu::Device,
    pub queue: eframe::wgpu::Queue,
}

impl Bench {
    /// Opens a command line of `view`; `None` and a printed line if there is no adapter.
    pub fn open(line: &[&str]) -> Option<Self> {
        Self::empty()?.opened(line)
    }

    /// Opens a command line of `view` with a limit on device memory, bytes.
    pub fn open_within(line: &[&str], memory_limit: u64) -> Option<Self> {
        Self::on(common::gpu()?.with_memory_limit(Some(memory_limit))).opened(line)
    }

    fn opened(self, line: &[&str]) -> Option<Self> {
        let mut bench = self;
        let settings = scene_args(line).into_request().unwrap().settings;
        bench.app().model.open(settings.spec(), OpenMode::Settings(Box::new(settings)));
        bench.settle();
        Some(bench)
    }

    /// Opens an empty window.
    pub fn empty() -> Option<Self> {
        Some(Self::on(common::gpu()?))
    }

    fn on(gpu: Gpu) -> Self {
        let (device, queue) = (gpu.device.clone(), gpu.queue.clone());
        let app = App::new(gpu, &egui::Context::default(), Settings::default()).unwrap();
        let harness =
            Harness::builder().with_size(SIZE).build_ui_state(|ui, app: &mut App| app.show(ui, None), app);
        Self { harness, device, queue }
    }

    pub fn app(&mut self) -> &mut App {
        self.harness.state_mut()
    }

    /// Opens the prompt for exporting a picture.
    pub fn ask_export(&mut self) {
        let App { model, windows, .. } = self.app();
        windows.prompt.ask(model, Purpose::ExportPicture);
        self.harness.run_steps(2);
    }

    /// Presses a key and steps until the effect is shown.
    pub fn press(&mut self, key: egui::Key) {
        self.harness.key_press(key);
        self.harness.run_steps(3);
    }

    /// Steps the window until the picture is final and current.
    pub fn settle(&mut self) {
        let start = Instant::now();
        self.harness.step();
        loop {
            self.harness.step();
            let app = self.harness.state();
            if app.model.is_settled() && app.model.frame.is_some() {
                break;
            }
            assert!(start.elapsed() < PATIENCE, "no picture: {:?}", app.model.messages);
            std::thread::sleep(Duration::from_millis(10));
        }
        // One more frame shows the last result.
        self.harness.step();
    }

    /// Steps the window until `done`; `what` names the wait if it times out.
    pub fn wait_for(&mut self, what: &str, done: impl Fn(&App) -> bool) {
        let start = Instant::now();
        while !done(self.harness.state()) {
            self.harness.step();
            assert!(start.elapsed() < PATIENCE, "{what}: {:?}", self.harness.state().model.messages);
            std::thread::sleep(Duration::from_millis(5));
        }
        // One more frame shows the last result.
        self.harness.run_steps(2);
    }

    /// Drags the pointer over several frames.
    pub fn drag(&mut self, from: Pos2, to: Pos2, modifiers: Modifiers) {
        let button =
            |pos, pressed| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers };
        self.harness.event(Event::ModifiersChanged(modifiers));
        self.harness.event(Event::PointerMoved(from));
        self.harness.step();
        self.harness.event(button(from, true));
        self.harness.step();
        for i in 1..=6 {
            self.harness.event(Event::PointerMoved(from + (to - from) * (i as f32 / 6.0)));
            self.harness.step();
        }
        self.harness.event(button(to, false));
        self.harness.event(Event::ModifiersChanged(Modifiers::NONE));
        self.harness.step();
    }

    /// Clicks at a position in the window.
    pub fn click_at(&mut self, pos: Pos2) {
        let modifiers = Modifiers::NONE;
        self.harness.event(Event::PointerMoved(pos));
        self.harness.step();
        for pressed in [true, false] {
            self.harness.event(Event::PointerButton {
                pos,
                button: PointerButton::Primary,
                pressed,
                modifiers,
            });
            self.harness.step();
        }
    }

    /// Clicks the widget with an accessible name.
    pub fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.step();
        self.harness.step();
    }

    /// Replaces the text of a field.
    pub fn type_into(&mut self, label: &str, text: &str) {
        self.harness.get_by_label(label).focus();
        self.harness.step();
        self.harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::A);
        self.harness.step();
        self.harness.get_by_label(label).type_text(text);
        self.harness.step();
    }

    /// Picture on screen, sRGB codes.
    pub fn pixels(&self) -> Vec<u8> {
        let frame = self.harness.state().model.frame.as_ref().unwrap();
        self.read(&frame.main.texture)
    }

    pub fn read(&self, shown: &DisplayTexture) -> Vec<u8> {
        use eframe::wgpu;
        let row = (shown.width * 4).next_multiple_of(256);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(row * shown.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            shown.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            shown.texture.size(),
        );
        self.queue.submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |r| r.unwrap());
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let bytes = buffer.get_mapped_range(..).unwrap().to_vec();
        bytes.chunks(row as usize).flat_map(|r| r[..shown.width as usize * 4].to_vec()).collect()
    }
}

/// Parses the shared flags of a command line.
pub fn scene_args(line: &[&str]) -> SceneArgs {
    use clap::Parser;
    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        scene: SceneArgs,
    }
    Line::try_parse_from([&["test"], line].concat()).unwrap().scene
}

/// Mean of the codes of all colour channels.
pub fn brightness(pixels: &[u8]) -> f64 {
    let sum: u64 = pixels.chunks(4).map(|p| p[..3].iter().map(|c| u64::from(*c)).sum::<u64>()).sum();
    sum as f64 / (pixels.len() as f64 * 0.75)
}
