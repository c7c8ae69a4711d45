//! List of transfer-function presets, each with a thumbnail of the open volume.

use crate::app::model::Model;
use crate::app::picture_shape::{Place, shape};
use crate::engine::messages::{Job, Thumbnail, ThumbnailRequest};
use crate::files::input::source_name;
use crate::open::presets::{self, PRESETS, Preset};
use crate::render::DisplayTexture;
use crate::scene::{Scene, Shading, Skip};
use eframe::egui::{self, Color32, FontId, Sense, vec2};
use eframe::egui_wgpu::RenderState;
use std::collections::HashMap;
use std::sync::Arc;

/// Size of a preset's thumbnail, pixels.
const WIDTH: u32 = 96;
const HEIGHT: u32 = 72;
/// Factor on the camera's field of view in preset thumbnails. It enlarges the volume, because the default framing
/// leaves a margin.
const CLOSER: f64 = 0.75;
/// Ambient light of preset thumbnails, which are rendered without shadows.
const AMBIENT: f64 = 0.35;

/// Thumbnails of the open volume with each transfer-function preset.
#[derive(Default)]
pub struct Presets {
    /// Finished thumbnails by index of the transfer-function preset.
    pub thumbnails: HashMap<usize, Thumbnail>,
    /// Index of the preset whose thumbnail is being rendered; `None` if none is.
    waiting: Option<usize>,
}

impl Presets {
    /// Shows the list of transfer-function presets; a click loads the preset.
    pub fn show(&mut self, ui: &mut egui::Ui, model: &mut Model, state: Option<&RenderState>) {
        let Some(document) = &model.document else { return };
        let name = &document.tf_source.0;
        let edited = if document.tf_edited() { " (edited)" } else { "" };
        let mut chosen = None;
        let list = egui::ComboBox::from_id_salt("preset")
            .selected_text(format!("{}{edited}", source_name(name)))
            .width(150.0)
            .height(460.0_f32.min(ui.ctx().content_rect().height() - 100.0))
            .show_ui(ui, |ui| {
                for (index, preset) in PRESETS.iter().enumerate() {
                    let texture = self.thumbnail(index, model).map(|t| &t.texture);
                    if preset_row(ui, preset, preset.name == name, (index, texture), state) {
                        chosen = Some(preset.name);
                    }
                }
            });
        list.response.accessible_name("preset");
        if list.inner.is_some() {
            self.ask(model);
        }
        if let Some(preset) = chosen {
            model.load_tf(preset);
        }
    }

    /// Thumbnail of a transfer-function preset, if it shows the volume that is open now.
    fn thumbnail(&self, index: usize, model: &Model) -> Option<&Thumbnail> {
        let document = model.document.as_ref()?;
        let found = self.thumbnails.get(&index)?;
        Arc::ptr_eq(&found.volume, &document.volume).then_some(found)
    }

    /// Requests the next preset thumbnail that is missing or outdated.
    fn ask(&mut self, model: &Model) {
        let Some(document) = &model.document else { return };
        // The main picture has priority over thumbnails.
        if self.waiting.is_some() || !model.settled {
            return;
        }
        let mut camera = document.scene.camera;
        camera.fov_deg *= CLOSER;
        let scene = Scene {
            camera,
            width: WIDTH,
            height: HEIGHT,
            step: 1.0,
            ambient: AMBIENT,
            shading: Shading::Lambert,
            skip: Skip::Bricks,
            ..document.scene.clone()
        };
        let missing = |index: &usize| self.thumbnail(*index, model).is_none_or(|t| t.scene != scene);
        let Some(index) = (0..PRESETS.len()).find(missing) else { return };
        let volume = Arc::clone(&document.volume);
        let Ok(found) = presets::resolve_as(PRESETS[index].name, &volume, document.suiting) else { return };
        self.waiting = Some(index);
        model.thread.push(Job::Thumbnail(Box::new(ThumbnailRequest { index, tf: found.tf, scene, volume })));
    }

    /// Stores a preset thumbnail from the render thread.
    pub fn take(&mut self, thumbnail: Thumbnail) {
        self.waiting = None;
        self.thumbnails.insert(thumbnail.index, thumbnail);
    }
}

/// Shows one transfer-function preset in the list with its thumbnail. Returns whether the user clicked it.
fn preset_row(
    ui: &mut egui::Ui,
    preset: &Preset,
    is_shown: bool,
    (index, texture): (usize, Option<&Arc<DisplayTexture>>),
    state: Option<&RenderState>,
) -> bool {
    let size = vec2(64.0, 48.0);
    let (row, response) = ui.allocate_exact_size(vec2(430.0, size.y + 4.0), Sense::click());
    response.widget_info(|| egui::WidgetInfo::selected(egui::Role::Button, true, is_shown, preset.name));
    if !ui.is_rect_visible(row) {
        return response.clicked();
    }
    let visuals = ui.style().interact_selectable(&response, is_shown);
    if is_shown || response.hovered() {
        ui.painter().rect_filled(row, 3.0, visuals.weak_bg_fill);
    }
    let place = egui::Rect::from_min_size(row.min + vec2(2.0, 2.0), size);
    match (texture, state) {
        (Some(texture), Some(state)) => {
            ui.painter().add(shape(place, texture, Place::Preset(index), state));
        }
        _ => _ = ui.painter().rect_filled(place, 0.0, Color32::from_gray(12)),
    }
    let text = place.right_top() + vec2(10.0, 6.0);
    let color = visuals.text_color();
    ui.painter().text(text, egui::Align2::LEFT_TOP, preset.name, FontId::proportional(13.5), color);
    let about = ui.painter().layout(
        preset.about.to_owned(),
        FontId::proportional(11.0),
        ui.visuals().weak_text_color(),
        row.right() - text.x,
    );
    ui.painter().galley(text + vec2(0.0, 18.0), about, color);
    response.clicked()
}
