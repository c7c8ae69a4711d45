//! Viewer application without its native window: application state, panels and event handling.

use super::model::Model;
use super::panels::difference::Difference;
use super::panels::presets::Presets;
use super::panels::slices::Slices;
use super::panels::strands::StrandsForm;
use super::panels::times::Times;
use super::panels::windows::Windows;
use super::panels::{editor, help, keys, probe, side, top_bar, view};
use super::resume::Resume;
use super::settings::Settings;
use super::theme;
use crate::engine::messages::Event;
use crate::engine::reading::OpenedVolume;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::transfer::formats;
use eframe::egui;
use eframe::egui_wgpu::RenderState;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// State of the viewer application: the open volume with its settings, and the state of all panels.
pub struct App {
    /// State that the panels of the viewer window share: the open volume with its settings, and requests to the
    /// render thread.
    pub model: Model,
    /// State of the floating windows over the picture, such as the comparison of shadow methods and the prompt for a
    /// file path.
    pub windows: Windows,
    /// State of the heat maps that show the error of each shadow method over the picture.
    pub difference: Difference,
    /// List of transfer-function presets with a thumbnail of the open volume for each.
    pub presets: Presets,
    slices: Slices,
    strands: StrandsForm,
    times: Times,
}

impl App {
    /// Creates the viewer application and starts its render thread on `gpu`. Events of the render thread repaint the
    /// window of `context`.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn new(gpu: Gpu, context: &egui::Context, settings: Settings) -> Result<Self> {
        let context = context.clone();
        Ok(Self {
            model: Model::new(gpu, Arc::new(move || context.request_repaint()), settings)?,
            windows: Windows::default(),
            difference: Difference::default(),
            presets: Presets::default(),
            slices: Slices::default(),
            strands: StrandsForm::default(),
            times: Times::default(),
        })
    }

    /// Draws one frame of the viewer's user interface. Without a `render_state` (in tests), rendered pictures are not
    /// shown.
    pub fn show(&mut self, ui: &mut egui::Ui, render_state: Option<&RenderState>) {
        self.handle_events();
        let context = ui.ctx().clone();
        self.windows.comparison.take_updates(&mut self.model, &context);
        let Self { model, windows, difference, presets, slices, strands, times } = self;
        theme::show(&context, model.settings.dark);
        take_dropped_files(model, &context);
        keys::shortcuts(&context, model, windows, difference);
        windows.close_topmost(&context, model);
        top_bar::show(ui, model, windows);
        side::show(ui, model, difference, strands, times);
        let of_windows = (&mut windows.prompt, &mut windows.gradient.open);
        editor::show(ui, model, presets, of_windows, render_state);
        view::show(ui, model, difference, slices, render_state);
        windows.comparison.show(&context, model);
        windows.gradient.show(&context, model);
        windows.prompt.show(&context, model);
        probe::show(&context, model);
        help::show(&context, &mut windows.help);
        windows.typing = context.text_edit_focused();
        model.ask();
        difference.follow(model);
        if let Some((_, wait_s)) = model.flicker(&context) {
            context.request_repaint_after(Duration::from_secs_f64(wait_s));
        }
        if model.reading.is_some() {
            context.request_repaint_after(Duration::from_millis(100));
        }
    }

    /// Handles results of background threads in the viewer: opened volumes, pictures, transmittance curves, error
    /// heat maps and exported pictures.
    fn handle_events(&mut self) {
        self.model.take_reading();
        for event in self.model.thread.events() {
            let model = &mut self.model;
            match event {
                Event::Uploaded(opened) => self.take_volume(*opened),
                Event::Frame(frame) => {
                    self.times.note(&frame);
                    model.take_frame(*frame);
                }
                Event::Pages(pages) => model.pages = Some(pages),
                Event::Note(text) => model.note(text),
                Event::Unchanged { revision } => model.take_unchanged(revision),
                Event::Probed(result) => {
                    self.slices.go_to(model.document.as_ref(), result.point);
                    model.probe = Some(*result);
                }
                Event::Thumbnail(thumbnail) => self.presets.take(*thumbnail),
                Event::Differences(found) => self.difference.take(*found),
                Event::DifferenceInterrupted(request) => self.difference.request_again(&request),
                Event::ExportProgress(share) => {
                    if let Some(exporting) = &mut model.exporting {
                        exporting.share = share;
                    }
                }
                Event::Exported(exported) => model.take_exported(exported),
                Event::Failed(error) => {
                    self.difference.fail();
                    model.settled = true;
                    model.uploading = false;
                    model.fail(&error);
                }
            }
        }
        self.model.forget_notes();
    }

    fn take_volume(&mut self, opened: OpenedVolume) {
        if !self.model.take_volume(opened) {
            return;
        }
        let document = self.model.document.as_ref();
        self.strands = document.map(StrandsForm::of).unwrap_or_default();
        self.presets = Presets::default();
        self.difference = self.difference.only_choices();
        self.slices.reset(document);
    }

    /// Moves the open volume with its settings out of the viewer after a loss of the graphics device, to continue on
    /// another device.
    pub fn into_resume(&mut self, why: String) -> Resume {
        let model = &mut self.model;
        let open = model.document.take().map(|d| (d, model.split, self.difference.only_choices()));
        Resume { why, settings: model.settings.clone(), open }
    }

    /// Continues on a new graphics device with the volume and settings that were open when the old device was lost.
    pub fn resume(&mut self, resume: Resume) {
        let text = format!("the graphics device was lost ({}); a new one is in use", resume.why);
        self.model.add_message(text, None, true);
        let Some((document, split, difference)) = resume.open else { return };
        self.model.split = split.without_flicker();
        self.difference = difference;
        self.model.resume(document);
    }
}

/// Opens a file dropped on the window: a transfer function or a volume, by the file's extension.
fn take_dropped_files(model: &mut Model, context: &egui::Context) {
    let names = context.input(|i| {
        let path = |f: &egui::DroppedFileHandle| f.path().display().to_string();
        i.raw.dropped_files.iter().map(path).collect::<Vec<_>>()
    });
    let Some(name) = names.first() else { return };
    if names.len() > 1 {
        model.note(format!("{} files were dropped: only {name} was opened", names.len()));
    }
    if formats::has_ending(Path::new(name)) {
        model.load_tf(name);
    } else {
        model.open_source(name);
    }
}
