//! Volumes on their way into the window: by path, by drop, with what is being read on screen until it is there.

use super::curve::History;
use super::method_choice::MethodChoice;
use super::open::{Beginning, Opened, Opening, With};
use super::strands_panel::StrandsState;
use super::{App, Document, window};
use crate::files::loading::Loading;
use crate::open::{DEFAULT_SHADOW, SceneSettings, VolumeSpec};
use eframe::egui::{self, Rect, vec2};
use std::path::Path;
use std::sync::Arc;

/// Width of what says how far the reading is, points.
const WIDTH: f32 = 360.0;

impl App {
    /// Starts to open a volume; the one that is open stays until the new one is there.
    pub fn open(&mut self, spec: VolumeSpec, with: With) {
        if let With::Settings(settings) = &with {
            // Bad settings are said at once, not after a long reading.
            match MethodChoice::parse(settings.shadow.as_deref().unwrap_or(DEFAULT_SHADOW)) {
                Ok(choice) => self.view.next_method = Some(choice),
                Err(e) => return self.fail(&e),
            }
        }
        let wake = Arc::clone(&self.wake);
        match Opening::start(spec, with, move || wake()) {
            Ok(opening) => self.opening = Some(opening),
            Err(e) => self.fail(&e),
        }
    }

    /// What is being read, while it is.
    pub fn loading(&self) -> Option<Arc<Loading>> {
        self.opening.as_ref().map(|o| Arc::clone(&o.loading))
    }

    /// Ends the reading; what is shown stays.
    pub fn cancel_opening(&mut self) {
        self.opening = None;
        self.view.next_method = None;
    }

    /// Opens another volume by its path or name, with the scene's light and settings.
    pub fn open_source(&mut self, source: &str) {
        if source.to_lowercase().ends_with(".toml") {
            return self.open_scene(Path::new(source));
        }
        self.open_as_is(VolumeSpec::new(source));
    }

    fn open_as_is(&mut self, spec: VolumeSpec) {
        let with = match &self.document {
            Some(document) => With::Scene(Box::new(document.scene.clone())),
            None => With::Settings(Box::new(SceneSettings {
                shading: Some(window::SHADING),
                ..SceneSettings::of_volume(&spec)
            })),
        };
        self.open(spec, with);
    }

    /// Opens what a scene file says.
    pub fn open_scene(&mut self, path: &Path) {
        match SceneSettings::read(path) {
            Ok(settings) => self.open(settings.spec(), With::Settings(Box::new(settings))),
            Err(e) => self.fail(&e),
        }
    }

    pub(super) fn take_volume(&mut self, mut opened: Opened) {
        self.settings.opened(&opened.spec.source);
        let notes = std::mem::take(&mut opened.notes);
        let resumed = self.take_resumed(&opened.volume);
        match opened.beginning.take() {
            _ if resumed => {}
            Some(beginning) => self.take_beginning(opened, beginning),
            None => match &mut self.document {
                Some(document) if document.spec.source == opened.spec.source => document.take_voxels(opened),
                // Something else was opened meanwhile: these are strands that nothing is known of any more.
                _ => return self.open_as_is(opened.spec),
            },
        }
        if let Some(document) = &self.document {
            self.strands = StrandsState::of(document);
        }
        self.presets = Default::default();
        self.difference = self.difference.only_choices();
        self.probe = None;
        self.probe_at = None;
        self.slices.reset(self.document.as_ref());
        self.asked = None;
        notes.into_iter().for_each(|n| self.note(n));
    }

    fn take_beginning(&mut self, opened: Opened, mut beginning: Beginning) {
        let old = self.document.take();
        let method = self.view.next_method.take().or_else(|| old.as_ref().map(|d| d.method.clone()));
        let dsm =
            || MethodChoice::parse("dsm").unwrap_or_else(|_| MethodChoice::of(crate::shadow::METHODS[0]));
        let transparent = old.as_ref().is_some_and(|d| d.transparent);
        beginning.transparent.get_or_insert(transparent);
        let other = old
            .map_or_else(|| MethodChoice::parse("none").unwrap_or_else(|_| dsm()), |document| document.other);
        let methods = [method.unwrap_or_else(dsm), other];
        self.document = Some(Document::new(opened, beginning, methods));
        self.history = History::default();
        self.editor = Default::default();
        self.view.home = self.document.as_ref().map(|d| d.scene.camera);
        self.frame = None;
    }

    pub(super) fn take_dropped_files(&mut self, context: &egui::Context) {
        let names = context.input(|i| {
            let path = |f: &egui::DroppedFileHandle| f.path().display().to_string();
            i.raw.dropped_files.iter().map(path).collect::<Vec<_>>()
        });
        let Some(name) = names.first() else { return };
        if names.len() > 1 {
            self.note(format!("{} files were dropped: only {name} was taken", names.len()));
        }
        if name.to_lowercase().ends_with(".json") {
            self.load_tf(name);
        } else {
            self.open_source(name);
        }
    }

    /// What is being read, how far that is, and its end.
    pub(super) fn paint_opening(&mut self, ui: &mut egui::Ui, rect: Rect) {
        let Some(opening) = &self.opening else { return };
        let progress = opening.progress();
        let source = opening.source.as_str();
        let name = source.rsplit(['/', '\\']).next().unwrap_or(source);
        let seconds = opening.elapsed().as_secs_f64();
        let mut cancelled = false;
        egui::Area::new(ui.scope_id().with("opening"))
            .fixed_pos(rect.center_top() + vec2(-0.5 * WIDTH, 24.0))
            .order(egui::Order::Foreground)
            .show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.set_width(WIDTH);
                    ui.add(egui::Label::new(format!("{name}: {}", progress.stage.name())).truncate())
                        .on_hover_text(source);
                    ui.horizontal(|ui| {
                        cancelled = ui.button("Cancel").on_hover_text("End the reading").clicked();
                        ui.weak(format!("{seconds:.0} s"));
                        let bar = egui::ProgressBar::new(progress.share as f32).show_percentage();
                        ui.add(bar).accessible_name("share read");
                    });
                });
            });
        if cancelled {
            self.cancel_opening();
        }
    }
}
